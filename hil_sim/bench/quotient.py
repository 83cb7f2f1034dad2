"""Velocities as the paper estimates them: by difference quotients of two scans' centroids."""

from __future__ import annotations

import numpy as np

from twinscrew.runtime.geometry import rotation_2d
from twinscrew.runtime.messages.types import (
    NANOSECONDS_PER_SECOND,
    Float64,
    Objects,
    Odometry,
)

GATE_MPS = 6.0
"""[m/s] Nothing moves faster (the authors' code)."""
POINTS_CHANGE = 0.3
"""[-] A cluster whose number of points changed by more is another's (the authors' code)."""


class DifferenceQuotient:
    """Remembers one scan; paper, sec. III."""

    def __init__(self) -> None:
        self._stamp_ns = 0
        self._p_N = np.empty((0, 2))
        self._points = np.empty(0, dtype=np.int64)

    def step(self, objects: Objects, odometry: Odometry) -> tuple[Float64, Float64]:
        """Give centroids and velocities, both (K, 2) [m, m/s], frame N; NaN where none is known."""
        p_N = objects.p_L @ rotation_2d(odometry.heading).T + odometry.position_N[:2]
        dt = (objects.stamp_ns - self._stamp_ns) / NANOSECONDS_PER_SECOND
        v_N = np.full_like(p_N, np.nan)
        if len(self._p_N):
            for row, (p, points) in enumerate(zip(p_N, objects.points, strict=True)):
                step = p - self._p_N
                nearest = int(np.hypot(step[:, 0], step[:, 1]).argmin())
                change = abs(points - self._points[nearest]) / self._points[nearest]
                if np.hypot(*step[nearest]) <= GATE_MPS * dt and change <= POINTS_CHANGE:
                    v_N[row] = step[nearest] / dt
        self._stamp_ns, self._p_N, self._points = objects.stamp_ns, p_N, objects.points
        return p_N, v_N
