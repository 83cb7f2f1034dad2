"""What the assurance costs a scan, from nothing in reach to every manoeuvre tried in vain."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from twinscrew.hil_sim.bench.timing import Stopwatch, garbage_at_rest
from twinscrew.runtime.geometry import quaternion_from_euler
from twinscrew.runtime.messages.types import Float64, Odometry, Tracks
from twinscrew.runtime.safety.assurance import Assurance, AssuranceSettings

SCANS = 1000
SURGE_MPS = 3.0
AHEAD_N = np.array([1000.0, 1000.0])
PERIOD_NS = 100_000_000
BUOY_M = 0.8
SITUATIONS = {
    "nothing_in_reach": (),
    "clear_of_5": ((12.0, 9.0), (12.0, -9.0), (14.0, 12.0), (2.0, 8.0), (-6.0, 2.0)),
    "wait": ((9.0, 0.0), (12.0, -9.0), (14.0, 12.0), (2.0, 8.0), (-6.0, 2.0)),
    "intervene": ((6.0, 0.0), (12.0, -9.0), (14.0, 12.0), (2.0, 8.0), (-6.0, 2.0)),
    "hemmed_in_by_20": tuple(
        (4.5 * float(np.cos(angle)), 4.5 * float(np.sin(angle)))
        for angle in np.linspace(-np.pi, np.pi, 20, endpoint=False)
    ),
}
"""[m] [B] Where buoys lie around a vessel that goes full ahead."""


def run() -> dict[str, Any]:
    """Measure: {"assurance": {situation: {"p50_ms", "p99_ms", "max_ms"}}}."""
    watch = Stopwatch()
    with garbage_at_rest():
        for name, places_m in SITUATIONS.items():
            for assurance, odometry, tracks in _scans(np.array(places_m).reshape(-1, 2)):
                with watch.time(name):
                    assurance.step(odometry, tracks, AHEAD_N, AHEAD_N, decided=True)
    return {"assurance": watch.all_figures()}


def _scans(p_N: Float64) -> Iterator[tuple[Assurance, Odometry, Tracks]]:
    """Give the same scan again and again, each with a decision."""
    assurance = Assurance(AssuranceSettings(enabled=True))
    count = len(p_N)
    for scan in range(SCANS):
        stamp_ns = scan * PERIOD_NS
        odometry = Odometry(
            stamp_ns=stamp_ns,
            position_N=np.zeros(3),
            q_NB=quaternion_from_euler(0.0, 0.0, 0.0),
            velocity_B=np.array([SURGE_MPS, 0.0, 0.0]),
            rates_B=np.zeros(3),
        )
        tracks = Tracks(
            stamp_ns=stamp_ns,
            id=np.arange(count),
            p_N=p_N,
            v_N=np.zeros((count, 2)),
            radius=np.full(count, BUOY_M),
            covariance=np.zeros((count, 4, 4)),
            age_s=np.zeros(count),
        )
        yield assurance, odometry, tracks
