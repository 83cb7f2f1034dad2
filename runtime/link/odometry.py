"""Odometry from the autopilot: LOCAL_POSITION_NED and ATTITUDE, joined, or ODOMETRY.

They carry the autopilot's time since boot, which `BootClock` brings to the caller's time.
"""

from __future__ import annotations

import math
from collections import deque

import numpy as np

from twinscrew.runtime.geometry import (
    quaternion_from_euler,
    quaternion_product,
    rotation_from_quaternion,
)
from twinscrew.runtime.link.boot_clock import BootClock
from twinscrew.runtime.link.datum import Datum, from_datum_N
from twinscrew.runtime.link.whole_odometry import (
    UNIX_SINCE_S,
    is_usable,
    time_s,
    whole_odometry,
)
from twinscrew.runtime.link.wire import Message
from twinscrew.runtime.messages.types import Float64, Odometry

PAIR_WITHIN_MS = 60
"""[ms] Position and attitude this near in time are joined, the attitude turned on by its rates to
the position's time: one period at 20 Hz."""
SAME_MOMENT_MS = 10
"""[ms] A position whose attitude has come this near in time waits for no other."""
REBOOT_MS = 1000
"""[ms] A time since boot this far back means that the autopilot started again."""
_KEPT = 64
"""[-] The most results kept for somebody to take: three seconds at 20 Hz."""
_ATTITUDE = ("roll", "pitch", "yaw", "rollspeed", "pitchspeed", "yawspeed")
_POSITION = ("x", "y", "z", "vx", "vy", "vz")


class OdometryFromAutopilot:
    """Makes odometry of the autopilot's messages; `newest` is the last result.

    Parameters
    ----------
    datum
        The origin that positions are to be counted from; None for the autopilot's own. With one,
        nothing is given before the autopilot has told where its own lies.
    """

    def __init__(self, datum: Datum | None = None) -> None:
        self.newest: Odometry | None = None
        self._untaken: deque[Odometry] = deque(maxlen=_KEPT)
        self._attitude: Message | None = None
        self._position: Message | None = None
        self._datum = datum
        self._origin_N: Float64 | None = None if datum else np.zeros(3)
        self._boot_ms = 0
        self.clock = BootClock()
        self._unix = BootClock()
        """For a sender that counts from 1970: TIMESYNC does not tell of that clock."""

    def take(self) -> list[Odometry]:
        """Give every result since the last call, the oldest first."""
        taken = list(self._untaken)
        self._untaken.clear()
        return taken

    def attitude(self, message: Message, now_s: float) -> None:
        """Take ATTITUDE; one that is not finite is dropped."""
        if all(math.isfinite(getattr(message, name)) for name in _ATTITUDE):
            self._hear(message.time_boot_ms, now_s)
            before, self._attitude = self._attitude, message
            self._join(before, message)

    def position(self, message: Message, now_s: float) -> None:
        """Take LOCAL_POSITION_NED; one that is not finite is dropped."""
        if all(math.isfinite(getattr(message, name)) for name in _POSITION):
            self._hear(message.time_boot_ms, now_s)
            self._join(self._attitude)  # an older one still waits: its own attitude was lost
            self._position = message
            if self._attitude is not None and _apart_ms(message, self._attitude) <= SAME_MOMENT_MS:
                self._join(self._attitude)

    def whole(self, message: Message, now_s: float) -> None:
        """Take ODOMETRY; one that cannot be used is dropped."""
        if not is_usable(message):
            return
        sent_s = time_s(message)
        clock = self.clock
        if sent_s > UNIX_SINCE_S:
            clock = self._unix
            clock.heard(sent_s, now_s)
        else:
            self._hear(round(1e3 * sent_s), now_s)
        if self._origin_N is not None:
            stamp_ns = round(clock.caller_s(sent_s) * 1e9)
            self._give(whole_odometry(message, self._origin_N, stamp_ns))

    def origin(self, message: Message, _now_s: float) -> None:
        """Take GPS_GLOBAL_ORIGIN: where the autopilot counts its position from."""
        if self._datum is not None:
            place = message.latitude * 1e-7, message.longitude * 1e-7
            self._origin_N = from_datum_N(self._datum, *place)

    def _hear(self, boot_ms: int, now_s: float) -> None:
        if self._datum and boot_ms < self._boot_ms - REBOOT_MS:
            self._origin_N = None  # it counts from another place now, and will tell
        self._boot_ms = boot_ms
        self.clock.heard(boot_ms * 1e-3, now_s)

    def _join(self, *attitudes: Message | None) -> None:
        """Give what follows from the position that waits, and the attitude nearest to it."""
        position, self._position = self._position, None
        known = [attitude for attitude in attitudes if attitude is not None]
        if position is None or self._origin_N is None or not known:
            return
        attitude = min(known, key=lambda message: _apart_ms(position, message))
        if _apart_ms(position, attitude) <= PAIR_WITHIN_MS:
            stamp_ns = round(self.clock.caller_s(position.time_boot_ms * 1e-3) * 1e9)
            self._give(_odometry(attitude, position, self._origin_N, stamp_ns))

    def _give(self, odometry: Odometry) -> None:
        self.newest = odometry
        self._untaken.append(odometry)


def _apart_ms(message: Message, other: Message) -> int:
    return abs(_later_ms(message, other))


def _later_ms(message: Message, other: Message) -> int:
    return int(message.time_boot_ms - other.time_boot_ms)


def _odometry(attitude: Message, position: Message, origin_N: Float64, stamp_ns: int) -> Odometry:
    rates_B = np.array([attitude.rollspeed, attitude.pitchspeed, attitude.yawspeed])
    turn = rates_B * (_later_ms(position, attitude) * 1e-3)
    q_NB = quaternion_product(
        quaternion_from_euler(attitude.roll, attitude.pitch, attitude.yaw),
        quaternion_from_euler(*turn),
    )
    velocity_N = np.array([position.vx, position.vy, position.vz])
    return Odometry(
        stamp_ns=stamp_ns,
        position_N=origin_N + np.array([position.x, position.y, position.z]),
        q_NB=q_NB,
        velocity_B=rotation_from_quaternion(q_NB).T @ velocity_N,
        rates_B=rates_B,
    )
