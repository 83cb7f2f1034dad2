"""Software in the loop: a scenario, its vessels' runtimes, and what became of them."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import Enum
from pathlib import Path
from typing import Literal

from msgspec.structs import replace

from twinscrew.hil_sim.autopilot.telemetry import Origin
from twinscrew.hil_sim.bridges.ardupilot_fleet import ArduPilotFleet, ArduPilotSettings
from twinscrew.hil_sim.drivers.fleet import Fleet, simulated_fleet
from twinscrew.hil_sim.drivers.lockstep import LockstepCrew
from twinscrew.hil_sim.drivers.processes import ProcessCrew
from twinscrew.hil_sim.drivers.punctual import punctual
from twinscrew.hil_sim.drivers.realtime import RealtimeCrew
from twinscrew.hil_sim.drivers.voyage import DOCK_LIMIT_S, Crew, Voyage, VoyageResult
from twinscrew.hil_sim.faults.assemble import faulty_crew, plans_by_vessel, verdicts
from twinscrew.hil_sim.faults.plan import FaultPlan, load_plan
from twinscrew.hil_sim.faults.verdict import Verdict
from twinscrew.hil_sim.figures import draw_trajectories
from twinscrew.hil_sim.scenario import Scenario
from twinscrew.hil_sim.sensors.navigation import Navigation, NavigationSettings
from twinscrew.hil_sim.supervisor import Result
from twinscrew.hil_sim.world import World, make_world
from twinscrew.runtime.app.config import RuntimeConfig
from twinscrew.runtime.app.ground import GroundSettings
from twinscrew.runtime.app.latency import LatencySummary
from twinscrew.runtime.app.mission import MissionSettings
from twinscrew.runtime.app.recording_settings import RecordingSettings
from twinscrew.runtime.app.replay import combined_sha256
from twinscrew.runtime.app.session import RunSummary, nothing_told, read_summary
from twinscrew.runtime.errors import ConfigError
from twinscrew.runtime.estimation.estimator import EstimationSettings
from twinscrew.runtime.link.autopilot import AutopilotSettings
from twinscrew.runtime.link.datum import Datum
from twinscrew.runtime.perception.sensor import load_sensor
from twinscrew.runtime.settings import Settings

Progress = Callable[[float, tuple[Result, ...]], None]
Tell = Callable[[str], None]
DATUM = Datum(latitude_deg=Origin().latitude_deg, longitude_deg=Origin().longitude_deg)
"""Where the scenarios' origin lies: the vessels sail in one frame."""
ALL_TOLD = GroundSettings(obstacles_hz=5.0, vessels_hz=1.0, latency_hz=1.0)
"""What a ground station that watches is told."""
ARDUPILOT_DOCK_LIMIT_S = 180.0
"""[s] A real autopilot calibrates, finds its position and settles before it lets itself be armed
(about 20 s, measured), and the last of several may be started late."""


class AutopilotKind(Enum):
    """Whose autopilots."""

    TWINSCREW = "twinscrew"
    """Our simulated ones."""
    ARDUPILOT = "ardupilot"
    """A real ArduRover a vessel, whose physics the simulator is."""


class OdometrySource(Enum):
    """Where the runtimes' odometry comes from."""

    BUS = "bus"
    """The `odometry` topic: what the simulated sensor measures."""
    AUTOPILOT = "autopilot"
    """What the autopilot says of its position, velocity and attitude."""
    AUTOPILOT_ODOMETRY = "autopilot_odometry"
    """The same in one message, ODOMETRY, which ArduPilot does not send."""
    GPS_IMU = "gps_imu"
    """A filter of what a simulated GPS and IMU measure, with VRX's rates and noise."""


_RUNTIMES_SOURCE: dict[OdometrySource, Literal["bus", "autopilot", "gps_imu"]] = {
    OdometrySource.BUS: "bus",
    OdometrySource.AUTOPILOT: "autopilot",
    OdometrySource.AUTOPILOT_ODOMETRY: "autopilot",
    OdometrySource.GPS_IMU: "gps_imu",
}


