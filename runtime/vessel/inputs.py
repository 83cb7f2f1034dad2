"""Scans and odometry in order of their stamps: what is used, what is refused, and why.

Stamps and contents decide, no clock, so that a replay refuses the same messages. A message that is
refused does not count as a sign of life of its sensor.

- A message as old as the last one, or a little older, is dropped. One that is more than
  `clock_back_s` older means that the clock was set back: everything remembered is forgotten.
- A position that moves faster than a boat can has jumped: the surroundings are forgotten.
- A scan is used with the odometry at its time: interpolated, or extrapolated a little. Without
  odometry near its time, or much older than the newest odometry, it is not used.
- A driver that repeats its last measurement under new stamps looks alive to everything that counts
  messages. But a vessel that moves never sees the same twice, and one that says it moves does not
  stay where it is.
"""

from __future__ import annotations

import math
import time
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from statistics import median_low
from typing import Annotated, Final, Literal

import numpy as np
from msgspec import Meta

from twinscrew.runtime.geometry import (
    interpolate_quaternion,
    quaternion_from_euler,
    quaternion_product,
    rotation_from_quaternion,
    wrap,
)
from twinscrew.runtime.messages.types import (
    NANOSECONDS_PER_SECOND,
    Float32,
    HealthEvent,
    Odometry,
    PointCloud,
)
from twinscrew.runtime.safety.events import (
    CLOCK_BACK,
    INPUT_FROZEN,
    INPUT_LATE,
    ODOMETRY_JUMP,
    ODOMETRY_MISSING,
    OUT_OF_ORDER,
)
from twinscrew.runtime.settings import NonNegative, Positive, Settings

JUMP_SLACK_M: Final = 1.0
HISTORY_S: Final = 3.0
"""[s] Odometry is kept for so long, whatever its rate: much longer than any scan that is used is
late."""
MOST_SAMPLES: Final = 8192
"""[-] But no more than this: more than two thousand a second are not needed to interpolate."""
MOVED_M: Final = 0.05
"""[m] A vessel that has moved farther than this, or turned more than"""
TURNED: Final = math.radians(0.5)
"""[rad] this, must see something else: both are far beyond what rounding could hide."""
UNDER_WAY_MPS: Final = 0.2
"""[m/s] Odometry that says this, and is the same to the last bit, contradicts itself."""
_SAMPLES: Final = 32
"""[-] Points that are compared first: scans that differ, differ there."""


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


@dataclass(frozen=True, slots=True)
class Verdict:
    """What a scan or odometry is good for."""

    in_order: bool = True
    """False if it is as old as the last one of its kind, or a little older."""
    usable: bool = True
    """False if it is refused: then it is no sign of life of its sensor either."""
    forget: bool = False
    """Whether the surroundings must be forgotten: time or position has jumped."""
    events: tuple[HealthEvent, ...] = ()
    """What an operator should know."""
    odometry: Odometry | None = None
    """The vessel's state at the stamp of a scan that is usable."""


_USABLE: Final = Verdict()


