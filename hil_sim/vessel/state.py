"""What must be known of vessels to move them on. The first axis of every array is the vessel."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class VesselState:
    """Pose, velocity and thrust of V vessels. Its arrays are never written to."""

    position_N: Array
    """[m] [N] (V, 3) base_link: north, east, down from still water."""
    q_NB: Array
    """[-] (V, 4) Attitude of B in N as unit quaternions, w first."""
    velocity_B: Array
    """[m/s] [B] (V, 3) Velocity of base_link over ground: surge, sway, heave."""
    rates_B: Array
    """[rad/s] [B] (V, 3) Roll, pitch and yaw rate."""
    thrust: Array
    """[N] (V, 2) What the left and right propellers push now."""

    @property
    def count(self) -> int:
        """[-] V, the number of vessels."""
        return int(self.position_N.shape[0])

    @property
    def heading(self) -> Array:
        """[rad] [N] (V,) Headings, clockwise from north, in [-pi, pi]."""
        w, x, y, z = self.q_NB.T
        heading: Array = np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
        return heading


def level_quaternion(heading: Array, pitch: float = 0.0) -> Array:
    """Give attitudes, (V, 4), of headings, (V,) [rad], and one pitch [rad], without roll."""
    heading = np.asarray(heading, dtype=np.float64)
    c, s = np.cos(heading / 2), np.sin(heading / 2)
    cp, sp = np.cos(pitch / 2), np.sin(pitch / 2)
    return np.column_stack([cp * c, -sp * s, sp * c, cp * s])
