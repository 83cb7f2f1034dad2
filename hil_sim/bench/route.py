"""What finding a route costs in a harbour of 500 x 500 m: on a new map, and again on the same.

Processor time: the search is in one thread, and waits for nothing.
"""

from __future__ import annotations

import time
from functools import partial
from typing import Any

import numpy as np
from numpy.random import Generator

from twinscrew.hil_sim.bench.harbour_scenes import passage, sights
from twinscrew.hil_sim.bench.timing import Stopwatch, garbage_at_rest
from twinscrew.runtime._native import FreeWater
from twinscrew.runtime.charts.learnt import LearntMap
from twinscrew.runtime.charts.route import Router, RouteSettings, settings_for
from twinscrew.runtime.charts.static_map import Area, Disc, Feature, StaticMap
from twinscrew.runtime.messages.types import Float64
from twinscrew.runtime.perception.sensor import load_sensor
from twinscrew.runtime.tracking.lidar import SensorView
from twinscrew.runtime.tracking.lidar_motion import OutlineView
from twinscrew.runtime.tracking.tracker import Tracker
from twinscrew.runtime.vessel_description import load_vessel

HARBOURS = 20
PASSAGES = 3
WAYS = 10
"""[-] In each."""
SIDE_M = 500.0
MOLE_M = 12.0
ENTRANCE_M = 30.0
PIERS, PILES = 30, 60
DRIFT_N = np.array([0.3, 0.2])
"""[m/s]"""
VESSELS = ("wam_v", "blueboat")


def run() -> dict[str, Any]:
    """Measure: {"route": {vessel: {"new_map", "same_map", ...}}, "learnt": {"scan": ...}}."""
    routes = {vessel: _measured(vessel) for vessel in VESSELS}
    return {"route": routes, "learnt": _learnt()}


def _learnt() -> dict[str, Any]:
    """Measure what learning walls adds to a scan, along quays and past ships."""
    watch, sensor = Stopwatch(time.thread_time_ns), load_sensor("vrx32")
    for seed in range(PASSAGES):
        rng = np.random.default_rng(seed)
        tracker, learnt = Tracker(view=SensorView.of(sensor)), LearntMap()
        for sight in sights(sensor, passage(rng), rng):
            tracker.step(sight.objects, sight.odometry)
            view = tracker.outline
            if view is not None:
                with watch.time("scan"):
                    learnt.step(sight.odometry, view.outline, partial(_water, view), tracker.stands)
                    _ = learnt.walls
    return watch.all_figures()


def _water(view: OutlineView) -> FreeWater:
    return view.water


def _measured(vessel: str) -> dict[str, Any]:
    settings = RouteSettings(**settings_for(load_vessel(vessel)))
    watch, found, edges, walls_m = Stopwatch(time.thread_time_ns), 0, 0, 0.0
    for seed in range(HARBOURS):
        rng = np.random.default_rng(seed)
        chart = harbour(rng)
        edges, steps = edges + len(chart.edges), np.diff(chart.edges, axis=1)[:, 0]
        walls_m += float(np.hypot(steps[:, 0], steps[:, 1]).sum())
        ends_N = _clear(chart, rng, settings.clearance_m)
        router = Router(settings, chart)
        with garbage_at_rest():
            for start_N, goal_N in ends_N:
                afresh = Router(settings, chart)
                with watch.time("new_map"):
                    afresh.route(start_N, goal_N, DRIFT_N)
                router.route(start_N, goal_N, DRIFT_N)
                with watch.time("same_map"):
                    found += not router.route(goal_N, start_N, DRIFT_N).reason
    return {
        **watch.all_figures(),
        "harbours": {
            "edges": edges // HARBOURS,
            "walls_m": round(walls_m / HARBOURS),
            "routes": HARBOURS * WAYS,
            "found": found,
        },
    }


def harbour(rng: Generator) -> StaticMap:
    """Draw a harbour: moles around it with an entrance, piers at any angle, and piles."""
    middle, outer = SIDE_M / 2, [(0.0, 0.0), (SIDE_M, 0.0), (SIDE_M, SIDE_M), (0.0, SIDE_M)]
    low, high, half = MOLE_M, SIDE_M - MOLE_M, ENTRANCE_M / 2
    mole = [
        (middle - half, 0.0),
        outer[0],
        outer[3],
        outer[2],
        outer[1],
        (middle + half, 0.0),
        (middle + half, low),
        (high, low),
        (high, high),
        (low, high),
        (low, low),
        (middle - half, low),
    ]
    features: list[Feature] = [Area(kind="land", outline=np.array(mole))]
    for _ in range(PIERS):
        size = np.array([rng.uniform(10.0, 120.0), rng.uniform(2.0, 12.0)])
        corners = size / 2 * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
        angle = rng.choice([0.0, np.pi / 2, rng.uniform(0.0, np.pi)])
        turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
        outline = corners @ turn + rng.uniform(0.0, SIDE_M, 2)
        features.append(Area(kind="land", outline=outline))
    for north, east in rng.uniform(0.0, SIDE_M, (PILES, 2)).tolist():
        features.append(Disc(kind="hazard", centre=(north, east), radius_m=0.5))
    return StaticMap.of(features)


def _clear(chart: StaticMap, rng: Generator, clear_m: float) -> Float64:
    """Give starts and goals [m] [N] (W, 2, 2) with room around them."""
    places = rng.uniform(2.0 * MOLE_M, SIDE_M - 2.0 * MOLE_M, (100 * WAYS, 2))
    clear = places[chart.distance_m(places) >= clear_m]
    return clear[: 2 * WAYS].reshape(WAYS, 2, 2)
