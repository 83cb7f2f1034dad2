"""Quays and ships: what the tracker makes of what is too long for a circle.

Both columns are given the same scans; "without_outline" is the tracker that is not told the outline
(`messages.types.Outline`), and can only follow where pieces are.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from twinscrew.hil_sim.bench.harbour_scenes import OWN, Body, Sight, passage, sights
from twinscrew.runtime.messages.types import Float64
from twinscrew.runtime.perception.sensor import load_sensor
from twinscrew.runtime.tracking.lidar import SensorView, Viewpoint
from twinscrew.runtime.tracking.tracker import Tracker

PASSAGES = 12
SENSOR = "vrx32"
FAST_MPS = 1.0
"""[m/s] What stands and is reported faster than this stops a boat."""
SLOW_MPS = 0.3
"""[m/s] What moves and is reported slower than this seems to stand (paper: no vessel)."""
UNDER_WAY_MPS = 0.5
"""[m/s] A ship that is faster than this is under way."""


@dataclass(slots=True)
class HarbourScore:
    """Collects what is reported of quays and of ships."""

    quays: list[float] = field(default_factory=list)
    """[m/s] Speeds."""
    ships: list[tuple[float, float]] = field(default_factory=list)
    """[m/s] Speeds, and errors of velocities, of ships under way."""

    def add(self, truth: Body, v_N: Float64) -> None:
        """Add one report."""
        if not truth.tilts:
            self.quays.append(float(np.hypot(*v_N)))
        elif truth.speed >= UNDER_WAY_MPS:
            self.ships.append((float(np.hypot(*v_N)), float(np.hypot(*(v_N - truth.v_N)))))

    def figures(self) -> dict[str, float]:
        """Give the figures."""
        quays, (speeds, errors) = np.array(self.quays), np.array(self.ships).T
        return {
            "quay_reports": len(quays),
            "quays_fast_share": float(np.mean(quays > FAST_MPS)),
            "quay_speed_rms_mps": float(np.sqrt(np.mean(quays**2))),
            "ship_reports": len(speeds),
            "ships_slow_share": float(np.mean(speeds < SLOW_MPS)),
            "ship_velocity_median_mps": float(np.median(errors)),
        }


def run() -> dict[str, Any]:
    """Measure: {"harbour": {"tracker": {...}, "without_outline": {...}}}."""
    with_outline, without = HarbourScore(), HarbourScore()
    sensor = load_sensor(SENSOR)
    for seed in range(PASSAGES):
        rng = np.random.default_rng(seed)
        bodies = passage(rng)
        told, untold = Tracker(view=SensorView.of(sensor)), Tracker(view=SensorView.of(sensor))
        for sight in sights(sensor, bodies, rng):
            _score(told, sight, bodies, with_outline)
            plain = replace(sight, objects=replace(sight.objects, outline=None))
            _score(untold, plain, bodies, without)
    return {"harbour": {"tracker": with_outline.figures(), "without_outline": without.figures()}}


def _score(tracker: Tracker, sight: Sight, bodies: list[Body], score: HarbourScore) -> None:
    """Give a scan to a tracker, and what it reports of what is seen in it to the score."""
    tracks = tracker.step(sight.objects, sight.odometry)
    objects_N, seen = Viewpoint.of(sight.odometry).in_N(sight.objects.p_L), tracks.age_s == 0.0
    for p_N, v_N in zip(tracks.p_N[seen], tracks.v_N[seen], strict=True):
        body = sight.body[int(np.hypot(*(objects_N - p_N).T).argmin())]
        if body > OWN:
            score.add(bodies[body], v_N)
