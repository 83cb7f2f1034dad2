"""Odometry from the autopilot: LOCAL_POSITION_NED and ATTITUDE, joined.

Both carry the autopilot's time since boot, which `BootClock` brings to the caller's time.
"""

from __future__ import annotations

import math
from collections import deque

import numpy as np

from twinscrew.runtime.geometry.frames import (
    quaternion_from_euler,
    quaternion_product,
    rotation_from_quaternion,
)
from twinscrew.runtime.link.boot_clock import BootClock
from twinscrew.runtime.link.wire import Message
from twinscrew.runtime.messages.types import Odometry

PAIR_WITHIN_MS = 60
"""[ms] Position and attitude this near in time are joined, the attitude turned on by its rates to
the position's time: one period at 20 Hz."""
_KEPT = 64
"""[-] The most results kept for somebody to take: three seconds at 20 Hz."""
_ATTITUDE = ("roll", "pitch", "yaw", "rollspeed", "pitchspeed", "yawspeed")
_POSITION = ("x", "y", "z", "vx", "vy", "vz")


class OdometryFromAutopilot:
    """Joins the two messages; `newest` is the last result."""

    def __init__(self) -> None:
        self.newest: Odometry | None = None
        self._untaken: deque[Odometry] = deque(maxlen=_KEPT)
        self._attitude: Message | None = None
        self._position: Message | None = None
        self.clock = BootClock()

    def take(self) -> list[Odometry]:
        """Give every result since the last call, the oldest first."""
        taken = list(self._untaken)
        self._untaken.clear()
        return taken

    def attitude(self, message: Message, now_s: float) -> None:
        """Take ATTITUDE; one that is not finite is dropped."""
        if all(math.isfinite(getattr(message, name)) for name in _ATTITUDE):
            self._attitude = message
            self._join(message.time_boot_ms, now_s)

    def position(self, message: Message, now_s: float) -> None:
        """Take LOCAL_POSITION_NED; one that is not finite is dropped."""
        if all(math.isfinite(getattr(message, name)) for name in _POSITION):
            self._position = message
            self._join(message.time_boot_ms, now_s)

    def _join(self, boot_ms: int, now_s: float) -> None:
        self.clock.heard(boot_ms * 1e-3, now_s)
        attitude, position = self._attitude, self._position
        if attitude is None or position is None:
            return
        if abs(attitude.time_boot_ms - position.time_boot_ms) > PAIR_WITHIN_MS:
            return
        rates_B = np.array([attitude.rollspeed, attitude.pitchspeed, attitude.yawspeed])
        later_s = (position.time_boot_ms - attitude.time_boot_ms) * 1e-3
        q_NB = quaternion_product(
            quaternion_from_euler(attitude.roll, attitude.pitch, attitude.yaw),
            quaternion_from_euler(*(rates_B * later_s)),
        )
        velocity_N = np.array([position.vx, position.vy, position.vz])
        self.newest = Odometry(
            stamp_ns=round(self.clock.caller_s(position.time_boot_ms * 1e-3) * 1e9),
            position_N=np.array([position.x, position.y, position.z]),
            q_NB=q_NB,
            velocity_B=rotation_from_quaternion(q_NB).T @ velocity_N,
            rates_B=rates_B,
        )
        self._untaken.append(self.newest)
        self._attitude = self._position = None