class Inputs:
    """Remembers the last scan and the last seconds of odometry, and judges what comes next."""

    def __init__(self, settings: OdometryBufferSettings | None = None) -> None:
        self._settings = settings or OdometryBufferSettings()
        self._samples: deque[Odometry] = deque(maxlen=MOST_SAMPLES)
        self._odometry: Odometry | None = None
        self._scan: tuple[Float32, Odometry] | None = None
        self._scan_ns: int | None = None
        self.latest_ns = 0
        """[ns] The stamp of the last scan or odometry that was in order: what time it is."""

    @property
    def newest(self) -> Odometry | None:
        """The last odometry that was in order."""
        return self._samples[-1] if self._samples else None

    def odometry(self, odometry: Odometry) -> Verdict:
        """Judge odometry, and keep it if it is usable."""
        stamp_ns, settings = odometry.stamp_ns, self._settings
        if self._repeats_odometry(odometry):
            return _refused(INPUT_FROZEN.at(self.latest_ns, "odometry"))
        verdict = _USABLE
        if self._samples:
            last = self._samples[-1]
            dt_s = seconds_between(last.stamp_ns, stamp_ns)
            if dt_s < -settings.clock_back_s:
                verdict = self._clock_back("odometry", stamp_ns)
            elif dt_s <= 0.0:
                late = OUT_OF_ORDER.at(self.latest_ns, f"odometry of {stamp_ns} ns")
                return _refused(late, in_order=False)
            else:
                moved_m = math.dist(odometry.position_N[:2], last.position_N[:2])
                if odometry.frame_id != last.frame_id:
                    self._samples.clear()
                    names = f"from frame {last.frame_id!r} to {odometry.frame_id!r}"
                    verdict = Verdict(forget=True, events=(ODOMETRY_JUMP.at(stamp_ns, names),))
                elif moved_m > settings.max_speed_mps * dt_s + JUMP_SLACK_M:
                    self._samples.clear()
                    north, east = odometry.position_N[:2]
                    to = f"to north {north:.1f} m, east {east:.1f} m"
                    verdict = Verdict(forget=True, events=(ODOMETRY_JUMP.at(stamp_ns, to),))
        self._samples.append(odometry)
        while seconds_between(self._samples[0].stamp_ns, stamp_ns) > HISTORY_S:
            self._samples.popleft()
        self.latest_ns = stamp_ns
        return verdict

    def scan(self, cloud: PointCloud) -> Verdict:
        """Judge a scan, and find the vessel's state at its stamp."""
        stamp_ns, verdict = cloud.stamp_ns, _USABLE
        if self._scan_ns is not None and stamp_ns <= self._scan_ns:
            if seconds_between(stamp_ns, self._scan_ns) <= self._settings.clock_back_s:
                late = OUT_OF_ORDER.at(self.latest_ns, f"scan of {stamp_ns} ns")
                return _refused(late, in_order=False)
            verdict = self._clock_back("points", stamp_ns)
        lag_s = seconds_between(stamp_ns, self.latest_ns)
        self._scan_ns = self.latest_ns = stamp_ns
        odometry = self.at(stamp_ns)
        if odometry is None:
            return _refused(*verdict.events, ODOMETRY_MISSING.at(stamp_ns), forget=verdict.forget)
        if not verdict.forget and lag_s > self._settings.max_lag_s:
            late = INPUT_LATE.at(stamp_ns, f"a scan {lag_s:.2f} s older than the odometry")
            return _refused(late)
        if self._repeats_scan(cloud, odometry):
            frozen = INPUT_FROZEN.at(stamp_ns, "points")
            return _refused(*verdict.events, frozen, forget=verdict.forget)
        return Verdict(forget=verdict.forget, events=verdict.events, odometry=odometry)

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

    def _clock_back(self, topic: str, stamp_ns: int) -> Verdict:
        """Forget all times, which were of another clock."""
        self._samples.clear()
        self._scan_ns = None
        back_s = seconds_between(stamp_ns, self.latest_ns)
        event = CLOCK_BACK.at(stamp_ns, f"{topic}: {back_s:.3f} s before the last message")
        return Verdict(forget=True, events=(event,))

    def _repeats_scan(self, cloud: PointCloud, odometry: Odometry) -> bool:
        """Tell whether a scan shows the same as an earlier one, though the vessel has moved."""
        if self._scan is None or not _same(self._scan[0], cloud.points_S):
            self._scan = cloud.points_S, odometry
            return False
        return _moved(self._scan[1], odometry) and bool(np.isfinite(cloud.points_S).any())

    def _repeats_odometry(self, odometry: Odometry) -> bool:
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
        frame_id=before.frame_id,
        child_frame_id=before.child_frame_id,
    )


def extrapolate(last: Odometry, stamp_ns: int) -> Odometry:
    """Give the odometry a little later than a message, at constant velocity and rates."""
    dt_s = seconds_between(last.stamp_ns, stamp_ns)
    turn = quaternion_from_euler(*(float(rate) * dt_s for rate in last.rates_B))
    moved = rotation_from_quaternion(last.q_NB) @ last.velocity_B * dt_s
    q_NB = quaternion_product(last.q_NB, turn)
    return replace(last, stamp_ns=stamp_ns, position_N=last.position_N + moved, q_NB=q_NB)


