"""Sail one episode in this process, in lock-step, and say what became of it."""

from __future__ import annotations

import time
from dataclasses import dataclass
from pathlib import Path

from twinscrew.hil_sim.drivers.lockstep import LockstepCrew
from twinscrew.hil_sim.drivers.voyage import Voyage, VoyageResult
from twinscrew.hil_sim.experiments.ablations import (
    calmed,
    dynamics,
    eased,
    label,
    supervision,
    unassured,
    vessel_of,
)
from twinscrew.hil_sim.experiments.chance import RandomPolicy
from twinscrew.hil_sim.experiments.ideal import DirectCrew, TruePerception, TrueTracker
from twinscrew.hil_sim.experiments.memory import give_back
from twinscrew.hil_sim.experiments.outcome import make_record
from twinscrew.hil_sim.experiments.plan import CHANCE, CLASSICAL, Task
from twinscrew.hil_sim.experiments.record import EpisodeRecord
from twinscrew.hil_sim.experiments.witness import WitnessAssurance, WitnessWorld
from twinscrew.hil_sim.scenario import Scenario
from twinscrew.hil_sim.sea.sea import SeaSettings
from twinscrew.hil_sim.vessel.parameters import load_vessel
from twinscrew.hil_sim.world import WorldSettings
from twinscrew.runtime.app.config import RuntimeConfig
from twinscrew.runtime.app.mission import MissionSettings
from twinscrew.runtime.app.recording_settings import RecordingSettings
from twinscrew.runtime.app.stepped import SteppedRuntime
from twinscrew.runtime.errors import TwinscrewError
from twinscrew.runtime.link.autopilot import AutopilotSettings
from twinscrew.runtime.perception.sensor import load_sensor
from twinscrew.runtime.safety.assurance import AssuranceSettings
from twinscrew.runtime.settings import load, shipped


@dataclass(frozen=True, slots=True, kw_only=True)
class Sailed:
    """An episode, with everything that a figure needs."""

    record: EpisodeRecord
    scenario: Scenario
    voyage: VoyageResult


def sail_task(task: Task) -> EpisodeRecord:
    """Sail an episode and give its results: what workers run."""
    record = sail_episode(task).record
    give_back()
    return record


def sail_episode(task: Task, folder: Path | None = None) -> Sailed:
    """Sail an episode; with a folder, every vessel's runtime is recorded under it.

    Raises
    ------
    TwinscrewError
        Something failed that is not the policy's: it is never counted as a result.
    """
    begin_s = time.perf_counter()
    try:
        scenario = eased(task.set.draw(task.seed), task.switches)
        world = _world(scenario, task)
        crew = _crew(world, task, folder)
        voyage = _sail(world, crew, task)
    except TwinscrewError as error:
        where = f"{task.method.name}, {task.set.name}, {label(task.switches)}, {task.episode}"
        raise TwinscrewError(f"episode ({where}): {error}") from error
    wall_s = time.perf_counter() - begin_s
    return Sailed(
        record=make_record(task, world, crew, voyage, wall_s), scenario=scenario, voyage=voyage
    )


def _world(scenario: Scenario, task: Task) -> WitnessWorld:
    sea = calmed(load(shipped("sea", scenario.sea), SeaSettings), task.switches)
    vessel = load_vessel(vessel_of(task.switches))
    settings = WorldSettings(dynamics=dynamics(task.switches))
    sensor = load_sensor(task.sensor)
    return WitnessWorld(scenario, sensor, vessel, sea, task.seed, settings=settings)


def _crew(world: WitnessWorld, task: Task, folder: Path | None) -> LockstepCrew:
    configs = [_config(task, world.scenario, i, folder) for i in range(world.scenario.vessels)]
    kind = DirectCrew if "ideal_thrust" in task.switches else LockstepCrew
    crew = kind(configs, epoch_ns=world.epoch_ns)
    for i, vessel in enumerate(crew.vessels):
        _fit_out(vessel, world, i, task)
    return crew


def _config(task: Task, scenario: Scenario, vessel: int, folder: Path | None) -> RuntimeConfig:
    name, by_chance = scenario.names[vessel], task.method.policy == CHANCE
    return RuntimeConfig(
        name=name,
        sensor=task.sensor,
        policy=CLASSICAL[0] if by_chance else task.method.policy,  # `_fit_out` replaces it
        assurance=unassured(AssuranceSettings(), task.switches),
        mission=MissionSettings(goal_radius_m=scenario.goal_radius),
        autopilot=AutopilotSettings(system_id=vessel + 1, arm=True, receiver_fitted=False),
        recording=RecordingSettings(
            folder=str(folder / name) if folder else "",
            about={"scenario": scenario.name, "seed": str(task.seed)},
        ),
    )


def _fit_out(runtime: SteppedRuntime, world: WitnessWorld, vessel: int, task: Task) -> None:
    """Replace what no configuration can: chance, a witness, and what switches idealise."""
    pipeline, config = runtime.controller.core.pipeline, runtime.config
    pipeline.assurance = WitnessAssurance(config.assurance, config.thrust)
    if task.method.policy == CHANCE:
        pipeline.policy = RandomPolicy((task.seed, vessel))
    reach_m = pipeline.perception.settings.max_range_m
    if {"ideal_perception", "ideal_tracking"} & set(task.switches):
        pipeline.perception = TruePerception(pipeline.perception.sensor, world, vessel)
    if "ideal_tracking" in task.switches:
        pipeline.tracker = TrueTracker(world, vessel, reach_m)


def _sail(world: WitnessWorld, crew: LockstepCrew, task: Task) -> VoyageResult:
    scan_s = 1.0 / load_sensor(task.sensor).rate_hz
    try:
        voyage = Voyage(world, crew, scan_s=scan_s, supervisor=supervision(task.switches))
        return voyage.run()
    finally:
        crew.close()
