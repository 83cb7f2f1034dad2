"""Speed and course of what is around: the tracker's, and the paper's, against the truth.

Vessels sail the paper's scenarios in wind and waves under the shipped policy, which sees the
truth, so that both estimators are given the same scans.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from time import perf_counter, thread_time
from typing import Any

import numpy as np
from numpy.random import Generator

from twinscrew.hil_sim.bench.quotient import DifferenceQuotient
from twinscrew.hil_sim.bench.timing import garbage_at_rest
from twinscrew.hil_sim.bench.tracking_score import Truth, VelocityScore
from twinscrew.hil_sim.scenario import load_scenario
from twinscrew.hil_sim.sensors.marine import (
    AisTransponders,
    MarineSensors,
    MarineSettings,
    RadarUnit,
)
from twinscrew.hil_sim.traffic import TrafficEntry
from twinscrew.hil_sim.world import World, make_world
from twinscrew.runtime.datum import Datum
from twinscrew.runtime.geometry import rotation_from_quaternion
from twinscrew.runtime.messages.types import (
    NANOSECONDS_PER_SECOND,
    Float64,
    Goal,
    Objects,
    Odometry,
    PointCloud,
    Tracks,
)
from twinscrew.runtime.perception.segmentation import Perception
from twinscrew.runtime.perception.sensor import load_sensor
from twinscrew.runtime.policy.load import Policy, load_policy
from twinscrew.runtime.policy.observation import observe
from twinscrew.runtime.safety.alarms import Alarms
from twinscrew.runtime.senses.ais import SOURCE as AIS
from twinscrew.runtime.senses.ais import AisSettings
from twinscrew.runtime.senses.radar import SOURCE as RADAR
from twinscrew.runtime.senses.radar import RadarSettings
from twinscrew.runtime.senses.table import SensesSettings, make_senses
from twinscrew.runtime.tracking.detections import Look as DetectionLook
from twinscrew.runtime.tracking.detections import positions
from twinscrew.runtime.tracking.lidar import SensorView
from twinscrew.runtime.tracking.named import Report
from twinscrew.runtime.tracking.track import Named
from twinscrew.runtime.tracking.tracker import Tracker, TrackerSettings
from twinscrew.runtime.vessel.pipeline import Senses

EPISODES, VESSELS, BUOYS = 12, 5, 4
SENSOR = "vrx32"
SCAN_S = 0.1
EPISODE_S = 25.0
BORN_S = 1.0
"""[s] A track is judged from this long after its first report."""
OWN = 0
"""The vessel that looks."""
THRUST_N = (-500.0, 1000.0)
DATUM = Datum(latitude_deg=-33.7221, longitude_deg=150.6739)
"""Where the simulated ships lie on the earth."""
FAR_MATCH_M = 40.0
"""[m] A track of AIS or radar farther than this from every ship is of none."""
TARGETS = (5, 20, 100)
"""[-] Targets with which the time of a step is measured."""


@dataclass(frozen=True, slots=True)
class Look:
    """One scan of the observer, as objects, with the truth."""

    cloud: PointCloud
    objects: Objects
    odometry: Odometry
    truth: Truth
    overlap: bool
    """True while hulls or buoys touch: they are one object then, and nobody's fault."""


def run() -> dict[str, Any]:
    """Measure: {"tracking": {"kalman": {...}, "difference_quotient": {...}, ...}}."""
    kalman, quotient = VelocityScore(), VelocityScore()
    times: list[float] = []
    switches = seen = 0
    for seed in range(EPISODES):
        identities = _score_episode(seed, kalman, quotient, times)
        switches += sum(len(ids) - 1 for ids in identities.values())
        seen += len(identities)
    step_ms = 1e3 * np.array(times)
    return {
        "tracking": {
            "kalman": kalman.figures(),
            "difference_quotient": quotient.figures(),
            "identities_per_object": (seen + switches) / max(1, seen),
            "nees": {
                "lidar": {
                    "mean": kalman.figures()["nees_mean"],
                    "in_95_band": kalman.figures()["nees_in_95_band"],
                },
                **{name: nees_of(name) for name in ("ais", "radar")},
            },
            "targets": {str(count): steps_of(count) for count in TARGETS},
            "step_p50_ms": float(np.percentile(step_ms, 50)),
            "step_p99_ms": float(np.percentile(step_ms, 99)),
        }
    }


