"""From a cloud's bytes to the thrust's bytes: each stage, and the whole step."""

from __future__ import annotations

from dataclasses import replace
from itertools import cycle, islice
from typing import Any

import numpy as np

from twinscrew.hil_sim.bench.budgets import load_budgets, require
from twinscrew.hil_sim.bench.numpy_segmentation import labels as numpy_labels
from twinscrew.hil_sim.bench.scenes import basin, open_water
from twinscrew.hil_sim.bench.timing import Stopwatch, garbage_at_rest
from twinscrew.runtime.bus.base import Received
from twinscrew.runtime.errors import TwinscrewError
from twinscrew.runtime.link.ardupilot.link import AutopilotSettings
from twinscrew.runtime.messages import cdr
from twinscrew.runtime.messages.types import Odometry, PointCloud
from twinscrew.runtime.perception.segmentation import Perception
from twinscrew.runtime.perception.sensor import load_sensor
from twinscrew.runtime.policy.observation import observe
from twinscrew.runtime.vessel.config import RuntimeConfig
from twinscrew.runtime.vessel.mission import MissionSettings
from twinscrew.runtime.vessel.vessel import make_vessel

SCANS = 2000
DIFFERENT = 40
"""[-] Different scans of a kind, in turn: the processor's caches see no scan twice in a row."""
PERIOD_NS = 100_000_000
GOAL_M = (40.0, 40.0)
STIR_M = 0.002
"""[m] Standard deviation of a moored vessel's place."""
CONFIG = RuntimeConfig(
    mission=MissionSettings(waypoints_m=(GOAL_M,)),
    autopilot=AutopilotSettings(check_parameters=False),
)


DENSITIES = ("sparse", "30k", "70k")
STAGES = (
    *("decode", "project", "segment", "objects", "track", "observe", "infer", "encode"),
    "step",
)
"""What is measured of each density; every one needs a budget."""

Scans = list[tuple[PointCloud, Odometry]]
"""Scans, with the odometry of each."""


def run() -> dict[str, Any]:
    """Measure: {"latency": {density: {stage: {"p50_ms", "p99_ms", "max_ms"}}}, "ratio": ..}.

    Raises
    ------
    ConfigError
        A stage has no budget.
    """
    require(load_budgets(), DENSITIES, STAGES)
    scans = clouds()
    latency = {name: _measure(some) for name, some in scans.items()}
    ratios = {name: segment_ratio(some) for name, some in scans.items()}
    return {"latency": latency, "ratio": {"segment_vs_numpy": ratios}}


def segment_ratio(scans: Scans) -> float:
    """[-] How many times faster the kernel labels range images than numpy and scipy label them.

    Both in turn on the same images, so that they share what else the machine does; medians.
    """
    perception, watch = Perception(load_sensor(CONFIG.sensor)), Stopwatch()
    with garbage_at_rest():
        for cloud, odometry in scans:
            perception.project(cloud, odometry.q_NB)
            image = perception.range_image()
            with watch.time("numpy"):
                numpy_labels(image, perception.sensor, perception.settings)
            with watch.time("kernel"):
                perception.segment()
    return round(watch.median_ms("numpy") / watch.median_ms("kernel"), 1)


def clouds() -> dict[str, Scans]:
    """Give the scans of each density, with the odometry of each."""
    sensor = load_sensor(CONFIG.sensor)
    full = len(sensor.elevations) * len(sensor.azimuths)
    at_rest = open_water(1)[0][1]
    sizes = {"30k": 30_000, "70k": full}
    dense = {
        name: [(basin(sensor, points, seed), at_rest) for seed in range(DIFFERENT)]
        for name, points in sizes.items()
    }
    there = open_water(DIFFERENT)
    back = there[::-1]  # there and back again: the vessel never jumps
    return {"sparse": there + back, **dense}


def _measure(scans: Scans, count: int = SCANS) -> dict[str, dict[str, float]]:
    watch = Stopwatch()
    with garbage_at_rest():
        _time_stages(scans, count, watch)
        _time_steps(scans, count, watch)
    return watch.all_figures()


def stage_names(scans: Scans) -> tuple[str, ...]:
    """Give what is measured, in order."""
    return tuple(_measure(scans, len(scans)))


def stamped(
    scans: Scans,
    count: int,
) -> list[tuple[int, bytes, bytes]]:
    """Give each scan's payload and its odometry's, in turn, with stamps that go on."""
    payloads = []
    rng = np.random.default_rng(0)
    for k, (cloud, odometry) in enumerate(islice(cycle(scans), count)):
        stamp_ns = k * PERIOD_NS
        payloads.append(
            (
                stamp_ns,
                cdr.encode_point_cloud(_at(cloud, stamp_ns)),
                cdr.encode_odometry(_at(_afloat(odometry, rng), stamp_ns)),
            )
        )
    return payloads


def _afloat(odometry: Odometry, rng: np.random.Generator) -> Odometry:
    """Move the vessel a little: odometry that repeats to the bit is refused as frozen."""
    position_N = odometry.position_N + STIR_M * rng.standard_normal(3)
    return replace(odometry, position_N=position_N)


def _at(message: Any, stamp_ns: int) -> Any:
    return replace(message, stamp_ns=stamp_ns)


def _time_stages(scans: Scans, count: int, watch: Stopwatch) -> None:
    perception = Perception(load_sensor(CONFIG.sensor), CONFIG.perception)
    vessel = make_vessel(CONFIG)
    pipeline = vessel.pipeline
    goal = pipeline.mission.goal
    assert goal is not None  # noqa: S101
    thrust = np.array([300.0, 400.0])
    for k, (scan, odometry) in enumerate(islice(cycle(scans), count)):
        stamp_ns = k * PERIOD_NS
        payload = cdr.encode_point_cloud(_at(scan, stamp_ns))
        with watch.time("decode"):
            cloud = cdr.decode_point_cloud(payload)
        with watch.time("project"):
            perception.project(cloud, odometry.q_NB)
        with watch.time("segment"):
            perception.segment()
        with watch.time("objects"):
            objects = perception.objects(stamp_ns)
        with watch.time("track"):
            tracks = pipeline.tracker.step(objects, _at(odometry, stamp_ns))
        with watch.time("observe"):
            seen = observe(odometry, goal, tracks, thrust, shown=pipeline.policy.shown)
        with watch.time("infer"):
            pipeline.policy.act(seen)
        with watch.time("encode"):
            vessel.link.command(thrust, stamp_ns / 1e9)


def _time_steps(scans: Scans, count: int, watch: Stopwatch) -> None:
    vessel = make_vessel(CONFIG)
    vessel.engaged = True
    for stamp_ns, cloud, odometry in stamped(scans, count):
        now_s = stamp_ns / 1e9
        vessel.handle(Received("odometry", odometry, 0), now_s)
        with watch.time("step"):
            out = vessel.handle(Received("points", cloud, 0), now_s)
        if out.decision is None:
            raise TwinscrewError(f"a scan was not decided on: {out.events}")
