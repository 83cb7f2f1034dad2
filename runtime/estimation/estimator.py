"""Odometry from a satellite receiver and an inertial measurement unit.

`imu` and `fix` take messages in the order in which they come; `imu` answers with odometry at an
even rate. The messages bring the time. What is wrong with them is a health event, and in the end no
odometry: who needs it sees it go stale.
"""

from __future__ import annotations

import math
from collections import deque

import numpy as np

from twinscrew.runtime.estimation.chart import Chart
from twinscrew.runtime.estimation.events import (
    ESTIMATE_LOST,
    ESTIMATE_READY,
    GPS_BACK,
    GPS_DISAGREES,
    GPS_LOST,
    HEADING_UNKNOWN,
    IMU_GAP,
    Notes,
)
from twinscrew.runtime.estimation.inertial import InertialFilter, InertialSettings
from twinscrew.runtime.estimation.kinematics import (
    ATTITUDE,
    GYRO_BIAS,
    POSITION,
    VELOCITY,
    rotation,
)
from twinscrew.runtime.estimation.past import Past
from twinscrew.runtime.estimation.sensors import Carriage, ImuInBody, SensorSettings
from twinscrew.runtime.estimation.wgs84 import LocalFrame
from twinscrew.runtime.geometry.frames import quaternion_from_euler
from twinscrew.runtime.link.datum import Datum
from twinscrew.runtime.messages.types import (
    NANOSECONDS_PER_SECOND,
    Fix,
    Float64,
    HealthEvent,
    Imu,
    Odometry,
)
from twinscrew.runtime.settings import Positive, Settings
from twinscrew.runtime.tracking.light import extended_kalman_filter

WAITING = 16
"""[-] Fixes that may wait for the IMU to reach their time."""


class EstimationSettings(Settings, frozen=True):
    """Odometry from GPS and IMU; only for `odometry_source = "gps_imu"`."""

    datum: Datum | None = None
    """latitude_deg and longitude_deg of the local frame's origin; none: the first fix."""
    rate_hz: Positive = 20.0
    """[Hz] How often odometry is given."""
    attitude_hz: Positive = 10.0
    """[Hz] How often the IMU's attitude is used: its errors do not change faster."""
    gps_lost_s: Positive = 0.5
    """[s] After so long without a fix that can be used the estimate is said to coast."""
    gps_disagrees_s: Positive = 2.0
    """[s] After fixes have lain outside the gate for so long the estimate starts from them anew."""
    usable_sigma_m: Positive = 2.0
    """[m] Odometry is given while the position's standard deviation is less, in any direction,"""
    usable_sigma_mps: Positive = 0.5
    """[m/s] and the velocity's: after the first fix it is not known yet."""
    imu_gap_s: Positive = 0.25
    """[s] After a longer silence of the IMU the estimate starts anew."""
    sensors: SensorSettings = SensorSettings()
    inertial: InertialSettings = InertialSettings()


