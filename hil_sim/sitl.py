"""Software in the loop: a scenario, its vessels' runtimes, and what became of them."""

from __future__ import annotations

import time
from pathlib import Path

from twinscrew.hil_sim.faults.plan import load_plan
from twinscrew.hil_sim.figures import draw_trajectories
from twinscrew.hil_sim.lidar import LidarSettings
from twinscrew.hil_sim.rules.evidence import true_tracks, write_tracks
from twinscrew.hil_sim.scenario import Scenario
from twinscrew.hil_sim.sitl_report import SitlReport, vessel_reports
from twinscrew.hil_sim.sitl_runtimes import runtime_config
from twinscrew.hil_sim.sitl_settings import Interface, SitlSettings, check
from twinscrew.hil_sim.sitl_voyages import (
    Progress,
    Sailed,
    Setup,
    Tell,
    sail_as_vrx,
    sail_in_real_time,
    sail_in_step,
    sail_with_faults,
)
from twinscrew.hil_sim.supervisor import Result
from twinscrew.hil_sim.viewer.scene import OutcomeLog
from twinscrew.hil_sim.world import EPOCH_NS, World, WorldSettings, make_world
from twinscrew.runtime.errors import ConfigError

__all__ = ["SitlReport", "SitlSettings", "sail"]


def sail(
    scenario: Scenario,
    settings: SitlSettings,
    folder: Path | None = None,
    progress: Progress | None = None,
    tell: Tell = print,
) -> SitlReport:
    """Sail a scenario to its end, and leave recordings and figure in a folder.

    Without a folder nothing is kept; real time needs one, for the runtimes' files. `tell` takes
    what the user has to do, if anything.

    Raises
    ------
    TwinscrewError
        Something cannot be used, or a runtime failed: nothing is hidden in the outcome.
    """
    check(settings)
    plan = load_plan(settings.faults, scenario.names) if settings.faults else None
    vrx = settings.interface is Interface.VRX
    world = _vrx_world(scenario, settings) if vrx else _world(scenario, settings)
    folders = [folder / name for name in scenario.names] if folder else []
    configs = [
        runtime_config(settings, scenario, i, folders[i] if folders else None)
        for i in range(scenario.vessels)
    ]
    setup = Setup(
        settings=settings,
        world=world,
        configs=configs,
        folders=folders,
        progress=_noted(progress, folder, world),
        tell=tell,
    )
    begin_s = time.monotonic()
    if vrx:
        sailed = sail_as_vrx(setup)
    elif settings.lockstep:
        sailed = sail_in_step(setup)
    elif folder is None:
        raise ConfigError("real time needs a folder for the runtimes' files", key="out")
    elif plan is not None:
        sailed = sail_with_faults(setup, plan)
    else:
        sailed = sail_in_real_time(setup)
    report = _report(settings, sailed, sailed.result.ended_s - begin_s)
    if folder is not None:
        _draw(folder / "trajectories.png", scenario, sailed, report)
        if len(sailed.result.log.times) > 0:
            write_tracks(folder, true_tracks(scenario, sailed.result.log, sailed.result.results))
    return report


def _world(scenario: Scenario, settings: SitlSettings) -> World:
    """Give the simulated world; in real time its stamps are those of this machine's clock."""
    epoch_ns = EPOCH_NS if settings.lockstep else time.time_ns()
    return make_world(scenario, sensor=settings.sensor, seed=settings.seed, epoch_ns=epoch_ns)


def _vrx_world(scenario: Scenario, settings: SitlSettings) -> World:
    """Give a world as Gazebo's: clouds of one point a ray, time from zero."""
    whole = WorldSettings(lidar=LidarSettings(organised=True))
    return make_world(
        scenario, sensor=settings.sensor, seed=settings.seed, settings=whole, epoch_ns=0
    )


def _noted(progress: Progress | None, folder: Path | None, world: World) -> Progress | None:
    """Have what becomes of the vessels written down, for those who look on."""
    if folder is None:
        return progress
    log = OutcomeLog(folder, world)

    def note(time_s: float, results: tuple[Result, ...]) -> None:
        log.note(results)
        if progress is not None:
            progress(time_s, results)

    return note


def _report(settings: SitlSettings, sailed: Sailed, wall_s: float) -> SitlReport:
    return SitlReport(
        success=sailed.result.success,
        seed=settings.seed,
        vessels=vessel_reports(sailed.result, sailed.runs),
        real_time_factor=sailed.result.duration_s / wall_s,
        wall_s=wall_s,
        verdicts=sailed.verdicts,
    )


def _draw(path: Path, scenario: Scenario, sailed: Sailed, report: SitlReport) -> None:
    outcomes = [vessel.outcome for vessel in report.vessels]
    travel_s = [vessel.travel_time_s for vessel in report.vessels]
    draw_trajectories(path, scenario, sailed.result.log, outcomes, travel_s)
