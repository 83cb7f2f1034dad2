"""The voyages of software in the loop: in step, in real time, and in real time with faults."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

from msgspec.structs import replace

from twinscrew.hil_sim.bridges.ardupilot_fleet import ArduPilotFleet
from twinscrew.hil_sim.drivers.lockstep import LockstepCrew, ProcessCrew
from twinscrew.hil_sim.drivers.processes import punctual
from twinscrew.hil_sim.drivers.realtime import Fleet, RealtimeCrew, simulated_fleet
from twinscrew.hil_sim.drivers.voyage import DOCK_LIMIT_S, Crew, Voyage, VoyageResult
from twinscrew.hil_sim.drivers.vrx import Vrx
from twinscrew.hil_sim.faults.assemble import faulty_crew, plans_by_vessel, verdicts
from twinscrew.hil_sim.faults.plan import FaultPlan
from twinscrew.hil_sim.faults.verdict import Verdict
from twinscrew.hil_sim.sensors.marine import MarineSensors
from twinscrew.hil_sim.sensors.navigation import Navigation
from twinscrew.hil_sim.sitl_runtimes import DATUM, simulator_zenoh
from twinscrew.hil_sim.sitl_settings import OdometrySource, SitlSettings
from twinscrew.hil_sim.supervisor import Result
from twinscrew.hil_sim.world import World
from twinscrew.runtime.bus.zenoh import ZenohBus
from twinscrew.runtime.link.ardupilot.thrust import PaddleSettings
from twinscrew.runtime.perception.sensor import load_sensor
from twinscrew.runtime.settings import convert
from twinscrew.runtime.vessel.config import RuntimeConfig
from twinscrew.runtime.vessel.hull_settings import paddles
from twinscrew.runtime.vessel.summary import RunSummary, read_summary

Progress = Callable[[float, tuple[Result, ...]], None]
Tell = Callable[[str], None]
ARDUPILOT_DOCK_LIMIT_S = 180.0
"""[s] A real autopilot calibrates, finds its position and settles before it lets itself be armed
(about 20 s, measured), and the last of several may be started late."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Setup:
    """What sails."""

    settings: SitlSettings
    world: World
    configs: list[RuntimeConfig]
    """Of the vessels' runtimes."""
    folders: list[Path]
    """Of the runtimes' files; none where nothing is kept."""
    progress: Progress | None
    """Told the simulated time and the present results."""
    tell: Tell
    """Told what the user has to do."""


class Sailed(NamedTuple):
    """What became of a voyage."""

    result: VoyageResult
    runs: Sequence[RunSummary]
    """What the vessels' runtimes told."""
    verdicts: tuple[tuple[str, Verdict], ...] = ()
    """By vessel; none without faults."""


def sail_in_step(setup: Setup) -> Sailed:
    """Sail as fast as it goes, all determined."""
    epoch_ns = setup.world.epoch_ns
    if setup.settings.processes:
        with ProcessCrew(setup.configs, epoch_ns=epoch_ns, propellers=_propellers(setup)) as crew:
            return Sailed(_sail(setup, crew), crew.summaries())
    local = LockstepCrew(setup.configs, epoch_ns=epoch_ns, propellers=_propellers(setup))
    try:
        result = _sail(setup, local)
    finally:
        local.close()
    return Sailed(result, local.summaries())


def sail_in_real_time(setup: Setup) -> Sailed:
    """Sail with a process a runtime."""
    fleet = _fleet(setup)
    tell = setup.tell if fleet is not None else None
    zenoh = simulator_zenoh(setup.settings)
    with RealtimeCrew(setup.configs, setup.folders, fleet, tell, zenoh=zenoh) as crew:
        result = _sail(setup, crew)
    return Sailed(result, [read_summary(folder) for folder in setup.folders])


def sail_as_vrx(setup: Setup) -> Sailed:
    """Be the simulator alone, as VRX is, until whoever drives the vessels has sailed them."""
    settings, world = setup.settings, setup.world
    with closing(ZenohBus(simulator_zenoh(settings), world.scenario.names[0])) as bus:
        vrx = Vrx(
            world,
            bus,
            scan_s=1.0 / load_sensor(settings.sensor).rate_hz,
            navigation=Navigation(world, settings.navigation),
            progress=setup.progress,
            tell=setup.tell,
        )
        result = vrx.run()
    return Sailed(result, [RunSummary(name=name) for name in world.scenario.names])


def sail_with_faults(setup: Setup, plan: FaultPlan) -> Sailed:
    """Sail in real time while things go wrong, and judge what the boats did about it."""
    names, folders = setup.world.scenario.names, setup.folders
    plans, seed = plans_by_vessel(plan, names), setup.settings.seed
    with punctual(), faulty_crew(setup.world, setup.configs, folders, plans, seed) as crew:
        result = _voyage(setup, crew).run()
        down = crew.down
    runs = [
        RunSummary(name=names[vessel]) if vessel in down else read_summary(folder)
        for vessel, folder in enumerate(folders)
    ]
    return Sailed(result, runs, tuple(verdicts(crew, plans, folders).items()))


def _fleet(setup: Setup) -> Fleet | None:
    """Give the autopilots; None where the crew's own do."""
    settings, world = setup.settings, setup.world
    if settings.simulates_autopilots:
        if not settings.ground and not settings.believed:
            return None
        ids = [index + 1 for index in range(world.scenario.vessels)]
        return simulated_fleet(ids, ground=settings.ground, paddles=_propellers(setup))
    ardupilot = replace(settings.ardupilot, ground=settings.ground)
    return ArduPilotFleet(world, setup.folders, ardupilot, setup.tell)


def _propellers(setup: Setup) -> list[PaddleSettings]:
    """Give what the outputs really mean, whatever the runtimes take the vessels for."""
    return [convert(paddles(vessel), PaddleSettings) for vessel in setup.world.vessels]


def _sail(setup: Setup, crew: Crew) -> VoyageResult:
    voyage = _voyage(setup, crew)
    return voyage.trial() if setup.settings.trial else voyage.run()


def _voyage(setup: Setup, crew: Crew) -> Voyage:
    settings, world = setup.settings, setup.world
    ours = settings.simulates_autopilots
    sensed = settings.odometry is OdometrySource.GPS_IMU
    return Voyage(
        world,
        crew,
        scan_s=1.0 / load_sensor(settings.sensor).rate_hz,
        dock_limit_s=DOCK_LIMIT_S if ours else ARDUPILOT_DOCK_LIMIT_S,
        progress=setup.progress,
        navigation=Navigation(world, settings.navigation) if sensed else None,
        marine=MarineSensors(world, settings.marine, DATUM) if settings.marine.any else None,
    )
