"""Odometry from a satellite receiver and an inertial measurement unit.

`imu` and `fix` take messages in the order in which they come; `imu` answers with odometry at an
even rate. The messages bring the time. What is wrong with them is a health event, and in the end no
odometry: who needs it sees it go stale.
"""

from __future__ import annotations

from twinscrew.runtime.estimation.chart import Chart
from twinscrew.runtime.estimation.events import ESTIMATE_LOST, HEADING_UNKNOWN, IMU_GAP, Notes
from twinscrew.runtime.estimation.fixes import FixIntake
from twinscrew.runtime.estimation.inertial import InertialFilter
from twinscrew.runtime.estimation.kinematics import rotation
from twinscrew.runtime.estimation.output import OdometryOutput
from twinscrew.runtime.estimation.past import Past
from twinscrew.runtime.estimation.sensors import Carriage, ImuInBody
from twinscrew.runtime.estimation.settings import EstimationSettings
from twinscrew.runtime.estimation.wgs84 import LocalFrame
from twinscrew.runtime.messages.types import (
    NANOSECONDS_PER_SECOND,
    Fix,
    HealthEvent,
    Imu,
    Odometry,
)
from twinscrew.runtime.tracking.light import extended_kalman_filter


class Estimator:
    """One vessel's state, from its sensors' messages."""

    def __init__(self, settings: EstimationSettings | None = None) -> None:
        self._settings = settings = settings or EstimationSettings()
        extended_kalman_filter()  # its import takes 0.2 s: now, and not when the first fix comes
        self.carriage = Carriage(settings.sensors)
        """Where the sensors sit."""
        self._chart = Chart(settings.datum, self.carriage)
        self._notes = Notes()
        self._fixes = FixIntake(settings, self._chart, self.carriage, self._notes)
        self._output = OdometryOutput(settings, self.carriage.imu_B, self._notes)
        self._filter: InertialFilter | None
        self._felt: ImuInBody | None
        self.restart()

    def imu(self, message: Imu) -> Odometry | None:
        """Move on to an IMU message's time; give the odometry there if it is due and usable."""
        felt = self.carriage.in_body(message)
        dt_s = self._follow(felt.stamp_ns)
        if dt_s is None:
            return None
        if self._filter is None:
            self._start(felt)
        else:
            self._move(self._filter, self._felt or felt, felt, dt_s)
            if not self._filter.is_sound:
                self._notes.add(ESTIMATE_LOST.at(felt.stamp_ns, "nonsense: starting anew"))
                self.restart()
        self._felt = felt
        return None if self._filter is None else self._output.step(felt, self._filter)

    def fix(self, message: Fix) -> None:
        """Take in a fix; one from the IMU's future waits for it."""
        if not message.valid:
            return
        self._fixes.add(message)
        if self._filter is not None:
            self._fixes.use(self._filter, self._past)

    def restart(self) -> None:
        """Forget everything but where the local frame is."""
        self._filter = None
        self._felt = None
        self._past = Past()
        self._attitude_ns = 0
        self._fixes.restart()
        self._output.restart()

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
            self.restart()
            return 0.0
        return dt_s

    def _start(self, felt: ImuInBody) -> None:
        """Start from the newest fix, once there are one and an attitude."""
        if felt.attitude is None:
            self._notes.lasting(
                HEADING_UNKNOWN.at(felt.stamp_ns, "orientation_covariance[0] is -1")
            )
            return
        antenna = self._fixes.start(felt.stamp_ns)
        if antenna is None:
            return
        z_N, R = antenna
        imu_N = z_N - rotation(felt.attitude) @ self.carriage.antenna_from_imu_B
        attitude_R = self.carriage.attitude_R(felt)
        self._filter = InertialFilter(self._settings.inertial, imu_N, R, felt.attitude, attitude_R)
        self._attitude_ns = felt.stamp_ns

    def _move(
        self, inertial: InertialFilter, before: ImuInBody, felt: ImuInBody, dt_s: float
    ) -> None:
        """Predict by the mean of two samples of the IMU, then take in what else was measured."""
        inertial.predict(
            0.5 * (before.rates_B + felt.rates_B),
            0.5 * (before.force_B + felt.force_B),
            dt_s,
            rates_psd=None if felt.rates_variance is None else felt.rates_variance * dt_s,
            force_psd=None if felt.force_variance is None else felt.force_variance * dt_s,
        )
        self._past.add(felt.stamp_ns, inertial.x)
        self._use_attitude(felt, inertial)
        self._fixes.use(inertial, self._past)
        self._fixes.watch(felt.stamp_ns, inertial)

    def _use_attitude(self, felt: ImuInBody, inertial: InertialFilter) -> None:
        every_ns = NANOSECONDS_PER_SECOND / self._settings.attitude_hz
        if felt.attitude is None or felt.stamp_ns - self._attitude_ns < every_ns:
            return
        self._attitude_ns = felt.stamp_ns
        before = inertial.x
        inertial.measure_attitude(felt.attitude, self.carriage.attitude_R(felt))
        self._past.correct(inertial.x - before)
