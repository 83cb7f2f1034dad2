"""Run one episode in this process, in lock-step, and record what became of it.

Switches of the plan replace perception, tracking or thrust by the truth, to measure what their
errors cost.
"""

from __future__ import annotations

import ctypes
import gc
import math
import time
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Final, Literal

import numpy as np
from numpy.typing import NDArray

from twinscrew.hil_sim.bodies import ABSENT
from twinscrew.hil_sim.drivers.lockstep import LockstepCrew
from twinscrew.hil_sim.drivers.voyage import Voyage, VoyageResult
from twinscrew.hil_sim.experiments.chance import RandomPolicy
from twinscrew.hil_sim.experiments.encounters import Course, find_encounters
from twinscrew.hil_sim.experiments.plan import (
    CHANCE,
    CLASSICAL,
    Switches,
    Task,
    calmed,
    chart_of,
    dynamics,
    eased,
    label,
    supervision,
    unassured,
    vessel_of,
)
from twinscrew.hil_sim.experiments.results import (
    Cause,
    EncounterRecord,
    EpisodeRecord,
    Timing,
    VesselRecord,
    tracks_line,
)
from twinscrew.hil_sim.rules import evidence
from twinscrew.hil_sim.scenario import Scenario
from twinscrew.hil_sim.sea.sea import SeaSettings
from twinscrew.hil_sim.supervisor import Outcome
from twinscrew.hil_sim.world import World, WorldSettings
from twinscrew.runtime.errors import ConfigError, TwinscrewError
from twinscrew.runtime.messages.types import (
    Float64,
    HealthEvent,
    Objects,
    Odometry,
    PointCloud,
    Tracks,
)
from twinscrew.runtime.perception.sensor import load_sensor
from twinscrew.runtime.safety.assurance import Assurance
from twinscrew.runtime.safety.events import ASSURANCE_INTERVENED
from twinscrew.runtime.settings import load, shipped
from twinscrew.runtime.tracking.tracker import Tracker
from twinscrew.runtime.vessel.config import RuntimeConfig, config_for
from twinscrew.runtime.vessel.hull_settings import expecting
from twinscrew.runtime.vessel.pipeline import Pipeline, make_pipeline
from twinscrew.runtime.vessel.replay import combined_sha256
from twinscrew.runtime.vessel_description import load_vessel

POINTS = 100
"""[-] Number of points an ideal object claims to have: more than any stage asks for."""


@dataclass(frozen=True, slots=True)
class Surroundings:
    """What truly is around a vessel, K bodies."""

    p_N: Float64
    """[m] [N] (K, 2) From the vessel's origin to the bodies' centres."""
    v_N: Float64
    """[m/s] [N] (K, 2) Over ground."""
    radius: Float64
    """[m] (K,) Of the circles with which contacts are judged."""
    row: NDArray[np.int64]
    """(K,) The bodies' numbers in the world."""


def surroundings(world: World, vessel: int, reach_m: float) -> Surroundings:
    """Give every vessel and buoy of which something is within reach.

    Raises
    ------
    ConfigError
        The scenario has quays: they are no circles.
    """
    ashore = len(world.scenario.quays) or world.scenario.land
    if ashore or world.scenario.traffic:
        what = "a quay" if ashore else "a ship"
        raise ConfigError(f"{what} is no circle: not with ideal perception", key="--ablate")
    bodies = world.bodies()
    if len(world.scenario.piles):
        raise ConfigError("piles have no circles there: not with ideal perception", key="--ablate")
    buoys = world.scenario.buoys[:, 2]
    radius = np.r_[[vessel.contact_radius_m for vessel in world.vessels], buoys]
    p_N = bodies.position_N[:, :2] - bodies.position_N[vessel, :2]
    seen = (bodies.shape != ABSENT) & (np.hypot(*p_N.T) <= reach_m + radius)
    seen[vessel] = False
    v_N = np.zeros_like(p_N) if bodies.velocity_N is None else bodies.velocity_N[:, :2]
    return Surroundings(p_N[seen], v_N[seen], radius[seen], np.flatnonzero(seen))


