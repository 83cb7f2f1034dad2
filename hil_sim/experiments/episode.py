"""Sail one episode in this process, in lock-step, and say what became of it."""

from __future__ import annotations

import math
import time
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from twinscrew.hil_sim.drivers.lockstep import LockstepCrew
from twinscrew.hil_sim.drivers.voyage import Voyage, VoyageResult
from twinscrew.hil_sim.experiments.ablations import (
    Switches,
    calmed,
    eased,
    label,
    supervision,
    vessel_of,
)
from twinscrew.hil_sim.experiments.encounters import Course, find_encounters
from twinscrew.hil_sim.experiments.ideal import TruePerception, TrueTracker
from twinscrew.hil_sim.experiments.plan import Task
from twinscrew.hil_sim.experiments.record import (
    Cause,
    EncounterRecord,
    EpisodeRecord,
    Timing,
    VesselRecord,
)
from twinscrew.hil_sim.experiments.witness import WitnessWorld
from twinscrew.hil_sim.scenario import Scenario
from twinscrew.hil_sim.sea.sea import SeaSettings
from twinscrew.hil_sim.supervisor import Outcome
from twinscrew.hil_sim.vessel.parameters import load_vessel
from twinscrew.runtime.app.config import RecordingSettings, RuntimeConfig
from twinscrew.runtime.app.mission import MissionSettings
from twinscrew.runtime.app.replay import combined_sha256
from twinscrew.runtime.errors import TwinscrewError
from twinscrew.runtime.link.autopilot import AutopilotSettings
from twinscrew.runtime.messages.types import Float64
from twinscrew.runtime.perception.sensor import load_sensor
from twinscrew.runtime.settings import load, shipped


@dataclass(frozen=True, slots=True, kw_only=True)
class Sailed:
    """An episode, with everything that a figure needs."""

    record: EpisodeRecord
    scenario: Scenario
    voyage: VoyageResult


def sail_task(task: Task) -> EpisodeRecord:
    """Sail an episode and give its results: what workers run."""
    return sail_episode(task).record


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
        record=_record(task, world, crew, voyage, wall_s), scenario=scenario, voyage=voyage
    )


def _world(scenario: Scenario, task: Task) -> WitnessWorld:
    sea = calmed(load(shipped("sea", scenario.sea), SeaSettings), task.switches)
    vessel = load_vessel(vessel_of(task.switches))
    return WitnessWorld(scenario, load_sensor(task.sensor), vessel, sea, task.seed)


def _crew(world: WitnessWorld, task: Task, folder: Path | None) -> LockstepCrew:
    names = world.scenario.names
    configs = [
        RuntimeConfig(
            name=name,
            sensor=task.sensor,
            policy=task.method.policy,
            mission=MissionSettings(goal_radius_m=world.scenario.goal_radius),
            autopilot=AutopilotSettings(system_id=i + 1, arm=True, receiver_fitted=False),
            recording=RecordingSettings(folder=str(folder / name) if folder else ""),
        )
        for i, name in enumerate(names)
    ]
    crew = LockstepCrew(configs, epoch_ns=world.epoch_ns)
    _idealise(crew, world, task.switches)
    return crew


def _idealise(crew: LockstepCrew, world: WitnessWorld, switches: Switches) -> None:
    for i, vessel in enumerate(crew.vessels):
        pipeline = vessel.controller.core.pipeline
        reach_m = pipeline.perception.settings.max_range_m
        if "ideal_perception" in switches or "ideal_tracking" in switches:
            pipeline.perception = TruePerception(pipeline.perception.sensor, world, i)
        if "ideal_tracking" in switches:
            pipeline.tracker = TrueTracker(world, i, reach_m)


def _sail(world: WitnessWorld, crew: LockstepCrew, task: Task) -> VoyageResult:
    scan_s = 1.0 / load_sensor(task.sensor).rate_hz
    try:
        voyage = Voyage(world, crew, scan_s=scan_s, supervisor=supervision(task.switches))
        return voyage.run()
    finally:
        crew.close()


def _record(
    task: Task, world: WitnessWorld, crew: LockstepCrew, voyage: VoyageResult, wall_s: float
) -> EpisodeRecord:
    vessels = _vessels(world, crew, voyage)
    return EpisodeRecord(
        method=task.method.name,
        set=task.set.name,
        variant=label(task.switches),
        episode=task.episode,
        seed=task.seed,
        success=voyage.success,
        cause=cause(vessels),
        vessels=vessels,
        encounters=_encounters(world, voyage, task.switches),
        decisions_sha256=combined_sha256(vessel.outlet.sha256 for vessel in crew.vessels),
        timing=_timing(crew, voyage, wall_s),
    )


def cause(vessels: tuple[VesselRecord, ...]) -> Cause | None:
    """Give why an episode failed, by its first failure; None if it did not. A quay is a buoy."""
    failed = [vessel for vessel in vessels if vessel.outcome != "goal"]
    if not failed:
        return None
    first = min(failed, key=lambda vessel: vessel.travel_time_s)
    if first.outcome == "timeout":
        return "time"
    return "vessel" if first.touched == "vessel" else "buoy"


def _vessels(
    world: WitnessWorld, crew: LockstepCrew, voyage: VoyageResult
) -> tuple[VesselRecord, ...]:
    energy = voyage.log.energy_ns()
    return tuple(
        VesselRecord(
            outcome=result.outcome.value if result.outcome else "timeout",
            touched=world.touched.get(i),
            travel_time_s=round(result.travel_time_s, 3),
            closest_approach_m=_finite(result.closest_approach_m),
            energy_ns=round(float(energy[i]), 1),
            decisions=crew.vessels[i].outlet.decisions,
        )
        for i, result in enumerate(voyage.results)
    )


def _encounters(
    world: WitnessWorld, voyage: VoyageResult, switches: Switches
) -> tuple[EncounterRecord, ...]:
    found = find_encounters(course_of(world.scenario, world, voyage, switches))
    return tuple(EncounterRecord(**_rounded(asdict(encounter))) for encounter in found)


def course_of(
    scenario: Scenario, world: WitnessWorld, voyage: VoyageResult, switches: Switches
) -> Course:
    """Bring a voyage's log into the form in which encounters are looked for."""
    rows: Float64 = voyage.log.rows
    leaves = {Outcome.COLLISION, Outcome.GOAL} if "vanish" in switches else {Outcome.COLLISION}
    ended_s = np.array([result.travel_time_s for result in voyage.results])
    gone = np.array([result.outcome in leaves for result in voyage.results])
    return Course(
        times=voyage.log.times,
        p_N=rows[:, :, :2],
        v_N=rows[:, :, 3:5],
        heading=rows[:, :, 2],
        ended_s=ended_s,
        gone_s=np.where(gone, ended_s, np.inf),
        buoys=scenario.buoys,
        radius=world.parameters.collision_radius_m,
    )


def _timing(crew: LockstepCrew, voyage: VoyageResult, wall_s: float) -> Timing:
    latencies = [vessel.latencies.summary() for vessel in crew.vessels]
    return Timing(
        decision_p50_ms=round(max(latency.p50 for latency in latencies), 4),
        decision_p99_ms=round(max(latency.p99 for latency in latencies), 4),
        decision_max_ms=round(max(latency.max for latency in latencies), 4),
        wall_s=round(wall_s, 3),
        simulated_s=round(voyage.duration_s, 3),
    )


def _rounded(values: dict[str, Any]) -> dict[str, Any]:
    return {k: round(v, 3) if isinstance(v, float) else v for k, v in values.items()}


def _finite(value: float) -> float | None:
    return round(value, 3) if math.isfinite(value) else None