class SitlSettings(Settings, frozen=True):
    """What to sail with."""

    sensor: str = "vrx32"
    policy: str = "ac_iqn"
    seed: int = 0
    lockstep: bool = False
    processes: bool = False
    """In lock-step, whether each runtime has a process of its own, led over Zenoh."""
    autopilot: AutopilotKind = AutopilotKind.TWINSCREW
    ardupilot: ArduPilotSettings = ArduPilotSettings()
    odometry: OdometrySource = OdometrySource.BUS
    navigation: NavigationSettings = NavigationSettings()
    """The simulated GPS and IMU; only for `odometry = "gps_imu"`."""
    faults: str = ""
    """A file of faults, or the name of one in config/faults; empty: none."""
    write_params: bool = False
    """Whether the runtimes write the autopilots' parameters that are not what they must be."""
    ground: str = ""
    """HOST:PORT where a ground station listens for the autopilots (UDP); empty: there is none."""


@dataclass(frozen=True, slots=True, kw_only=True)
class VesselReport:
    """How one vessel fared, and its runtime."""

    name: str
    outcome: str
    travel_time_s: float
    closest_approach_m: float
    decisions: int
    latency: LatencySummary
    energy_ns: float
    sha256: str


@dataclass(frozen=True, slots=True, kw_only=True)
class SitlReport:
    """How a run went."""

    success: bool
    seed: int
    vessels: tuple[VesselReport, ...]
    real_time_factor: float
    wall_s: float
    verdicts: tuple[tuple[str, Verdict], ...] = ()
    """By vessel: what was promised in case of faults, and what was measured."""

    @property
    def kept(self) -> bool:
        """Whether every promise was kept; true without faults."""
        return all(verdict.kept for _, verdict in self.verdicts)

    @property
    def sha256(self) -> str:
        """SHA-256 over all vessels' decisions."""
        return combined_sha256(vessel.sha256 for vessel in self.vessels)


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
    if settings.lockstep and settings.ground:
        raise ConfigError("a ground station needs real time: without --lockstep", key="ground")
    if settings.lockstep and settings.autopilot is AutopilotKind.ARDUPILOT:
        raise ConfigError("ArduPilot runs in real time only: without --lockstep", key="autopilot")
    if (settings.autopilot, settings.odometry) == (
        AutopilotKind.ARDUPILOT,
        OdometrySource.AUTOPILOT_ODOMETRY,
    ):
        raise ConfigError("ArduPilot sends no ODOMETRY: autopilot", key="odometry")
    if settings.processes and not settings.lockstep:
        raise ConfigError(
            "in real time each has its process anyway: with --lockstep", key="processes"
        )
    ours = settings.autopilot is AutopilotKind.TWINSCREW
    if settings.faults and (settings.lockstep or settings.ground or not ours):
        raise ConfigError("only in real time, with our autopilots and no station", key="faults")
    plan = load_plan(settings.faults, scenario.names) if settings.faults else None
    world = make_world(scenario, sensor=settings.sensor, seed=settings.seed)
    folders = [folder / name for name in scenario.names] if folder else []
    configs = [
        _config(settings, scenario, i, str(folders[i]) if folders else "")
        for i in range(scenario.vessels)
    ]
    begin_s = time.monotonic()
    judged: tuple[tuple[str, Verdict], ...] = ()
    if settings.lockstep:
        result, runs = _sail_in_step(world, configs, settings, progress)
    elif folder is None:
        raise ConfigError("real time needs a folder for the runtimes' files", key="out")
    elif plan is not None:
        result, runs, judged = _sail_with_faults(world, configs, folders, settings, plan, progress)
    else:
        result, runs = _sail_in_real_time(world, configs, folders, settings, progress, tell)
    wall_s = time.monotonic() - begin_s
    report = SitlReport(
        success=result.success,
        seed=settings.seed,
        vessels=_vessel_reports(result, runs),
        real_time_factor=result.duration_s / wall_s,
        wall_s=wall_s,
        verdicts=judged,
    )
    if folder is not None:
        outcomes = [vessel.outcome for vessel in report.vessels]
        travel_s = [vessel.travel_time_s for vessel in report.vessels]
        draw_trajectories(folder / "trajectories.png", scenario, result.log, outcomes, travel_s)
    return report


def _sail_in_step(
    world: World, configs: list[RuntimeConfig], settings: SitlSettings, progress: Progress | None
) -> tuple[VoyageResult, list[RunSummary]]:
    if settings.processes:
        with ProcessCrew(configs, epoch_ns=world.epoch_ns) as crew:
            result = _voyage(world, crew, settings, progress).run()
            return result, crew.summaries()
    local = LockstepCrew(configs, epoch_ns=world.epoch_ns)
    try:
        result = _voyage(world, local, settings, progress).run()
    finally:
        local.close()
    return result, local.summaries()