def _score_episode(
    seed: int, kalman: VelocityScore, quotient: VelocityScore, times: list[float]
) -> dict[int, set[int]]:
    """Score one episode; give the identities that each thing had while in sight."""
    tracker, two_scans = Tracker(view=SensorView.of(load_sensor(SENSOR))), DifferenceQuotient()
    born: dict[int, int] = {}
    identities: dict[int, set[int]] = {}
    for look in looks(seed):
        begin = perf_counter()
        tracks = tracker.step(look.objects, look.odometry)
        times.append(perf_counter() - begin)
        centroids_N, velocities_N = two_scans.step(look.objects, look.odometry)
        for identity in tracks.id.tolist():
            born.setdefault(identity, tracks.stamp_ns)
        if look.overlap:
            continue
        _score_tracks(tracks, look.truth, born, kalman, identities)
        for p_N, v_N in zip(centroids_N, velocities_N, strict=True):
            row = look.truth.nearest(p_N)
            if row is not None:
                quotient.add(look.truth, row, v_N)
    return identities


def _score_tracks(
    tracks: Tracks,
    truth: Truth,
    born: dict[int, int],
    score: VelocityScore,
    identities: dict[int, set[int]],
) -> None:
    for k, identity in enumerate(tracks.id.tolist()):
        row = truth.nearest(tracks.p_N[k])
        if row is None or tracks.age_s[k] > 0.0:
            continue
        identities.setdefault(row, set()).add(identity)
        if tracks.stamp_ns - born[identity] >= BORN_S * NANOSECONDS_PER_SECOND:
            score.add(truth, row, tracks.v_N[k])
            score.add_nees(truth, row, tracks.p_N[k], tracks.v_N[k], tracks.covariance[k])


def looks(seed: int, sensor: str = SENSOR, perception: Perception | None = None) -> Iterator[Look]:
    """Give what vessel `OWN` sees while all vessels sail one episode.

    Odometry and truth are those of a scan's stamp: a sensor that turns began the scan then.
    `perception` is what sees it, if the caller wants to look into it.
    """
    scenario = load_scenario("random", VESSELS, BUOYS, seed)
    world = make_world(scenario, sensor=sensor, seed=seed)
    perception = perception or Perception(load_sensor(sensor))
    policies = [load_policy("ac_iqn") for _ in range(VESSELS)]
    thrust = np.zeros((VESSELS, 2))
    past: dict[int, tuple[Odometry, Truth, bool]] = {}
    scans_a_decision = round(policies[0].period_s / SCAN_S)
    for scan in range(round(EPISODE_S / SCAN_S)):
        _moor_arrivals(world)
        if world.moored[OWN]:
            return
        touching = bool(world.gaps.min() < 0.0)
        past[world.stamp_ns] = world.odometry(OWN), truth_around(world, OWN), touching
        cloud = world.cloud(OWN)
        if cloud.stamp_ns in past:
            odometry, truth, overlap = past[cloud.stamp_ns]
            objects = perception.step(cloud, odometry.q_NB, odometry.rates_B, odometry.velocity_B)
            yield Look(cloud, objects, odometry, truth, overlap)
        if scan % scans_a_decision == 0:
            thrust = np.array([_decide(world, v, policies[v], thrust[v]) for v in range(VESSELS)])
        world.advance(SCAN_S, thrust)


def nees_of(source: str, seeds: int = 3) -> dict[str, float]:
    """Give the NEES (4 states) of ships that AIS or the radar alone shows: mean, share in its band.

    The simulator's transponders and radar, read as on the boat; ships at 2 to 5 m/s, some of which
    alter course, from 20 s after the start.
    """
    score = VelocityScore()
    for seed in range(seeds):
        _score_source(source, seed, score)
    figures = score.figures()
    return {
        "mean": figures["nees_mean"],
        "in_95_band": figures["nees_in_95_band"],
        "reports": float(len(score.nees)),
    }


