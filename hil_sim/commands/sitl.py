"""`twinscrew sitl`: simulated vessels sail on the real runtime."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated

import msgspec
import typer
from rich.console import Console
from rich.markup import escape

from twinscrew.hil_sim.bridges.ardupilot_fleet import ArduPilotSettings
from twinscrew.hil_sim.commands.sitl_answer import tell
from twinscrew.hil_sim.commands.sitl_progress import sail_shown
from twinscrew.hil_sim.drivers.vrx import as_vrx_names_it
from twinscrew.hil_sim.scenario import Scenario, load_scenario, on_trial
from twinscrew.hil_sim.sensors.marine import AisTransponders, MarineSettings, RadarUnit
from twinscrew.hil_sim.sitl_settings import (
    AutopilotKind,
    Interface,
    OdometrySource,
    SitlSettings,
    check,
)
from twinscrew.hil_sim.summary import write_summary
from twinscrew.hil_sim.viewer.process import viewer
from twinscrew.hil_sim.viewer.scene import SCENE_FILE, write_scene
from twinscrew.runtime.errors import ConfigError, TwinscrewError
from twinscrew.runtime.messages.topics import KeyFormat

NOT_ALL_ARRIVED = 1


def sitl(
    scenario: Annotated[
        str,
        typer.Option(
            help="random, harbour, harbour:gap, fences, current:0.3, head_on, ..., or a TOML file."
        ),
    ] = "random",
    vessels: Annotated[int | None, typer.Option(help="How many vessels.", min=1, max=20)] = None,
    buoys: Annotated[int | None, typer.Option(help="How many buoys.", min=0, max=50)] = None,
    vessel: Annotated[
        list[str] | None,
        typer.Option(help="What sails: a name in config/vessels, or a file. Several: in turn."),
    ] = None,
    chart: Annotated[
        bool, typer.Option(help="Whether the vessels have the scenario's land and fences as chart.")
    ] = True,
    seed: Annotated[int, typer.Option(help="What everything random is drawn from.", min=0)] = 0,
    policy: Annotated[
        str, typer.Option(help="apf, mpc, orca, sbmpc, a name in config/policies, or an ONNX file.")
    ] = "ac_iqn",
    trial: Annotated[
        str,
        typer.Option(help="Sail a trial, not to goals: straight, zigzag, circle, stop or all."),
    ] = "",
    believed: Annotated[
        str, typer.Option(help="What the runtimes take the vessels for: a name, or a file.")
    ] = "",
    lockstep: Annotated[
        bool, typer.Option("--lockstep", help="In one process, as fast as it goes, determined.")
    ] = False,
    processes: Annotated[
        bool,
        typer.Option("--processes", help="With --lockstep: a process a runtime, led over Zenoh."),
    ] = False,
    max_time: Annotated[
        float | None, typer.Option(help="Time limit of the voyage [s], simulated.")
    ] = None,
    out: Annotated[Path | None, typer.Option(help="Folder of the run's files.")] = None,
    view: Annotated[
        bool,
        typer.Option("--view", help="Show it in a browser, and its replay until Ctrl-C."),
    ] = False,
    orders: Annotated[
        bool, typer.Option("--orders", help="With --view: let the page give goals and stop boats.")
    ] = False,
    port: Annotated[
        int, typer.Option(help="With --view: port of the page; 0: any.", min=0, max=65535)
    ] = 8077,
    autopilot: Annotated[
        AutopilotKind, typer.Option(help="Our simulated autopilots, or real ArduRovers.")
    ] = AutopilotKind.TWINSCREW,
    ardupilot_binary: Annotated[
        Path | None,
        typer.Option(
            help="ArduRover's simulator, started once a vessel. Without it you start them.",
            exists=True,
            dir_okay=False,
        ),
    ] = None,
    ardupilot_instance: Annotated[
        int, typer.Option(help="Instance number of the first vessel's ArduPilot.", min=0, max=200)
    ] = 0,
    ardupilot_memory: Annotated[
        Path | None,
        typer.Option(
            help="Folder in which the ArduPilots keep what was written, from run to run.",
            file_okay=False,
        ),
    ] = None,
    odometry: Annotated[
        OdometrySource, typer.Option(help="Where the runtimes take odometry from.")
    ] = OdometrySource.BUS,
    ais: Annotated[
        bool, typer.Option("--ais", help="Ships report themselves, and the runtimes use it.")
    ] = False,
    radar: Annotated[
        bool, typer.Option("--radar", help="Vessels have a radar beside their LiDAR.")
    ] = False,
    write_params: Annotated[
        bool, typer.Option("--write-params", help="Write autopilot parameters that are wrong.")
    ] = False,
    ground: Annotated[
        str,
        typer.Option(help="HOST:PORT where a ground station listens (UDP), as 127.0.0.1:14550."),
    ] = "",
    interface: Annotated[
        Interface,
        typer.Option(help="vrx: the simulator alone, behind VRX's topics; you start the runtime."),
    ] = Interface.TWINSCREW,
    sensor: Annotated[
        str, typer.Option(help="The LiDAR: a name in config/sensors, or a file.")
    ] = SitlSettings().sensor,
    key_format: Annotated[
        KeyFormat, typer.Option(help="Zenoh keys of zenoh-bridge-ros2dds, or of ROS 2's rmw_zenoh.")
    ] = "ros2dds",
    domain: Annotated[
        int, typer.Option(help="ROS_DOMAIN_ID, for rmw_zenoh's keys.", min=0, max=232)
    ] = 0,
    zenoh_port: Annotated[
        int | None,
        typer.Option(
            help="Where Zenoh listens on this machine; 7447 for vrx, else any.", min=0, max=65535
        ),
    ] = None,
    zenoh_connect: Annotated[
        list[str] | None,
        typer.Option(help="A Zenoh router to join, as tcp/127.0.0.1:7447; without it, be one."),
    ] = None,
    faults: Annotated[
        str, typer.Option(help="What goes wrong: a TOML file, or a name in config/faults.")
    ] = "",
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
) -> None:
    """Sail simulated vessels with the real runtime, sensors to thrust.

    Exit status 0 if every vessel arrived (or sailed its trial to the end) and every promise was
    kept, 1 if not, 2 for a usage or set-up error.
    """
    if trial and vessels is None and scenario == "random":
        vessels = max(1, len(vessel or ()))
    made = _with_limit(load_scenario(scenario, vessels, buoys, seed, vessel or ()), max_time)
    if interface is Interface.VRX:
        made = as_vrx_names_it(made)
    if orders and (lockstep or not view):
        raise ConfigError("only with --view, and in real time", key="--orders")
    if ardupilot_binary is not None and autopilot is not AutopilotKind.ARDUPILOT:
        raise ConfigError("only with --autopilot ardupilot", key="--ardupilot-binary")
    if ardupilot_memory is not None and autopilot is not AutopilotKind.ARDUPILOT:
        raise ConfigError("only with --autopilot ardupilot", key="--ardupilot-memory")
    settings = SitlSettings(
        policy=policy,
        trial=trial,
        trial_time_s=max_time or SitlSettings().trial_time_s,
        believed=believed,
        charted=chart,
        seed=seed,
        lockstep=lockstep,
        processes=processes,
        autopilot=autopilot,
        ardupilot=ArduPilotSettings(
            binary=str(ardupilot_binary or ""),
            memory=str(ardupilot_memory or ""),
            first_instance=ardupilot_instance,
        ),
        odometry=odometry,
        marine=MarineSettings(
            ais=AisTransponders() if ais else None, radar=RadarUnit() if radar else None
        ),
        write_params=write_params,
        faults=faults,
        ground=ground,
        interface=interface,
        sensor=sensor,
        key_format=key_format,
        domain=domain,
        zenoh_port=zenoh_port,
        zenoh_connect=tuple(zenoh_connect or ()),
    )
    if trial:
        check(settings)
        made = on_trial(made, trial, settings.trial_time_s)
    console = Console(stderr=True)
    with ExitStack() as stack:
        folder = stack.enter_context(_new_folder(out))
        write_scene(folder, made)
        if not as_json:
            pace = "in step" if lockstep else "in real time"
            many = f"{made.vessels} vessel{'s' if made.vessels > 1 else ''}"
            drives = f"trial {escape(trial)}" if trial else f"policy {escape(policy)}"
            console.print(f"{many}, {escape(made.name)}, seed {seed}, {drives}, {pace}")
        shown = None
        if view and not lockstep:
            shown = stack.enter_context(viewer("run", folder, port, orders=orders))
            console.print(f"live view: [bold]{shown.url}[/bold]")
        report = sail_shown(made, settings, folder, console, quiet=as_json)
        setup = {"scenario": made.name, **msgspec.to_builtins(settings)}
        write_summary(folder / "summary.json", report, setup)  # the live view goes over to replay
        tell(report, folder, as_json=as_json)
        if view and lockstep:
            shown = stack.enter_context(viewer("replay", folder, port))
        if shown is not None:
            console.print(f"replay: [bold]{shown.url}[/bold], until Ctrl-C")
            with suppress(KeyboardInterrupt):
                shown.wait()
    if not report.success or not report.kept:
        raise typer.Exit(NOT_ALL_ARRIVED)


def _with_limit(scenario: Scenario, max_time: float | None) -> Scenario:
    if max_time is None:
        return scenario
    if not 0.0 < max_time < float("inf"):
        raise ConfigError(f"must be greater than 0, got {max_time}", key="--max-time")
    return replace(scenario, time_limit_s=max_time)


@contextmanager
def _new_folder(out: Path | None) -> Iterator[Path]:
    """Give the run's folder; if the run is refused it is left as it was, for the next try."""
    folder = out or Path("runs") / datetime.now(UTC).strftime("%Y%m%d-%H%M%S-%f")
    there = folder.exists()
    try:
        folder.mkdir(parents=True, exist_ok=True)
        if any(folder.iterdir()):
            raise ConfigError("the folder is not empty; a run needs a new one", file=folder)
    except OSError as error:
        raise ConfigError(error.strerror or str(error), file=folder) from error
    try:
        yield folder
    except TwinscrewError:
        if [path.name for path in folder.iterdir()] == [SCENE_FILE]:
            (folder / SCENE_FILE).unlink()
            if not there:
                folder.rmdir()
        raise