class TruePerception:
    """Finds every object where it is, of its true size; the cloud is not looked at."""

    def __init__(self, world: World, vessel: int, reach_m: float) -> None:
        """See around one vessel of a world."""
        self._world = world
        self._vessel = vessel
        self._reach_m = reach_m

    def step(
        self,
        cloud: PointCloud,
        q_NB: Float64,  # noqa: ARG002  (the truth needs no odometry)
        rates_B: Float64 | None = None,  # noqa: ARG002
        velocity_B: Float64 | None = None,  # noqa: ARG002
    ) -> Objects:
        """Give the objects around the vessel now; see `Perception.step`."""
        around = surroundings(self._world, self._vessel, self._reach_m)
        heading = self._world.state.heading[self._vessel]
        c, s = np.cos(heading), np.sin(heading)
        return Objects(
            stamp_ns=cloud.stamp_ns,
            p_L=around.p_N @ np.array([[c, -s], [s, c]]),
            radius=around.radius,
            points=np.full(len(around.radius), POINTS, dtype=np.int64),
        )


class TrueTracker(Tracker):
    """Knows every object's centre, size and velocity; what perception found is not looked at."""

    def __init__(self, world: World, vessel: int, reach_m: float) -> None:
        """Follow what is around one vessel of a world."""
        super().__init__()
        self._world = world
        self._vessel = vessel
        self._reach_m = reach_m

    def step(self, objects: Objects, odometry: Odometry) -> Tracks:
        """Give the tracks around the vessel now; see `Tracker.step`."""
        around = surroundings(self._world, self._vessel, self._reach_m)
        count = len(around.radius)
        return Tracks(
            stamp_ns=objects.stamp_ns,
            id=around.row,
            p_N=around.p_N + odometry.position_N[:2],
            v_N=around.v_N,
            radius=around.radius,
            covariance=np.zeros((count, 4, 4)),
            age_s=np.zeros(count),
        )


class DirectCrew(LockstepCrew):
    """Propellers that do what the runtimes command, not what is left of it in 1 us pulses."""

    def thrust_N(self) -> Float64:
        """Give each armed vessel's present command, (V, 2) [N]; see `Crew`."""
        return np.array([runtime.vessel.thrust for runtime in self.vessels])


# -- What an experiment must remember: how often the assurance stepped in.


class WitnessAssurance(Assurance):
    """An assurance, and how often it has taken the propellers from the policy."""

    interventions = 0
    """[-] Manoeuvres begun, or taking over from another."""

    def step(self, *args: Any, **options: Any) -> tuple[Float64, tuple[HealthEvent, ...]]:
        """See `Assurance.step`."""
        thrust, events = super().step(*args, **options)
        self.interventions += sum(event.name == ASSURANCE_INTERVENED.name for event in events)
        return thrust, events


# -- Keep a worker as small after its thousandth episode as after its first.


def give_back() -> None:
    """Free what an episode has left behind, and hand it back to the system.

    A crew lies in reference cycles: few objects, which the collector counts, that hold much native
    memory, which it does not see. And what many sessions have torn into pieces, the allocator keeps
    (glibc; others have no `malloc_trim`). Without both a worker grows by some MB an episode.
    """
    gc.collect()
    trim = getattr(ctypes.CDLL(None), "malloc_trim", None)
    if trim is not None:
        trim(0)


# -- From a voyage to an episode's record.