class Estimator:
    """One vessel's state, from its sensors' messages."""

    def __init__(self, settings: EstimationSettings | None = None) -> None:
        self._settings = settings or EstimationSettings()
        extended_kalman_filter()  # its import takes 0.2 s: now, and not when the first fix comes
        self.carriage = Carriage(self._settings.sensors)
        """Where the sensors sit."""
        self._chart = Chart(self._settings.datum, self.carriage)
        self._notes = Notes()
        self._felt: ImuInBody | None = None
        self._begin()

    def imu(self, message: Imu) -> Odometry | None:
        """Move on to an IMU message's time; give the odometry there if it is due and usable."""
        felt = self.carriage.in_body(message)
        dt_s = self._follow(felt.stamp_ns)
        if dt_s is None:
            return None
        if self._filter is None:
            self._start(felt)
        else:
            self._move(felt, dt_s)
            if not self._filter.is_sound:
                self._notes.add(ESTIMATE_LOST.at(felt.stamp_ns, "nonsense: starting anew"))
                self.restart()
        self._felt = felt
        return self._odometry(felt)

    def fix(self, message: Fix) -> None:
        """Take in a fix; one from the IMU's future waits for it."""
        if message.valid:
            self._waiting.append(message)
            self._use_fixes()

    def restart(self) -> None:
        """Forget everything but where the local frame is."""
        self._begin()

    def take_events(self) -> tuple[HealthEvent, ...]:
        """Give what an operator should know, since the last call."""
        return self._notes.take()

    @property
    def inertial(self) -> InertialFilter | None:
        """The filter; None before the first fix and attitude."""
        return self._filter

    @property
    def frame(self) -> LocalFrame | None:
        """The local frame; None before the first fix."""
        return self._chart.frame

    def _begin(self) -> None:
        """Know nothing; but the local frame stays where it is."""
        self._filter: InertialFilter | None = None
        self._felt = None
        self._past = Past()
        self._waiting: deque[Fix] = deque(maxlen=WAITING)
        self._used_ns = self._attitude_ns = 0
        self._slot: int | None = None
        self._refused_ns: int | None = None
        self._usable = self._coasts = False

    def _follow(self, stamp_ns: int) -> float | None:
        """[s] Give the time since the last IMU message; None if this one is no newer."""
        if self._felt is None:
            return 0.0
        dt_s = (stamp_ns - self._felt.stamp_ns) / NANOSECONDS_PER_SECOND
        if -self._settings.imu_gap_s <= dt_s <= 0.0:
            return None
        if not 0.0 < dt_s <= self._settings.imu_gap_s:
            if self._filter is not None:
                self._notes.add(IMU_GAP.at(stamp_ns, f"{dt_s:.2f} s after the last message"))
            self._begin()
            return 0.0
        return dt_s

    def _start(self, felt: ImuInBody) -> None:
        """Start from the newest fix, once there are one and an attitude."""
        if felt.attitude is None:
            self._notes.lasting(
                HEADING_UNKNOWN.at(felt.stamp_ns, "orientation_covariance[0] is -1")
            )
            return
        latest_ns = felt.stamp_ns - round(self._settings.gps_lost_s * NANOSECONDS_PER_SECOND)
        fixes = [f for f in self._waiting if latest_ns <= f.stamp_ns <= felt.stamp_ns]
        if not fixes:
            return
        z_N, R = self._chart.located(fixes[-1])
        arm_N = rotation(felt.attitude) @ self.carriage.antenna_from_imu_B
        attitude_R = self.carriage.attitude_R(felt)
        self._filter = InertialFilter(
            self._settings.inertial, z_N - arm_N, R, felt.attitude, attitude_R
        )
        self._waiting.clear()
        self._used_ns = self._attitude_ns = felt.stamp_ns

    def _move(self, felt: ImuInBody, dt_s: float) -> None:
        inertial, before = self._filter, self._felt
        assert inertial is not None  # noqa: S101  (imu saw it)
        assert before is not None  # noqa: S101
        inertial.predict(
            0.5 * (before.rates_B + felt.rates_B),
            0.5 * (before.force_B + felt.force_B),
            dt_s,
            rates_psd=None if felt.rates_variance is None else felt.rates_variance * dt_s,
            force_psd=None if felt.force_variance is None else felt.force_variance * dt_s,
        )
        self._past.add(felt.stamp_ns, inertial.x)
        self._use_attitude(felt, inertial)
        self._use_fixes()
        self._watch_fixes(felt.stamp_ns)

    def _use_attitude(self, felt: ImuInBody, inertial: InertialFilter) -> None:
        every_ns = NANOSECONDS_PER_SECOND / self._settings.attitude_hz
        if felt.attitude is None or felt.stamp_ns - self._attitude_ns < every_ns:
            return
        self._attitude_ns = felt.stamp_ns
        before = inertial.x
        inertial.measure_attitude(felt.attitude, self.carriage.attitude_R(felt))
        self._past.correct(inertial.x - before)

    def _use_fixes(self) -> None:
        """Take in the fixes whose time the filter has reached."""
        now_ns = self._past.newest_ns
        if self._filter is None or now_ns is None:
            return
        for _ in range(len(self._waiting)):
            fix = self._waiting.popleft()
            if fix.stamp_ns > now_ns:
                self._waiting.append(fix)
            else:
                self._use(fix, self._filter)

    def _use(self, fix: Fix, inertial: InertialFilter) -> None:
        then = self._past.at(fix.stamp_ns)
        if then is None:
            return
        z_N, R = self._chart.located(fix)
        before = inertial.x
        if inertial.measure_position(z_N, R, self.carriage.antenna_from_imu_B, then):
            self._past.correct(inertial.x - before)
            self._used_ns, self._refused_ns = max(self._used_ns, fix.stamp_ns), None
        else:
            self._disagree(fix, z_N, R, then, inertial)

    def _disagree(
        self, fix: Fix, z_N: Float64, R: Float64, then: Float64, inertial: InertialFilter
    ) -> None:
        """Start from the fixes anew if none has lain inside the gate for too long."""
        self._refused_ns = self._refused_ns or fix.stamp_ns
        lasts_s = (fix.stamp_ns - self._refused_ns) / NANOSECONDS_PER_SECOND
        if lasts_s < self._settings.gps_disagrees_s:
            return
        arm_B = self.carriage.antenna_from_imu_B
        off_m = math.hypot(*(z_N - then[POSITION] - rotation(then[ATTITUDE]) @ arm_B)[:2])
        self._notes.add(GPS_DISAGREES.at(fix.stamp_ns, f"{off_m:.1f} m off"))
        inertial.place(z_N - rotation(inertial.x[ATTITUDE]) @ arm_B, R)
        self._past.clear()
        self._used_ns, self._refused_ns = fix.stamp_ns, None

    def _watch_fixes(self, now_ns: int) -> None:
        age_s = (now_ns - self._used_ns) / NANOSECONDS_PER_SECOND
        lost = age_s > self._settings.gps_lost_s
        if lost:
            detail = f"for {age_s:.1f} s; the position is known to {self._sigma(POSITION):.1f} m"
            self._notes.lasting(GPS_LOST.at(now_ns, detail))
        elif self._coasts:
            self._notes.over(GPS_LOST)
            self._notes.add(GPS_BACK.at(now_ns))
        self._coasts = lost

    def _odometry(self, felt: ImuInBody) -> Odometry | None:
        # Multiples of the period, not steps from the start: those of a LiDAR on the same clock.
        slot = felt.stamp_ns // round(NANOSECONDS_PER_SECOND / self._settings.rate_hz)
        if self._filter is None or slot == self._slot:
            return None
        self._slot = slot
        if not self._is_usable(felt.stamp_ns):
            return None
        x = self._filter.x
        R_NB = rotation(x[ATTITUDE])
        rates_B = felt.rates_B - x[GYRO_BIAS]
        imu_B = self.carriage.imu_B
        return Odometry(
            stamp_ns=felt.stamp_ns,
            position_N=x[POSITION] - R_NB @ imu_B,
            q_NB=quaternion_from_euler(*x[ATTITUDE].tolist()),
            velocity_B=R_NB.T @ x[VELOCITY] - np.cross(rates_B, imu_B),
            rates_B=rates_B,
        )

    def _is_usable(self, now_ns: int) -> bool:
        settings = self._settings
        sigma_m, sigma_mps = self._sigma(POSITION), self._sigma(VELOCITY)
        usable = sigma_m < settings.usable_sigma_m and sigma_mps < settings.usable_sigma_mps
        if usable != self._usable:
            kind = ESTIMATE_READY if usable else ESTIMATE_LOST
            detail = f"position known to {sigma_m:.1f} m, velocity to {sigma_mps:.2f} m/s"
            self._notes.add(kind.at(now_ns, detail))
        self._usable = usable
        return usable

    def _sigma(self, states: slice) -> float:
        """[m], [m/s] Give the standard deviation in its worst horizontal direction."""
        assert self._filter is not None  # noqa: S101  (its callers saw it)
        (a, b, _), (_, d, _), _ = self._filter.P[states, states].tolist()
        return math.sqrt(0.5 * (a + d) + math.hypot(0.5 * (a - d), b))
