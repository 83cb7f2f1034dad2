"""Fixes on their way into the filter: those that come early or late, disagree, or fail to come."""

from __future__ import annotations

import math
from collections import deque

from twinscrew.runtime.estimation.chart import Chart
from twinscrew.runtime.estimation.events import GPS_BACK, GPS_DISAGREES, GPS_LOST, Notes
from twinscrew.runtime.estimation.inertial import InertialFilter
from twinscrew.runtime.estimation.kinematics import ATTITUDE, POSITION, rotation
from twinscrew.runtime.estimation.past import Past
from twinscrew.runtime.estimation.sensors import Carriage
from twinscrew.runtime.estimation.settings import EstimationSettings
from twinscrew.runtime.messages.types import NANOSECONDS_PER_SECOND, Fix, Float64

WAITING = 16
"""[-] Fixes that may wait for the IMU to reach their time."""


class FixIntake:
    """Takes fixes into the filter, each at its own time."""

    def __init__(
        self, settings: EstimationSettings, chart: Chart, carriage: Carriage, notes: Notes
    ) -> None:
        self._settings, self._chart, self._notes = settings, chart, notes
        self._arm_B = carriage.antenna_from_imu_B
        self.restart()

    def restart(self) -> None:
        """Forget all fixes."""
        self._waiting: deque[Fix] = deque(maxlen=WAITING)
        self._used_ns = 0
        self._refused_ns: int | None = None
        self._coasts = False

    def add(self, fix: Fix) -> None:
        """Let a fix wait until it is used."""
        self._waiting.append(fix)

    def start(self, now_ns: int) -> tuple[Float64, Float64] | None:
        """Give the antenna's position, (3,) [m], and its covariance by the newest fix.

        None if none is new enough.
        """
        latest_ns = now_ns - round(self._settings.gps_lost_s * NANOSECONDS_PER_SECOND)
        fixes = [fix for fix in self._waiting if latest_ns <= fix.stamp_ns <= now_ns]
        if not fixes:
            return None
        self._waiting.clear()
        self._used_ns = now_ns
        return self._chart.located(fixes[-1])

    def use(self, inertial: InertialFilter, past: Past) -> None:
        """Take in the fixes whose time the filter has reached."""
        now_ns = past.newest_ns
        if now_ns is None:
            return
        for _ in range(len(self._waiting)):
            fix = self._waiting.popleft()
            if fix.stamp_ns > now_ns:
                self._waiting.append(fix)
            else:
                self._use(fix, inertial, past)

    def watch(self, now_ns: int, inertial: InertialFilter) -> None:
        """Tell if no fix has been used for too long, and when one is again."""
        age_s = (now_ns - self._used_ns) / NANOSECONDS_PER_SECOND
        lost = age_s > self._settings.gps_lost_s
        if lost:
            sigma_m = inertial.horizontal_sigma(POSITION)
            detail = f"for {age_s:.1f} s; the position is known to {sigma_m:.1f} m"
            self._notes.lasting(GPS_LOST.at(now_ns, detail))
        elif self._coasts:
            self._notes.over(GPS_LOST)
            self._notes.add(GPS_BACK.at(now_ns))
        self._coasts = lost

    def _use(self, fix: Fix, inertial: InertialFilter, past: Past) -> None:
        then = past.at(fix.stamp_ns)
        if then is None:
            return
        z_N, R = self._chart.located(fix)
        before = inertial.x
        if inertial.measure_position(z_N, R, self._arm_B, then):
            past.correct(inertial.x - before)
            self._used_ns, self._refused_ns = max(self._used_ns, fix.stamp_ns), None
        elif self._refused_for_long(fix):
            off_N = z_N - then[POSITION] - rotation(then[ATTITUDE]) @ self._arm_B
            detail = f"{math.hypot(*off_N[:2]):.1f} m off"
            self._notes.add(GPS_DISAGREES.at(fix.stamp_ns, detail))
            inertial.place(z_N - rotation(inertial.x[ATTITUDE]) @ self._arm_B, R)
            past.clear()
            self._used_ns, self._refused_ns = fix.stamp_ns, None

    def _refused_for_long(self, fix: Fix) -> bool:
        """Note that a fix lies outside the gate; tell whether none has lain inside for too long."""
        self._refused_ns = self._refused_ns or fix.stamp_ns
        lasts_s = (fix.stamp_ns - self._refused_ns) / NANOSECONDS_PER_SECOND
        return lasts_s >= self._settings.gps_disagrees_s
