"""Odometry from the autopilot's own state, stamped with the time of this machine."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass
from itertools import pairwise
from statistics import median_low
from typing import Final

import numpy as np
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from twinscrew.runtime.datum import Datum, from_datum_N
from twinscrew.runtime.geometry import (
    quaternion_from_euler,
    quaternion_product,
    rotation_from_quaternion,
)
from twinscrew.runtime.mavlink import Message
from twinscrew.runtime.messages.types import Float64, Odometry

# -- The autopilot's time since boot in the caller's time.
#
# Two sources. Every message bounds the difference: it came no earlier than it was sent, so the
# smallest (arrival - its own time) ever seen is off by the least delay. TIMESYNC halves that error:
# the answer tells the autopilot's time between our question and its arrival, and the fastest
# question's middle is the best guess. The clocks drift apart by some parts per million: what was
# seen longer ago counts less (`FORGET`), so that the difference follows.
#
# A simulated autopilot may count much more slowly than we do, where the simulation cannot keep up
# with real time. No delay looks like that: an answer shows the difference to within half of its
# round trip, so two answers that contradict each other prove that the clocks run apart. Then older
# measurements are dropped, and the difference is carried on at the rate at which it changes.


FORGET = 1e-4
"""[s/s] How fast an old measurement loses its worth: more than two crystals drift (100 ppm)."""
ASK_S = 1.0
"""[s] Between two TIMESYNC questions."""
LONGEST_DELAY_S = 5.0
"""[s] No line is slower: who answers as if it were counts by another clock than its messages."""
_REBOOT_S = 1.0
"""[s] A time this far back means that the autopilot started again."""
_FASTEST = 1.0
"""[s/s] The difference grows no faster: no clock counts backwards."""
_ANSWERS = 4
"""[-] The median change from one to the next of so many answers is the rate."""


@dataclass(slots=True)
class _Difference:
    """The caller's time less the autopilot's [s], as one source measured it."""

    value_s: float = math.inf
    error_s: float = math.inf
    """[s] How good the measurement was: less is better."""
    at_s: float = -math.inf

    def offer(self, value_s: float, error_s: float, now_s: float, rate: float) -> None:
        """Take a new measurement if it is better than the old one has become."""
        passed_s = max(0.0, now_s - self.at_s)
        grown_s = rate * passed_s if math.isfinite(passed_s) else 0.0
        if error_s <= self.error_s + FORGET * passed_s + max(0.0, grown_s):
            self.value_s, self.error_s, self.at_s = value_s, error_s, now_s

    def now(self, now_s: float, rate: float) -> float:
        """Give the difference [s] at a time, if it has changed at a rate since."""
        return self.value_s + rate * max(0.0, now_s - self.at_s) if rate else self.value_s


@dataclass(frozen=True, slots=True)
class _Answer:
    """What an answered TIMESYNC shows: the difference [s], to within `error_s`, at `at_s`."""

    value_s: float
    error_s: float
    at_s: float

    def contradicts(self, other: _Answer) -> bool:
        """Tell whether the two cannot be of clocks that run at one rate."""
        drift_s = FORGET * abs(self.at_s - other.at_s)
        return abs(self.value_s - other.value_s) > self.error_s + other.error_s + drift_s


class BootClock:
    """Measures the difference between the caller's time and the autopilot's."""

    def __init__(self) -> None:
        self._question_ns: int | None = None
        self._asked_s = -math.inf
        self._boot_s = -math.inf
        self._now_s = -math.inf
        self._forget()

    def _forget(self) -> None:
        self._one_way = _Difference()
        self._synced = _Difference()
        self._answers: deque[_Answer] = deque(maxlen=_ANSWERS)
        self._rate = 0.0

    def caller_s(self, boot_s: float) -> float:
        """Give the caller's time [s] of an autopilot's time since boot [s]."""
        latest_s = self._one_way.now(self._now_s, self._rate)
        synced_s = self._synced.now(self._now_s, self._rate)
        apart = math.isfinite(latest_s) and latest_s - synced_s > LONGEST_DELAY_S
        return boot_s + (latest_s if apart else min(latest_s, synced_s))

    def heard(self, boot_s: float, now_s: float) -> None:
        """Take the time since boot that a message carries, which came now."""
        if boot_s < self._boot_s - _REBOOT_S:
            self._forget()
        self._boot_s, self._now_s = boot_s, now_s
        difference_s = now_s - boot_s  # the less, the less delay
        self._one_way.offer(difference_s, difference_s, now_s, self._rate)

    def ask(self, now_s: float) -> list[Message]:
        """Give the TIMESYNC question if it is time for one."""
        if now_s - self._asked_s < ASK_S:
            return []
        self._asked_s = now_s
        self._question_ns = round(now_s * 1e9)
        return [mavlink.MAVLink_timesync_message(0, self._question_ns)]

    def answered(self, message: Message, now_s: float) -> float | None:
        """Take a TIMESYNC; only the answer to our last question counts.

        Returns
        -------
        float or None
            When the question was sent [s]; None if this does not answer it.
        """
        if message.tc1 == 0 or message.ts1 != self._question_ns:
            return None
        self._question_ns = None
        round_trip_s = float(now_s - message.ts1 * 1e-9)
        if round_trip_s >= 0.0:
            middle_s = now_s - round_trip_s / 2
            answer = _Answer(middle_s - message.tc1 * 1e-9, round_trip_s / 2, now_s)
            self._follow(answer)
            self._synced.offer(answer.value_s, round_trip_s, now_s, 0.0)
        return now_s - round_trip_s

    def _follow(self, answer: _Answer) -> None:
        """Find whether the clocks run apart, at which rate, and what is not true any more."""
        known = [*self._answers, answer]
        self._answers.append(answer)
        if not any(one.contradicts(answer) for one in known[:-1]):
            self._rate = 0.0
            return
        rates = [
            (after.value_s - before.value_s) / max(after.at_s - before.at_s, 1e-3)
            for before, after in pairwise(known)
        ]
        self._rate = max(-_FASTEST, min(_FASTEST, median_low(rates))) if len(rates) > 1 else 0.0
        self._synced = _Difference()
        if math.isfinite(self._now_s):
            difference_s = self._now_s - self._boot_s
            self._one_way = _Difference(difference_s, difference_s, self._now_s)


# -- ODOMETRY (331): position, attitude and velocity of one moment in one message.
#
# Visual-inertial systems and PX4 send it; ArduPilot (4.6) takes it in but sends none.

UNIX_SINCE_S: Final = 1e9
"""[s] Times later than this (the year 2001) are counted from 1970, earlier ones from the boot."""
_IN_BODY: Final = (mavlink.MAV_FRAME_BODY_FRD, mavlink.MAV_FRAME_BODY_NED)
"""Frames of a velocity in the vessel's axes; the second is the older name of the first."""
_NUMBERS: Final = ("x", "y", "z", "vx", "vy", "vz", "rollspeed", "pitchspeed", "yawspeed")
_QUATERNION_TOLERANCE: Final = 1e-2
_FAILED: Final = -1