def _refused(*events: HealthEvent, in_order: bool = True, forget: bool = False) -> Verdict:
    return Verdict(in_order=in_order, usable=False, forget=forget, events=events)


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


# -- The autopilot's odometry in the LiDAR's time.

WINDOW: Final = 101
"""[-] Scans whose arrivals count: ten seconds of a 10 Hz LiDAR."""
ANOTHER_CLOCK_NS: Final = NANOSECONDS_PER_SECOND
"""[ns] A difference off by more than this is no delay: somebody set a clock."""


RUNS_APART_NS: Final = 50_000_000
"""[ns] A difference that changed by more within the window, and always in one direction, is that of
clocks of different rates."""
STEADY_SCANS: Final = 2
"""[-] That is looked for in each quarter of the window once it holds so many scans."""


class AlignmentSettings(Settings, frozen=True):
    """How the autopilot's time becomes the LiDAR's; only for `odometry_source = "autopilot"`."""

    lidar_clock: Literal["arrival", "system"] = "arrival"
    """What the scans' stamps are: of a clock known only by when scans arrive, or of this
    machine's wall clock."""
    lidar_latency_s: NonNegative = 0.0
    """[s] Usual time from a scan's stamp to its arrival, taken out of `arrival`'s difference."""


class Alignment:
    """The LiDAR's clock less the loop's.

    Scans and odometry are put in order by their stamps, so both must be of one clock. The
    autopilot's state comes with the loop's monotonic time (`runtime/link/ardupilot/odometry.py`),
    scans with the stamps of the LiDAR's driver. Two rules, one of which is configured:

    - `arrival`: stamp and arrival of every scan give the clocks' difference, latency included. The
      median of the last ten seconds counts: a late or wrongly stamped scan moves nothing, and drift
      is followed. If the difference has grown all the time, as in a simulation that is slower than
      real time, it is carried on to now. The latency that is known (`lidar_latency_s`) is taken
      out.
    - `system`: stamps are this machine's wall clock (a LiDAR synchronised by PTP or NTP, or stamped
      by a driver on board), whose difference to the monotonic clock is known exactly.
    """

    def __init__(
        self, settings: AlignmentSettings | None = None, wall_ns: Callable[[], int] = time.time_ns
    ) -> None:
        self._settings = settings or AlignmentSettings()
        self._wall_ns = wall_ns
        self._seen_ns: deque[int] = deque(maxlen=WINDOW)
        self.difference_ns: int | None = None
        """[ns] None before the first scan."""

    def scan_came(self, stamp_ns: int, now_s: float) -> None:
        """Take a scan's stamp, and the loop's time when it came."""
        now_ns = round(now_s * NANOSECONDS_PER_SECOND)
        if self._settings.lidar_clock == "system":
            self.difference_ns = self._wall_ns() - now_ns
            return
        latency_ns = round(self._settings.lidar_latency_s * NANOSECONDS_PER_SECOND)
        seen_ns = stamp_ns + latency_ns - now_ns
        known_ns = self.difference_ns
        if known_ns is not None and abs(seen_ns - known_ns) > ANOTHER_CLOCK_NS:
            self._seen_ns.clear()
        self._seen_ns.append(seen_ns)
        self.difference_ns = _newest_difference(self._seen_ns)

    def lidar_ns(self, loop_ns: int) -> int | None:
        """Give the LiDAR's time of a time of the loop; None before the first scan."""
        return None if self.difference_ns is None else loop_ns + self.difference_ns


def _newest_difference(seen_ns: Sequence[int]) -> int:
    """Give the median [ns], carried on to the last value if all of them rise, or fall."""
    seen = list(seen_ns)
    quarter = len(seen) // 4
    if quarter < STEADY_SCANS:
        return median_low(seen)
    parts = [seen[len(seen) - k * quarter :][:quarter] for k in (4, 3, 2, 1)]
    first, second, third, last = (median_low(part) for part in parts)
    rises = first < second < third < last or first > second > third > last
    if not rises or abs(last - first) < RUNS_APART_NS:
        return median_low(seen)
    return min(max(last + (last - third) // 2, min(parts[-1])), max(parts[-1]))