def _score_source(source: str, seed: int, score: VelocityScore, seconds: float = 90.0) -> None:
    rng = np.random.default_rng(seed)
    ships = tuple(
        TrafficEntry(
            start_m=tuple(rng.uniform(-300.0, 300.0, 2) + np.sign(rng.normal(size=2)) * 100.0),
            course_deg=float(rng.uniform(0.0, 360.0)),
            speed_mps=float(rng.uniform(2.0, 5.0)),
            length_m=float(length),
            beam_m=0.3 * float(length),
            behaviour="manoeuvre" if length < 12.0 else "hold",
            after_s=40.0,
            turn_deg=30.0,
        )
        for length in rng.uniform(8.0, 20.0, 5)
    )
    scenario = replace(load_scenario("crossing"), sea="paper", traffic=ships)
    world = make_world(scenario, seed=seed)
    for vessel in range(scenario.vessels):
        world.moor(vessel, scenario.starts[vessel, :2])
    world.release(1)  # traffic gets under way
    world.moor(1, scenario.starts[1, :2])
    if source == "ais":
        fitted, receivers = SensesSettings(ais=AisSettings(datum=DATUM)), AisTransponders()
        sensors = MarineSensors(world, MarineSettings(ais=receivers), DATUM)
    else:
        fitted = SensesSettings(radar=RadarSettings())
        sensors = MarineSensors(world, MarineSettings(radar=RadarUnit()), DATUM)
    tracker = Tracker(TrackerSettings(sources={source: {"ais": AIS, "radar": RADAR}[source]}))
    senses = Senses(make_senses(fitted), tracker, Alarms())

    def own_at(_stamp_ns: int) -> Odometry:
        return world.odometry(OWN)

    for _ in range(round(seconds / 0.5)):
        world.advance(0.5, np.zeros((scenario.vessels, 2)))
        for sensed in sensors.take():
            if sensed.vessel == OWN:
                senses.take(sensed.topic, sensed.payload, world.stamp_ns, own_at)
        senses.listen(world.stamp_ns)
        if world.time_s < 20.0 or world.traffic is None:
            continue
        own_N = world.odometry(OWN).position_N[:2]
        shown = tracker.seen_by_others(world.stamp_ns, own_N)
        ships_N = world.traffic.position_N, world.traffic.velocity_N
        truth = Truth(*ships_N, np.ones(len(ships)), FAR_MATCH_M)
        for k in range(len(shown.id)):
            row = truth.nearest(shown.p_N[k])
            if row is not None:
                score.add_nees(truth, row, shown.p_N[k], shown.v_N[k], shown.covariance[k])


def steps_of(count: int, scans: int = 300) -> dict[str, float]:
    """Give the processor time of a step [ms] with so many targets: LiDAR alone, and all senses.

    The targets lie 3 m apart in rows, a third of them under way. With all senses each reports
    itself by AIS every 10 s, and a radar sees them every 2.5 s; the time of their looks counts for
    the step before which they are taken in.
    """
    rng, side = np.random.default_rng(count), math.ceil(math.sqrt(count))
    first_N = 3.0 * np.stack(np.divmod(np.arange(count), side), axis=1) + 4.0
    v_N = np.where((np.arange(count) % 3 == 0)[:, None], rng.normal(0.0, 0.5, (count, 2)), 0.0)
    figures: dict[str, float] = {}
    for name, sources in (("lidar", {}), ("all", {"ais": AIS, "radar": RADAR})):
        tracker, times = Tracker(TrackerSettings(sources=sources)), []
        with garbage_at_rest():
            for k in range(scans):
                stamp_ns, p_N = round(k * SCAN_S * 1e9), first_N + v_N * k * SCAN_S
                seen_N = p_N + rng.normal(0.0, 0.02, p_N.shape)
                here = _at_the_origin(stamp_ns)
                objects = Objects(
                    stamp_ns=stamp_ns,
                    p_L=seen_N,
                    radius=np.full(count, 1.0),
                    points=np.full(count, 100),
                )
                looks = _looks_of(k, stamp_ns, p_N, v_N, rng) if sources else []
                begin_s = thread_time()
                for look in looks:
                    tracker.take(look)
                tracker.step(objects, here)
                times.append(thread_time() - begin_s)
        p50, p99 = np.percentile(1e3 * np.array(times[20:]), [50, 99])
        figures |= {f"{name}_p50_ms": round(float(p50), 3), f"{name}_p99_ms": round(float(p99), 3)}
    return figures


