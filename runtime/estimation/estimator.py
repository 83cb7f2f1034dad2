"""Odometry from a satellite receiver and an inertial measurement unit (IMU).

`Estimator.imu` and `Estimator.fix` take messages in the order in which they come; `imu` returns
odometry at an even rate. Time comes with the messages. What is wrong with them is a health event;
if it lasts, there is no odometry, and whoever needs it sees it go stale.
"""

from __future__ import annotations

import math
from collections import deque
from typing import Final

import numpy as np

from twinscrew.runtime.datum import Datum, LocalFrame, Place
from twinscrew.runtime.estimation.inertial import (
    ATTITUDE,
    GYRO_BIAS,
    POSITION,
    VELOCITY,
    InertialFilter,
    InertialSettings,
    StateHistory,
    rotation,
)
from twinscrew.runtime.estimation.sensors import ImuSample, SensorPlacement, SensorSettings
from twinscrew.runtime.geometry import quaternion_from_euler
from twinscrew.runtime.lean_imports import extended_kalman_filter
from twinscrew.runtime.messages.types import (
    NANOSECONDS_PER_SECOND,
    Fix,
    Float64,
    HealthEvent,
    Imu,
    Odometry,
)
from twinscrew.runtime.safety.events import (
    ESTIMATE_LOST,
    ESTIMATE_READY,
    GPS_BACK,
    GPS_DISAGREES,
    GPS_LOST,
    HEADING_UNKNOWN,
    IMU_GAP,
    EventKind,
)
from twinscrew.runtime.settings import Positive, Settings

REMIND_NS: Final = NANOSECONDS_PER_SECOND
"""[ns] How often an event of something that lasts is repeated."""
WAITING_FIXES = 16
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


class EventLog:
    """Events since the last `take`."""

    def __init__(self) -> None:
        self._events: list[HealthEvent] = []
        self._last_ns: dict[str, int] = {}

    def add(self, event: HealthEvent) -> None:
        """Add an event."""
        self._events.append(event)

    def add_lasting(self, event: HealthEvent) -> None:
        """Add an event of something that lasts: when it begins, and every second."""
        last_ns = self._last_ns.get(event.name)
        if last_ns is None or not 0 <= event.stamp_ns - last_ns < REMIND_NS:
            self._last_ns[event.name] = event.stamp_ns
            self._events.append(event)

    def end(self, kind: EventKind) -> None:
        """Note that something that lasted has ended."""
        self._last_ns.pop(kind.name, None)

    def take(self) -> tuple[HealthEvent, ...]:
        """Return what was added since the last call."""
        events, self._events = tuple(self._events), []
        return events