def _sail_in_real_time(
    world: World,
    configs: list[RuntimeConfig],
    folders: list[Path],
    settings: SitlSettings,
    progress: Progress | None,
    tell: Tell,
) -> tuple[VoyageResult, list[RunSummary]]:
    fleet = _fleet(world, folders, settings, tell)
    with RealtimeCrew(configs, folders, fleet, tell if fleet is not None else None) as crew:
        result = _voyage(world, crew, settings, progress).run()
    return result, [read_summary(folder) for folder in folders]


def _sail_with_faults(
    world: World,
    configs: list[RuntimeConfig],
    folders: list[Path],
    settings: SitlSettings,
    plan: FaultPlan,
    progress: Progress | None,
) -> tuple[VoyageResult, list[RunSummary], tuple[tuple[str, Verdict], ...]]:
    names = world.scenario.names
    plans = plans_by_vessel(plan, names)
    with punctual(), faulty_crew(world, configs, folders, plans, settings.seed) as crew:
        result = _voyage(world, crew, settings, progress).run()
        down = crew.down
    runs = [
        nothing_told(names[vessel]) if vessel in down else read_summary(folder)
        for vessel, folder in enumerate(folders)
    ]
    return result, runs, tuple(verdicts(crew, plans, folders).items())


def _fleet(world: World, folders: list[Path], settings: SitlSettings, tell: Tell) -> Fleet | None:
    if settings.autopilot is AutopilotKind.TWINSCREW:
        ids = [index + 1 for index in range(world.scenario.vessels)]
        return simulated_fleet(ids, ground=settings.ground) if settings.ground else None
    ardupilot = replace(settings.ardupilot, ground=settings.ground)
    return ArduPilotFleet(world, folders, ardupilot, tell)


def _voyage(
    world: World,
    crew: Crew,
    settings: SitlSettings,
    progress: Progress | None,
) -> Voyage:
    scan_s = 1.0 / load_sensor(settings.sensor).rate_hz
    ours = settings.autopilot is AutopilotKind.TWINSCREW
    dock_s = DOCK_LIMIT_S if ours else ARDUPILOT_DOCK_LIMIT_S
    sensed = settings.odometry is OdometrySource.GPS_IMU
    return Voyage(
        world,
        crew,
        scan_s=scan_s,
        dock_limit_s=dock_s,
        progress=progress,
        navigation=Navigation(world, settings.navigation) if sensed else None,
    )


def _config(settings: SitlSettings, scenario: Scenario, index: int, folder: str) -> RuntimeConfig:
    policy = Path(settings.policy)
    whole = settings.odometry is OdometrySource.AUTOPILOT_ODOMETRY
    return RuntimeConfig(
        name=scenario.names[index],
        sensor=settings.sensor,
        policy=str(policy.resolve()) if policy.is_file() else settings.policy,
        odometry_source=_RUNTIMES_SOURCE[settings.odometry],
        estimation=EstimationSettings(datum=DATUM, sensors=settings.navigation.place),
        mission=MissionSettings(goal_radius_m=scenario.goal_radius),
        autopilot=AutopilotSettings(
            system_id=index + 1,
            arm=True,
            receiver_fitted=False,
            write_parameters=settings.write_params,
            state_message="odometry" if whole else "local_position",
            datum=DATUM,
        ),
        ground=ALL_TOLD if settings.ground else GroundSettings(),
        recording=RecordingSettings(
            folder=folder, about={"scenario": scenario.name, "seed": str(settings.seed)}
        ),
    )


def _vessel_reports(result: VoyageResult, runs: Sequence[RunSummary]) -> tuple[VesselReport, ...]:
    energy = result.log.energy_ns()
    return tuple(
        VesselReport(
            name=vessel.name,
            outcome=vessel.outcome.value if vessel.outcome else "timeout",
            travel_time_s=vessel.travel_time_s,
            closest_approach_m=vessel.closest_approach_m,
            decisions=run.decisions,
            latency=LatencySummary(run.decisions, **run.latency_ms),
            energy_ns=float(energy[i]),
            sha256=run.decisions_sha256,
        )
        for i, (vessel, run) in enumerate(zip(result.results, runs, strict=True))
    )