def _at_the_origin(stamp_ns: int) -> Odometry:
    return Odometry(
        stamp_ns=stamp_ns,
        position_N=np.zeros(3),
        q_NB=np.array([1.0, 0.0, 0.0, 0.0]),
        velocity_B=np.zeros(3),
        rates_B=np.zeros(3),
    )


def _looks_of(
    k: int, stamp_ns: int, p_N: Float64, v_N: Float64, rng: Generator
) -> list[DetectionLook]:
    """Give what AIS and radar say before a scan: a tenth of a second of each."""
    looks = []
    for target in range(k % 100, len(p_N), 100):
        named = Named(f"{target:09d}", "", 1.0, 0.5, 1.1, math.nan, stamp_ns + 60 * 10**9)
        look = _positions(p_N[target : target + 1], stamp_ns, "ais", 6.0, rng)
        looks.append(replace(look, extras=[Report(named, v_N[target])]))
    if k % 25 == 0:
        looks.append(_positions(p_N, stamp_ns, "radar", 2.0, rng))
    return looks


def _positions(
    p_N: Float64, stamp_ns: int, source: str, sigma_m: float, rng: Generator
) -> DetectionLook:
    seen_N = p_N + rng.normal(0.0, 0.5 * sigma_m, p_N.shape)
    return positions(
        seen_N, np.zeros(2), sigma_m=sigma_m, sigma_rad=0.015, stamp_ns=stamp_ns, source=source
    )


def truth_around(world: World, own: int) -> Truth:
    """Give the truth about all vessels and buoys but `own`."""
    state = world.state
    velocity_N = np.array(
        [rotation_from_quaternion(q) @ v for q, v in zip(state.q_NB, state.velocity_B, strict=True)]
    )
    buoys = world.scenario.buoys[:, :2]
    others = np.arange(world.scenario.vessels) != own
    return Truth(
        np.concatenate([state.position_N[others, :2], buoys]),
        np.concatenate([velocity_N[others, :2], np.zeros_like(buoys)]),
        np.concatenate([np.ones(others.sum()), np.zeros(len(buoys))]),
    )


def _moor_arrivals(world: World) -> None:
    goals = world.scenario.goals
    apart = np.hypot(*(world.state.position_N[:, :2] - goals).T)
    for vessel in np.flatnonzero(~world.moored & (apart <= world.scenario.goal_radius)):
        world.moor(int(vessel), goals[vessel])


def _decide(world: World, vessel: int, policy: Policy, thrust: Float64) -> Float64:
    """Give a vessel's next thrust [N] by a policy that sees the truth."""
    truth, odometry = truth_around(world, vessel), world.odometry(vessel)
    count = len(truth.p_N)
    tracks = Tracks(
        stamp_ns=odometry.stamp_ns,
        id=np.arange(count),
        p_N=truth.p_N,
        v_N=truth.v_N,
        radius=np.where(truth.is_vessel > 0, world.vessels[0].contact_radius_m, 0.75),
        covariance=np.zeros((count, 4, 4)),
        age_s=np.zeros(count),
    )
    goal = Goal(stamp_ns=odometry.stamp_ns, position_N=world.scenario.goals[vessel])
    rate = policy.act(observe(odometry, goal, tracks, thrust, shown=policy.shown))
    return np.clip(thrust + rate * policy.period_s, *THRUST_N)