class FixQueue:
    """Takes fixes into the filter, each at its own time; reports those that disagree or miss."""

    def __init__(
        self, settings: EstimationSettings, placement: SensorPlacement, events: EventLog
    ) -> None:
        self._settings, self._placement, self._events = settings, placement, events
        self._arm_B = placement.antenna_from_imu_B
        self.frame: LocalFrame | None = None
        """The local frame: its origin is the datum, or where the first fix was."""
        self.restart()

    def restart(self) -> None:
        """Forget all fixes."""
        self._waiting: deque[Fix] = deque(maxlen=WAITING_FIXES)
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
        return self._antenna_N(fixes[-1])

    def use(self, inertial: InertialFilter, history: StateHistory) -> None:
        """Take in the fixes whose time the filter has reached."""
        now_ns = history.newest_ns
        if now_ns is None:
            return
        for _ in range(len(self._waiting)):
            fix = self._waiting.popleft()
            if fix.stamp_ns > now_ns:
                self._waiting.append(fix)
            else:
                self._use(fix, inertial, history)

    def watch(self, now_ns: int, inertial: InertialFilter) -> None:
        """Report when no fix has been used for too long, and when one is again."""
        age_s = (now_ns - self._used_ns) / NANOSECONDS_PER_SECOND
        lost = age_s > self._settings.gps_lost_s
        if lost:
            sigma_m = inertial.horizontal_sigma(POSITION)
            detail = f"for {age_s:.1f} s; the position is known to {sigma_m:.1f} m"
            self._events.add_lasting(GPS_LOST.at(now_ns, detail))
        elif self._coasts:
            self._events.end(GPS_LOST)
            self._events.add(GPS_BACK.at(now_ns))
        self._coasts = lost

    def _use(self, fix: Fix, inertial: InertialFilter, history: StateHistory) -> None:
        then = history.at(fix.stamp_ns)
        if then is None:
            return
        z_N, R = self._antenna_N(fix)
        before = inertial.x
        if inertial.measure_position(z_N, R, self._arm_B, then):
            history.correct(inertial.x - before)
            self._used_ns, self._refused_ns = max(self._used_ns, fix.stamp_ns), None
            return
        self._refused_ns = self._refused_ns or fix.stamp_ns
        refused_s = (fix.stamp_ns - self._refused_ns) / NANOSECONDS_PER_SECOND
        if refused_s >= self._settings.gps_disagrees_s:
            off_N = z_N - then[POSITION] - rotation(then[ATTITUDE]) @ self._arm_B
            detail = f"{math.hypot(*off_N[:2]):.1f} m off"
            self._events.add(GPS_DISAGREES.at(fix.stamp_ns, detail))
            inertial.place(z_N - rotation(inertial.x[ATTITUDE]) @ self._arm_B, R)
            history.clear()
            self._used_ns, self._refused_ns = fix.stamp_ns, None

    def _antenna_N(self, fix: Fix) -> tuple[Float64, Float64]:
        """Give the antenna's position, (3,) [m], and its covariance; without an altitude at 0."""
        frame = self.frame = self.frame or self._first_frame(fix)
        has_altitude = math.isfinite(fix.altitude_m)
        place = Place(
            latitude_deg=fix.latitude_deg,
            longitude_deg=fix.longitude_deg,
            altitude_m=fix.altitude_m if has_altitude else frame.origin.altitude_m,
        )
        return frame.position_N(place), self._placement.position_R(fix)

    def _first_frame(self, fix: Fix) -> LocalFrame:
        """Begin at the datum or the fix; down counts from where the vessel floats now."""
        altitude_m = fix.altitude_m if math.isfinite(fix.altitude_m) else 0.0
        origin = self._settings.datum or fix
        return LocalFrame(
            Place(
                latitude_deg=origin.latitude_deg,
                longitude_deg=origin.longitude_deg,
                altitude_m=altitude_m + float(self._placement.antenna_B[2]),
            )
        )


