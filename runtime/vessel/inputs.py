"""Odometry at the time of a scan, from the messages around it."""

from __future__ import annotations

import math
from collections import deque
from enum import Enum, auto
from typing import Annotated, Final

import numpy as np
from msgspec import Meta

from twinscrew.runtime.geometry.angles import wrap
from twinscrew.runtime.geometry.frames import (
    interpolate_quaternion,
    quaternion_from_euler,
    quaternion_product,
    rotation_from_quaternion,
)
from twinscrew.runtime.messages.types import NANOSECONDS_PER_SECOND, Float32, Odometry, PointCloud
from twinscrew.runtime.settings import Positive, Settings


class OdometryBufferSettings(Settings, frozen=True):
    """How far odometry is trusted."""

    max_extrapolation_s: Positive = 0.2
    """[s] A scan newer than the last odometry by more than this is not used."""
    max_lag_s: Annotated[float, Meta(gt=0.0, le=0.4)] = 0.4
    """[s] Nor is one older than it by more than this: at most the greatest age of a scan
    (topics.py), or scans that come late would be signs of life."""
    max_speed_mps: Positive = 10.0
    """[m/s] A position that moves faster than this (and a metre of slack) has jumped."""
    clock_back_s: Positive = 1.0
    """[s] A stamp this much older than the last one means that the clock was set back."""


JUMP_SLACK_M = 1.0
HISTORY_S = 3.0
"""[s] Odometry is kept for so long, whatever its rate: much longer than any scan that is used is
late."""
MOST_SAMPLES = 8192
"""[-] But no more than this: more than two thousand a second are not needed to interpolate."""


class Arrival(Enum):
    """What a new odometry message is, compared with the last one."""

    NEW = auto()
    OLD = auto()
    JUMP = auto()
    CLOCK_BACK = auto()


class OdometryBuffer:
    """Keeps the last few seconds of odometry."""

    def __init__(self, settings: OdometryBufferSettings | None = None) -> None:
        self._settings = settings or OdometryBufferSettings()
        self._samples: deque[Odometry] = deque(maxlen=MOST_SAMPLES)

    @property
    def newest(self) -> Odometry | None:
        """The last message that was in order."""
        return self._samples[-1] if self._samples else None

    def clear(self) -> None:
        """Forget everything."""
        self._samples.clear()

    def add(self, odometry: Odometry) -> Arrival:
        """Take in a message; after a jump or a clock set back, it is the only one kept."""
        if not self._samples:
            self._samples.append(odometry)
            return Arrival.NEW
        last = self._samples[-1]
        dt_s = seconds_between(last.stamp_ns, odometry.stamp_ns)
        if dt_s < -self._settings.clock_back_s:
            self._restart(odometry)
            return Arrival.CLOCK_BACK
        if dt_s <= 0.0:
            return Arrival.OLD
        moved_m = math.dist(odometry.position_N[:2], last.position_N[:2])
        if moved_m > self._settings.max_speed_mps * dt_s + JUMP_SLACK_M:
            self._restart(odometry)
            return Arrival.JUMP
        self._samples.append(odometry)
        while seconds_between(self._samples[0].stamp_ns, odometry.stamp_ns) > HISTORY_S:
            self._samples.popleft()
        return Arrival.NEW

    def at(self, stamp_ns: int) -> Odometry | None:
        """Give the odometry at a time: between two messages, or a little after the last.

        None if there is no message near enough: none at all, all of them later than the time, or
        the last one older than `max_extrapolation_s`.
        """
        before: Odometry | None = None
        after: Odometry | None = None
        for sample in reversed(self._samples):
            if sample.stamp_ns <= stamp_ns:
                before = sample
                break
            after = sample
        if before is None or before.stamp_ns == stamp_ns:
            return before
        if after is not None:
            return interpolate(before, after, stamp_ns)
        if seconds_between(before.stamp_ns, stamp_ns) > self._settings.max_extrapolation_s:
            return None
        return extrapolate(before, stamp_ns)

    def _restart(self, odometry: Odometry) -> None:
        self._samples.clear()
        self._samples.append(odometry)


def seconds_between(earlier_ns: int, later_ns: int) -> float:
    """[s] From one stamp to another."""
    return (later_ns - earlier_ns) / NANOSECONDS_PER_SECOND


def interpolate(before: Odometry, after: Odometry, stamp_ns: int) -> Odometry:
    """Give the odometry at a time between two messages, linearly."""
    f = (stamp_ns - before.stamp_ns) / (after.stamp_ns - before.stamp_ns)
    return Odometry(
        stamp_ns=stamp_ns,
        position_N=(1 - f) * before.position_N + f * after.position_N,
        q_NB=interpolate_quaternion(before.q_NB, after.q_NB, f),
        velocity_B=(1 - f) * before.velocity_B + f * after.velocity_B,
        rates_B=(1 - f) * before.rates_B + f * after.rates_B,
    )


def extrapolate(last: Odometry, stamp_ns: int) -> Odometry:
    """Give the odometry a little later than a message, at constant velocity and rates."""
    dt_s = seconds_between(last.stamp_ns, stamp_ns)
    turn = quaternion_from_euler(*(float(rate) * dt_s for rate in last.rates_B))
    return Odometry(
        stamp_ns=stamp_ns,
        position_N=last.position_N + rotation_from_quaternion(last.q_NB) @ last.velocity_B * dt_s,
        q_NB=quaternion_product(last.q_NB, turn),
        velocity_B=last.velocity_B,
        rates_B=last.rates_B,
    )


# -- Tells news from repetition: a sensor that hangs may go on talking.
#
# A driver that repeats its last measurement under new stamps looks alive to everything that counts
# messages. But a vessel that moves never sees the same twice, and one that says it moves does not
# stay where it is. Stamps and contents decide, no clock.

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
