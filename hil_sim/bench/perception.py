"""How well perception finds what is there, and how fast its kernel is against numpy."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.random import Generator

from twinscrew.hil_sim.bench.deskew import run_deskew
from twinscrew.hil_sim.bench.numpy_segmentation import labels as numpy_segment
from twinscrew.hil_sim.bench.numpy_segmentation import project as numpy_project
from twinscrew.hil_sim.bench.perception_picture import draw_all
from twinscrew.hil_sim.bench.perception_scenes import Scene, harbour_scene, open_scene
from twinscrew.hil_sim.bench.perception_score import Score, Truth, score
from twinscrew.hil_sim.bench.scenes import basin
from twinscrew.hil_sim.bench.timing import Stopwatch, garbage_at_rest
from twinscrew.hil_sim.lidar import LidarSettings, Scan
from twinscrew.runtime.messages.types import Objects
from twinscrew.runtime.perception.segmentation import Perception
from twinscrew.runtime.perception.sensor import load_sensor

SCENES = 250
"""[-] Random scenes of each kind."""
BINS = (5.0, 8.0, 11.0, 14.0, 17.0, 20.0)
"""[m] Edges of the distances that are told apart."""
LIDAR = LidarSettings(water_echoes=0.3)
KINDS: dict[str, Callable[[Generator], Scene]] = {"open": open_scene, "harbour": harbour_scene}
SENSORS = ("vrx32", "vrx16")
DENSE = 30_000
"""[-] Echoes of the scan on which the kernel is compared with numpy."""
REPETITIONS = 60
LEVEL = np.array([1.0, 0.0, 0.0, 0.0])


def run(plot: Path | None = None, scenes: int = SCENES) -> dict[str, Any]:
    """Measure: {"perception": {sensor: {kind: figures}, "segmentation_vs_numpy", "deskew": ..}}.

    Parameters
    ----------
    plot
        A folder for pictures: open water, and a harbour.
    scenes
        [-] Scenes of each kind.
    """
    found: dict[str, Any] = {
        name: {kind: _figures(_scores(name, make, scenes)) for kind, make in KINDS.items()}
        for name in SENSORS
    }
    found["segmentation_vs_numpy"] = compare_with_numpy()
    found["deskew"] = run_deskew()
    if plot is not None:
        draw_all(plot)
    return {"perception": found}


def compare_with_numpy(repetitions: int = REPETITIONS) -> dict[str, float]:
    """Time projection and segmentation of a dense scan by the kernel, and by numpy and scipy."""
    perception = Perception(load_sensor("vrx32"))
    clouds = [basin(perception.sensor, DENSE, seed) for seed in range(repetitions)]
    watch = Stopwatch()
    with garbage_at_rest():
        for cloud in clouds:
            with watch.time("project"):
                perception.project(cloud, LEVEL)
            with watch.time("segment"):
                perception.segment()
        for cloud in clouds:
            with watch.time("numpy project"):
                image = numpy_project(cloud.points_S, perception.sensor, perception.settings)
            with watch.time("numpy segment"):
                numpy_segment(image, perception.sensor, perception.settings)
    ms = {name: watch.median_ms(name) for name in watch.all_figures()}
    kernel, plain = ms["project"] + ms["segment"], ms["numpy project"] + ms["numpy segment"]
    return {
        "points": DENSE,
        **{f"{name.replace(' ', '_')}_ms": round(value, 4) for name, value in ms.items()},
        "segment_ratio": round(ms["numpy segment"] / ms["segment"], 1),
        "ratio": round(plain / kernel, 1),
    }


def _scores(name: str, make: Callable[[Generator], Scene], scenes: int) -> list[Score]:
    perception, rng = Perception(load_sensor(name)), np.random.default_rng(1)
    scores = []
    for _ in range(scenes):
        scene = make(rng)
        scan, objects = _perceive(perception, scene, rng)
        scores.append(score(perception, scene, scan, objects))
    return scores


def _perceive(perception: Perception, scene: Scene, rng: Generator) -> tuple[Scan, Objects]:
    scan = scene.scan(perception.sensor, LIDAR, rng)
    return scan, perception.step(scan.cloud, scene.q_NB)


def _figures(scores: list[Score]) -> dict[str, Any]:
    truths = [truth for one in scores for truth in one.truths]
    circles = sum(one.circles for one in scores)
    by_distance = {
        f"{low:.0f}-{high:.0f} m": _shares([t for t in truths if low <= t.distance < high])
        for low, high in pairwise(BINS)
    }
    return {
        **_shares(truths),
        "circles": circles,
        "false": round(sum(one.false for one in scores) / max(circles, 1), 4),
        "on_own_hull": sum(one.on_hull for one in scores),
        "by_distance": by_distance,
    }


def _shares(truths: list[Truth]) -> dict[str, float]:
    """Give the shares found, split and merged, and the mean errors of those found."""
    count = max(len(truths), 1)
    found = [truth for truth in truths if truth.found]
    return {
        "objects": len(truths),
        "found": round(len(found) / count, 4),
        "split": round(sum(truth.split for truth in truths) / count, 4),
        "merged": round(sum(truth.merged for truth in truths) / count, 4),
        "position_error_m": round(float(np.mean([t.position_error for t in found] or [0.0])), 3),
        "radius_error_m": round(float(np.mean([t.radius_error for t in found] or [0.0])), 3),
    }