class Estimator:
    """One vessel's state, from its sensors' messages."""

    def __init__(self, settings: EstimationSettings | None = None) -> None:
        self._settings = settings = settings or EstimationSettings()
        extended_kalman_filter()  # its import takes 0.2 s: now, and not when the first fix comes
        self.placement = SensorPlacement(settings.sensors)
        """Where the sensors sit."""
        self._events = EventLog()
        self._fixes = FixQueue(settings, self.placement, self._events)
        self._period_ns = round(NANOSECONDS_PER_SECOND / settings.rate_hz)
        self.inertial: InertialFilter | None
        """The filter; None before the first fix and attitude."""
        self._last: ImuSample | None
        self.restart()

    def imu(self, message: Imu) -> Odometry | None:
        """Move on to an IMU message's time; give the odometry there if it is due and usable."""
        sample = self.placement.sample(message)
        dt_s = self._step_s(sample.stamp_ns)
        if dt_s is None:
            return None
        if self.inertial is None:
            self._start(sample)
        else:
            self._move(self.inertial, self._last or sample, sample, dt_s)
            if not self.inertial.is_sound:
                self._events.add(ESTIMATE_LOST.at(sample.stamp_ns, "nonsense: starting anew"))
                self.restart()
        self._last = sample
        return None if self.inertial is None else self._odometry(self.inertial, sample)

    def fix(self, message: Fix) -> None:
        """Take in a fix; one from the IMU's future waits for it."""
        if message.valid:
            self._fixes.add(message)
            if self.inertial is not None:
                self._fixes.use(self.inertial, self._history)

    def restart(self) -> None:
        """Forget everything but where the local frame is."""
        self.inertial = None
        self._last = None
        self._history = StateHistory()
        self._attitude_ns = 0
        self._slot: int | None = None
        self._usable = False
        self._fixes.restart()

    def take_events(self) -> tuple[HealthEvent, ...]:
        """Return what an operator should know, since the last call."""
        return self._events.take()

    @property
    def frame(self) -> LocalFrame | None:
        """The local frame; None before the first fix."""
        return self._fixes.frame

    def _step_s(self, stamp_ns: int) -> float | None:
        """[s] Give the time since the last IMU message; None if this one is no newer."""
        if self._last is None:
            return 0.0
        dt_s = (stamp_ns - self._last.stamp_ns) / NANOSECONDS_PER_SECOND
        if -self._settings.imu_gap_s <= dt_s <= 0.0:
            return None
        if not 0.0 < dt_s <= self._settings.imu_gap_s:
            if self.inertial is not None:
                self._events.add(IMU_GAP.at(stamp_ns, f"{dt_s:.2f} s after the last message"))
            self.restart()
            return 0.0
        return dt_s

    def _start(self, sample: ImuSample) -> None:
        """Start from the newest fix, once there are one and an attitude."""
        if sample.attitude is None:
            detail = "orientation_covariance[0] is -1"
            self._events.add_lasting(HEADING_UNKNOWN.at(sample.stamp_ns, detail))
            return
        antenna = self._fixes.start(sample.stamp_ns)
        if antenna is None:
            return
        z_N, R = antenna
        imu_N = z_N - rotation(sample.attitude) @ self.placement.antenna_from_imu_B
        attitude_R = self.placement.attitude_R(sample)
        self.inertial = InertialFilter(
            self._settings.inertial, imu_N, R, sample.attitude, attitude_R
        )
        self._attitude_ns = sample.stamp_ns

    def _move(
        self, inertial: InertialFilter, before: ImuSample, sample: ImuSample, dt_s: float
    ) -> None:
        """Predict by the mean of two samples of the IMU, then take in what else was measured."""
        inertial.predict(
            0.5 * (before.rates_B + sample.rates_B),
            0.5 * (before.force_B + sample.force_B),
            dt_s,
            rates_psd=None if sample.rates_variance is None else sample.rates_variance * dt_s,
            force_psd=None if sample.force_variance is None else sample.force_variance * dt_s,
        )
        self._history.add(sample.stamp_ns, inertial.x)
        every_ns = NANOSECONDS_PER_SECOND / self._settings.attitude_hz
        if sample.attitude is not None and sample.stamp_ns - self._attitude_ns >= every_ns:
            self._attitude_ns = sample.stamp_ns
            state = inertial.x
            inertial.measure_attitude(sample.attitude, self.placement.attitude_R(sample))
            self._history.correct(inertial.x - state)
        self._fixes.use(inertial, self._history)
        self._fixes.watch(sample.stamp_ns, inertial)

    def _odometry(self, inertial: InertialFilter, sample: ImuSample) -> Odometry | None:
        """Give the odometry at a sample's time if it is due and usable."""
        # Multiples of the period, not steps from the start: those of a LiDAR on the same clock.
        slot = sample.stamp_ns // self._period_ns
        if slot == self._slot:
            return None
        self._slot = slot
        sigma_m, sigma_mps = (inertial.horizontal_sigma(part) for part in (POSITION, VELOCITY))
        usable = (
            sigma_m < self._settings.usable_sigma_m and sigma_mps < self._settings.usable_sigma_mps
        )
        if usable != self._usable:
            self._usable = usable
            kind = ESTIMATE_READY if usable else ESTIMATE_LOST
            detail = f"position known to {sigma_m:.1f} m, velocity to {sigma_mps:.2f} m/s"
            self._events.add(kind.at(sample.stamp_ns, detail))
        return odometry(sample, inertial.x, self.placement.imu_B) if usable else None


def odometry(sample: ImuSample, x: Float64, imu_B: Float64) -> Odometry:
    """Give the odometry of the vessel's origin by the state of its IMU.

    Parameters
    ----------
    sample
        What the IMU measured at the time.
    x : (15,) float64
        The state, see `inertial` for its layout.
    imu_B : (3,) float64
        The IMU from the vessel's origin [m], frame B.
    """
    R_NB = rotation(x[ATTITUDE])
    rates_B = sample.rates_B - x[GYRO_BIAS]
    return Odometry(
        stamp_ns=sample.stamp_ns,
        position_N=x[POSITION] - R_NB @ imu_B,
        q_NB=quaternion_from_euler(*x[ATTITUDE].tolist()),
        velocity_B=R_NB.T @ x[VELOCITY] - np.cross(rates_B, imu_B),
        rates_B=rates_B,
    )