def make_record(
    task: Task, world: World, crew: LockstepCrew, voyage: VoyageResult, wall_s: float
) -> EpisodeRecord:
    """Give what became of an episode that took `wall_s` seconds to sail."""
    vessels = _vessels(crew, voyage)
    return EpisodeRecord(
        method=task.method.name,
        set=task.set.name,
        variant=label(task.switches),
        episode=task.episode,
        seed=task.seed,
        success=voyage.success,
        cause=cause(vessels),
        vessels=vessels,
        kind=world.scenario.kind,
        encounters=_encounters(world, voyage, task.switches),
        decisions_sha256=combined_sha256(runtime.publisher.sha256 for runtime in crew.vessels),
        timing=_timing(crew, voyage, wall_s),
    )


def cause(vessels: tuple[VesselRecord, ...]) -> Cause | None:
    """Give why an episode failed, by its first failure; None if it did not."""
    failed = [vessel for vessel in vessels if vessel.outcome != "goal"]
    if not failed:
        return None
    first = min(failed, key=lambda vessel: vessel.travel_time_s)
    if first.outcome == "timeout":
        return "time"
    if first.touched in ("buoy", "quay", "fence"):
        return first.touched
    return "vessel"  # an own one, or a scripted ship


ENDED: Final[dict[Outcome | None, Literal["goal", "collision", "fence", "timeout"]]] = {
    Outcome.GOAL: "goal",
    Outcome.COLLISION: "collision",
    Outcome.FENCE: "fence",
}
"""How voyages to goals end, otherwise by time."""


def _vessels(crew: LockstepCrew, voyage: VoyageResult) -> tuple[VesselRecord, ...]:
    energy = voyage.log.energy_ns()
    return tuple(
        VesselRecord(
            outcome=ENDED.get(result.outcome, "timeout"),
            touched=result.touched,
            travel_time_s=round(result.travel_time_s, 3),
            closest_approach_m=_finite(result.closest_approach_m),
            greatest_current_mps=round(result.greatest_current_mps, 3),
            energy_ns=round(float(energy[i]), 1),
            decisions=crew.vessels[i].publisher.decisions,
            interventions=_interventions(crew, i),
        )
        for i, result in enumerate(voyage.results)
    )


def _interventions(crew: LockstepCrew, vessel: int) -> int:
    assurance = crew.vessels[vessel].vessel.pipeline.assurance
    return assurance.interventions if isinstance(assurance, WitnessAssurance) else 0


def _encounters(
    world: World, voyage: VoyageResult, switches: Switches
) -> tuple[EncounterRecord, ...]:
    found = find_encounters(course_of(world, voyage, switches))
    return tuple(EncounterRecord(**_rounded(asdict(encounter))) for encounter in found)


