"""When odometry is given, whether it is good enough to be, and how it follows from the state."""

from __future__ import annotations

import numpy as np

from twinscrew.runtime.estimation.events import ESTIMATE_LOST, ESTIMATE_READY, Notes
from twinscrew.runtime.estimation.inertial import InertialFilter
from twinscrew.runtime.estimation.kinematics import (
    ATTITUDE,
    GYRO_BIAS,
    POSITION,
    VELOCITY,
    rotation,
)
from twinscrew.runtime.estimation.sensors import ImuInBody
from twinscrew.runtime.estimation.settings import EstimationSettings
from twinscrew.runtime.geometry.frames import quaternion_from_euler
from twinscrew.runtime.messages.types import NANOSECONDS_PER_SECOND, Float64, Odometry


def odometry(felt: ImuInBody, x: Float64, imu_B: Float64) -> Odometry:
    """Give the odometry of the vessel's origin by the state of its IMU.

    Parameters
    ----------
    felt
        What the IMU measured at the time.
    x : (15,) float64
        The state, see `kinematics` for its layout.
    imu_B : (3,) float64
        The IMU from the vessel's origin [m], frame B.
    """
    R_NB = rotation(x[ATTITUDE])
    rates_B = felt.rates_B - x[GYRO_BIAS]
    return Odometry(
        stamp_ns=felt.stamp_ns,
        position_N=x[POSITION] - R_NB @ imu_B,
        q_NB=quaternion_from_euler(*x[ATTITUDE].tolist()),
        velocity_B=R_NB.T @ x[VELOCITY] - np.cross(rates_B, imu_B),
        rates_B=rates_B,
    )


class OdometryOutput:
    """Gives odometry at an even rate, while position and velocity are known well enough."""

    def __init__(self, settings: EstimationSettings, imu_B: Float64, notes: Notes) -> None:
        self._settings, self._imu_B, self._notes = settings, imu_B, notes
        self._period_ns = round(NANOSECONDS_PER_SECOND / settings.rate_hz)
        self.restart()

    def restart(self) -> None:
        """Forget what was given."""
        self._slot: int | None = None
        self._usable = False

    def step(self, felt: ImuInBody, inertial: InertialFilter) -> Odometry | None:
        """Give the odometry at the time of an IMU's message if it is due and usable."""
        # Multiples of the period, not steps from the start: those of a LiDAR on the same clock.
        slot = felt.stamp_ns // self._period_ns
        if slot == self._slot:
            return None
        self._slot = slot
        if not self._is_usable(felt.stamp_ns, inertial):
            return None
        return odometry(felt, inertial.x, self._imu_B)

    def _is_usable(self, now_ns: int, inertial: InertialFilter) -> bool:
        settings = self._settings
        sigma_m, sigma_mps = (inertial.horizontal_sigma(part) for part in (POSITION, VELOCITY))
        usable = sigma_m < settings.usable_sigma_m and sigma_mps < settings.usable_sigma_mps
        if usable != self._usable:
            kind = ESTIMATE_READY if usable else ESTIMATE_LOST
            detail = f"position known to {sigma_m:.1f} m, velocity to {sigma_mps:.2f} m/s"
            self._notes.add(kind.at(now_ns, detail))
        self._usable = usable
        return usable
