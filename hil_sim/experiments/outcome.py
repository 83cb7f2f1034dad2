"""From a voyage to an episode's record."""

from __future__ import annotations

import math
from dataclasses import asdict
from typing import Any

import numpy as np

from twinscrew.hil_sim.drivers.lockstep import LockstepCrew
from twinscrew.hil_sim.drivers.voyage import VoyageResult
from twinscrew.hil_sim.experiments.ablations import Switches, label
from twinscrew.hil_sim.experiments.encounters import Course, find_encounters
from twinscrew.hil_sim.experiments.plan import Task
from twinscrew.hil_sim.experiments.record import (
    Cause,
    EncounterRecord,
    EpisodeRecord,
    Timing,
    VesselRecord,
)
from twinscrew.hil_sim.experiments.witness import WitnessAssurance, WitnessWorld
from twinscrew.hil_sim.supervisor import Outcome
from twinscrew.runtime.app.replay import combined_sha256
from twinscrew.runtime.messages.types import Float64


def make_record(
    task: Task, world: WitnessWorld, crew: LockstepCrew, voyage: VoyageResult, wall_s: float
) -> EpisodeRecord:
    """Give what became of an episode that took `wall_s` seconds to sail."""
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
            interventions=_interventions(crew, i),
        )
        for i, result in enumerate(voyage.results)
    )


def _interventions(crew: LockstepCrew, vessel: int) -> int:
    assurance = crew.vessels[vessel].controller.core.pipeline.assurance
    return assurance.interventions if isinstance(assurance, WitnessAssurance) else 0


def _encounters(
    world: WitnessWorld, voyage: VoyageResult, switches: Switches
) -> tuple[EncounterRecord, ...]:
    found = find_encounters(course_of(world, voyage, switches))
    return tuple(EncounterRecord(**_rounded(asdict(encounter))) for encounter in found)


def course_of(world: WitnessWorld, voyage: VoyageResult, switches: Switches) -> Course:
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
        buoys=world.scenario.buoys,
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