def course_of(world: World, voyage: VoyageResult, switches: Switches) -> Course:
    """Bring a voyage's log into the form in which encounters are looked for."""
    rows: Float64 = voyage.log.rows
    leaves = {Outcome.COLLISION, Outcome.FENCE} | (
        {Outcome.GOAL} if "vanish" in switches else set()
    )
    ended_s = np.array([result.travel_time_s for result in voyage.results])
    gone = np.array([result.outcome in leaves for result in voyage.results])
    return Course(
        times=voyage.log.times,
        p_N=rows[:, :, :2],
        v_N=rows[:, :, 3:5],
        heading=rows[:, :, 2],
        ended_s=ended_s,
        gone_s=np.where(gone, ended_s, np.inf),
        buoys=world.scenario.circles,
        radius=max(vessel.contact_radius_m for vessel in world.vessels),
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


# -- Sail one episode in this process, in lock-step, and say what became of it.


@dataclass(frozen=True, slots=True, kw_only=True)
class Sailed:
    """An episode, with everything that a figure needs."""

    record: EpisodeRecord
    scenario: Scenario
    voyage: VoyageResult
    tracks: evidence.Tracks
    """Who was where."""


def sail_task(task: Task) -> tuple[EpisodeRecord, bytes]:
    """Sail an episode and give its results, and a line of its tracks: what workers run."""
    sailed = sail_episode(task)
    line = tracks_line(sailed.record.key, sailed.tracks)
    record = sailed.record
    del sailed
    give_back()
    return record, line


def sail_episode(task: Task, folder: Path | None = None) -> Sailed:
    """Sail an episode; with a folder, every vessel's runtime is recorded under it.

    Raises
    ------
    TwinscrewError
        Something failed that is not the policy's: it is never counted as a result.
    """
    begin_s = time.perf_counter()
    try:
        scenario = eased(task.set.draw(task.seed, task.episode), task.switches)
        world = _world(scenario, task)
        crew = _crew(world, task, folder)
        voyage = _sail(world, crew, task)
    except TwinscrewError as error:
        where = f"{task.method.name}, {task.set.name}, {label(task.switches)}, {task.episode}"
        raise TwinscrewError(f"episode ({where}): {error}") from error
    wall_s = time.perf_counter() - begin_s
    return Sailed(
        record=make_record(task, world, crew, voyage, wall_s),
        scenario=scenario,
        voyage=voyage,
        tracks=evidence.true_tracks(
            scenario, voyage.log, voyage.results, vanish="vanish" in task.switches
        ),
    )


def _world(scenario: Scenario, task: Task) -> World:
    sea = calmed(load(shipped("sea", scenario.sea), SeaSettings), task.switches)
    vessels = [vessel_of(task.switches, load_vessel(kind)) for kind in scenario.types]
    settings = WorldSettings(dynamics=dynamics(task.switches))
    sensor = load_sensor(task.sensor)
    return World(scenario, sensor, vessels, sea, task.seed, settings=settings)


def _crew(world: World, task: Task, folder: Path | None) -> LockstepCrew:
    configs = [_config(task, world.scenario, i, folder) for i in range(world.scenario.vessels)]
    pipelines = [_pipeline(config, world, i, task) for i, config in enumerate(configs)]
    kind = DirectCrew if "ideal_thrust" in task.switches else LockstepCrew
    return kind(configs, epoch_ns=world.epoch_ns, pipelines=pipelines)


def _config(task: Task, scenario: Scenario, vessel: int, folder: Path | None) -> RuntimeConfig:
    name, by_chance = scenario.names[vessel], task.method.policy == CHANCE
    return config_for(
        scenario.types[vessel],
        name=name,
        sensor=task.sensor,
        policy=CLASSICAL[0] if by_chance else task.method.policy,  # `_pipeline` replaces it
        assurance=unassured(task.switches),
        envelope={"enabled": False},  # methods are compared, not what the boat does outside it
        chart=chart_of(task.switches, scenario),
        mission={"goal_radius_m": scenario.goal_radius},
        perception=expecting(scenario.types),
        autopilot={"system_id": vessel + 1, "arm": True, "receiver_fitted": False},
        recording={
            "folder": str(folder / name) if folder else "",
            "about": {"scenario": scenario.name, "seed": str(task.seed)},
        },
    )


def _pipeline(config: RuntimeConfig, world: World, vessel: int, task: Task) -> Pipeline:
    """Make a pipeline with what no configuration can say: chance, a witness, ideal stages."""
    reach_m, perception, tracker = config.perception.max_range_m, None, None
    if {"ideal_perception", "ideal_tracking"} & set(task.switches):
        perception = TruePerception(world, vessel, reach_m)
    if "ideal_tracking" in task.switches:
        tracker = TrueTracker(world, vessel, reach_m)
    return make_pipeline(
        config,
        perception=perception,
        tracker=tracker,
        policy=RandomPolicy((task.seed, vessel)) if task.method.policy == CHANCE else None,
        assurance=WitnessAssurance(config.assurance, config.thrust),
    )


def _sail(world: World, crew: LockstepCrew, task: Task) -> VoyageResult:
    scan_s = 1.0 / load_sensor(task.sensor).rate_hz
    try:
        voyage = Voyage(world, crew, scan_s=scan_s, supervisor=supervision(task.switches))
        return voyage.run()
    finally:
        crew.close()
