"""`twinscrew view`: a page in the browser that shows boats under way, or a recording."""

from __future__ import annotations

import asyncio
import os
import shlex
import signal
import socket
from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from twinscrew.hil_sim.viewer import sources
from twinscrew.hil_sim.viewer.server import HOST, listen, serve
from twinscrew.hil_sim.viewer.sources import RecordedSource, Source
from twinscrew.runtime.errors import ConfigError
from twinscrew.runtime.vessel.process import at_end_of_input

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
    orders: Annotated[
        bool,
        typer.Option("--orders", help="Let the page give goals to boats under way, and stop them."),
    ] = False,
    tethered: Annotated[
        bool, typer.Option("--tethered", help="Stop, too, when standard input ends.")
    ] = False,
) -> None:
    """Show boats in a browser on this machine: under way, or from a recording. Works offline."""
    given = [way for way in (connect, config, run, replay) if way]
    if len(given) != 1:
        raise ConfigError("give one of --connect, --config, --run and --replay", key="view")
    if orders and replay is not None:
        raise ConfigError("a recording takes no orders", key="--orders")
    with listen(port) as taken:
        os.nice(NICE)
        number = taken.getsockname()[1]
        # Said before anything is read: a browser that comes early waits for the first answer.
        print(f"http://{HOST}:{number}", flush=True)
        source: Source
        if replay is not None:
            source = RecordedSource(replay, topics)
            way = ["--replay", str(replay), *(["--topics", str(topics)] if topics else [])]
        elif run is not None:
            source = sources.from_run(run, orders=orders)
            way = ["--run", str(run)]
        elif config:
            source = sources.from_configs(config, orders=orders)
            way = [word for file in config for word in ("--config", str(file))]
        else:
            source = sources.from_endpoint(str(connect), names, sensor, orders=orders)
            way = ["--connect", str(connect), "--names", names, "--sensor", sensor]
        switched = ["--orders"] if orders else []
        again = shlex.join(["twinscrew", "view", *way, *switched, "--port", str(number)])
        asyncio.run(_until_stopped(source, taken, again, tethered=tethered))


async def _until_stopped(
    source: Source, port: socket.socket, again: str, *, tethered: bool
) -> None:
    stop, loop = asyncio.Event(), asyncio.get_running_loop()
    for number in (signal.SIGINT, signal.SIGTERM):
        loop.add_signal_handler(number, stop.set)
    if tethered:
        at_end_of_input(partial(loop.call_soon_threadsafe, stop.set))
    await serve(source, port, stop, again)
