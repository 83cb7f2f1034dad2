"""`twinscrew view`: a page in the browser that shows boats under way, or a recording."""

from __future__ import annotations

import asyncio
import os
import signal
import socket
from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from twinscrew.hil_sim.viewer import open_source
from twinscrew.hil_sim.viewer.loopback import HOST, listen
from twinscrew.hil_sim.viewer.server import serve
from twinscrew.hil_sim.viewer.source import Source
from twinscrew.runtime.app.tether import at_end_of_input
from twinscrew.runtime.errors import ConfigError

PORT = 8077
NICE = 10
"""[-] What steers goes first, what shows comes after."""


def view(
    connect: Annotated[
        str | None, typer.Option(help="Zenoh endpoint of a running boat, as tcp/10.0.0.5:7447.")
    ] = None,
    names: Annotated[str, typer.Option(help="With --connect: vessels, by commas.")] = "wamv",
    sensor: Annotated[
        str, typer.Option(help="With --connect: LiDAR, a name in config/sensors or a file.")
    ] = "vrx32",
    config: Annotated[
        list[Path] | None,
        typer.Option(help="Instead of the three: a boat's TOML file; several for several boats."),
    ] = None,
    run: Annotated[
        Path | None, typer.Option(help="A run that `twinscrew sitl` is sailing in real time.")
    ] = None,
    replay: Annotated[
        Path | None, typer.Option(help="A run's folder, a rosbag2 folder, or one .mcap file.")
    ] = None,
    topics: Annotated[
        Path | None, typer.Option(help="With --replay: TOML that maps a foreign bag's topics.")
    ] = None,
    port: Annotated[int, typer.Option(help="Port of the page; 0: any.", min=0, max=65535)] = PORT,
    tethered: Annotated[
        bool, typer.Option("--tethered", help="Stop, too, when standard input ends.")
    ] = False,
) -> None:
    """Show boats in a browser on this machine: under way, or from a recording. Works offline."""
    given = [way for way in (connect, config, run, replay) if way]
    if len(given) != 1:
        raise ConfigError("give one of --connect, --config, --run and --replay", key="view")
    with listen(port) as taken:
        os.nice(NICE)
        # Said before anything is read: a browser that comes early waits for the first answer.
        print(f"http://{HOST}:{taken.getsockname()[1]}", flush=True)
        source: Source
        if replay is not None:
            source = open_source.from_recording(replay, topics)
        elif run is not None:
            source = open_source.from_run(run)
        elif config:
            source = open_source.from_configs(config)
        else:
            source = open_source.from_endpoint(str(connect), names, sensor)
        try:
            asyncio.run(_until_stopped(source, taken, tethered=tethered))
        finally:
            source.close()


async def _until_stopped(source: Source, port: socket.socket, *, tethered: bool) -> None:
    stop, loop = asyncio.Event(), asyncio.get_running_loop()
    for number in (signal.SIGINT, signal.SIGTERM):
        loop.add_signal_handler(number, stop.set)
    if tethered:
        at_end_of_input(partial(loop.call_soon_threadsafe, stop.set))
    await serve(source, port, stop)