def time_s(message: Message) -> float:
    """[s] Give the time that the message carries, since the sender's boot or since 1970."""
    return float(message.time_usec) * 1e-6


def is_usable(message: Message) -> bool:
    """Tell whether it is whole, in frames that we know, and its estimator has not failed."""
    known = message.frame_id == mavlink.MAV_FRAME_LOCAL_NED and (
        message.child_frame_id in (*_IN_BODY, mavlink.MAV_FRAME_LOCAL_NED)
    )
    finite = all(math.isfinite(getattr(message, name)) for name in _NUMBERS)
    norm = math.hypot(*message.q)
    unit = math.isfinite(norm) and abs(norm - 1.0) <= _QUATERNION_TOLERANCE
    return known and finite and unit and message.quality != _FAILED


def whole_odometry(message: Message, origin_N: Float64, stamp_ns: int) -> Odometry:
    """Give the odometry of a message that `is_usable`.

    Parameters
    ----------
    message
        An ODOMETRY.
    origin_N : (3,) float64
        Where its sender's frame begins [m].
    stamp_ns
        [ns] When it was measured, on the caller's clock.
    """
    q_NB = np.array(message.q, dtype=np.float64)
    q_NB /= math.sqrt(float(q_NB @ q_NB))
    velocity = np.array([message.vx, message.vy, message.vz])
    if message.child_frame_id not in _IN_BODY:
        velocity = rotation_from_quaternion(q_NB).T @ velocity
    return Odometry(
        stamp_ns=stamp_ns,
        position_N=origin_N + np.array([message.x, message.y, message.z]),
        q_NB=q_NB,
        velocity_B=velocity,
        rates_B=np.array([message.rollspeed, message.pitchspeed, message.yawspeed]),
    )


# -- Odometry from the autopilot: LOCAL_POSITION_NED and ATTITUDE, joined, or ODOMETRY.
#
# They carry the autopilot's time since boot, which `BootClock` brings to the caller's time.

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
