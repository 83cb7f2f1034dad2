"""Tells news from repetition: a sensor that hangs may go on talking.

A driver that repeats its last measurement under new stamps looks alive to everything that counts
messages. But a vessel that moves never sees the same twice, and one that says it moves does not
stay where it is. Stamps and contents decide, no clock.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from twinscrew.runtime.geometry import wrap
from twinscrew.runtime.messages.types import Float32, Odometry, PointCloud

MOVED_M: Final = 0.05
"""[m] A vessel that has moved farther than this, or turned more than"""
TURNED: Final = math.radians(0.5)
"""[rad] this, must see something else: both are far beyond what rounding could hide."""
UNDER_WAY_MPS: Final = 0.2
"""[m/s] Odometry that says this, and is the same to the last bit, contradicts itself."""
_SAMPLES: Final = 32
"""[-] Points that are compared first: scans that differ, differ there."""


class Freshness:
    """Remembers the last scan and odometry."""

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Forget them."""
        self._scan: tuple[Float32, Odometry] | None = None
        self._odometry: Odometry | None = None

    def scan_repeats(self, cloud: PointCloud, odometry: Odometry) -> bool:
        """Tell whether a scan shows the same as an earlier one, though the vessel has moved.

        Parameters
        ----------
        odometry
            The vessel's state at the scan's stamp.
        """
        if self._scan is None or not _same(self._scan[0], cloud.points_S):
            self._scan = cloud.points_S, odometry
            return False
        return _moved(self._scan[1], odometry) and bool(np.isfinite(cloud.points_S).any())

    def odometry_repeats(self, odometry: Odometry) -> bool:
        """Tell whether a vessel that says it is under way is where it was, to the last bit."""
        last, self._odometry = self._odometry, odometry
        if last is None or odometry.stamp_ns <= last.stamp_ns:
            return False
        if math.hypot(*odometry.velocity_B[:2]) < UNDER_WAY_MPS:
            return False
        return (
            np.array_equal(last.position_N, odometry.position_N)
            and np.array_equal(last.q_NB, odometry.q_NB)
            and np.array_equal(last.velocity_B, odometry.velocity_B)
        )


def _same(one: Float32, other: Float32) -> bool:
    """Compare points bit for bit: a ray without an echo equals itself."""
    if one.shape != other.shape:
        return False
    bits, other_bits = one.view(np.uint32), other.view(np.uint32)
    step = max(1, len(one) // _SAMPLES)
    return np.array_equal(bits[::step], other_bits[::step]) and np.array_equal(bits, other_bits)


def _moved(before: Odometry, now: Odometry) -> bool:
    turned = abs(wrap(now.heading - before.heading))
    return math.dist(before.position_N[:2], now.position_N[:2]) > MOVED_M or turned > TURNED
