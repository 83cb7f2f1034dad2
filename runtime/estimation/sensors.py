"""Where the receiver's antenna and the IMU sit, and how good they are where they do not say."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from twinscrew.runtime.geometry import (
    euler_from_quaternion,
    flu_to_frd,
    quaternion_from_euler,
    quaternion_product,
    rotation_from_quaternion,
)
from twinscrew.runtime.messages.types import Fix, Float64, Imu
from twinscrew.runtime.perception.sensor import Mount
from twinscrew.runtime.settings import Positive, Settings


class AntennaSettings(Settings, frozen=True):
    """Where the antenna sits, from the vessel's origin; VRX's WAM-V."""

    x_m: float = -0.85
    """[m] Forward."""
    y_m: float = 0.0
    """[m] To port."""
    z_m: float = 1.3
    """[m] Up."""


class SensorSettings(Settings, frozen=True):
    """Where antenna and IMU sit, VRX's WAM-V, and their errors where their messages give none."""

    antenna: AntennaSettings = AntennaSettings()
    imu: Mount = Mount(x_m=0.3, y_m=-0.2, z_m=1.3)
    """The IMU's place and how it is turned, as the LiDAR's mount."""
    horizontal_sigma_m: Positive = 1.0
    """[m] Standard deviation of a fix north and east."""
    vertical_sigma_m: Positive = 2.0
    """[m] The same of its altitude."""
    least_sigma_m: Positive = 0.01
    """[m] A receiver that claims to be better is not believed."""
    tilt_sigma_rad: Positive = 0.01
    """[rad] Standard deviation of the IMU's roll and pitch."""
    heading_sigma_rad: Positive = 0.02
    """[rad] The same of its heading."""


@dataclass(frozen=True, slots=True)
class ImuSample:
    """An IMU's message in the vessel's axes; None is what the IMU does not measure."""

    stamp_ns: int
    """[ns]"""
    rates_B: Float64
    """[rad/s] (3,)"""
    force_B: Float64
    """[m/s2] (3,) Specific force at the IMU."""
    attitude: Float64 | None
    """[rad] (3,) The vessel's roll, pitch, yaw."""
    attitude_variance: Float64 | None
    """[rad2] (3,)"""
    rates_variance: float | None
    """[rad2/s2] Mean over the axes."""
    force_variance: float | None
    """[m2/s4] Mean over the axes."""


class SensorPlacement:
    """The sensors on the vessel."""

    def __init__(self, settings: SensorSettings) -> None:
        self._settings = settings
        mount, antenna = settings.imu, settings.antenna
        # Roll is the same about x of FLU and of FRD; pitch and yaw turn the other way.
        q_BI = quaternion_from_euler(mount.roll_rad, -mount.pitch_rad, -mount.yaw_rad)
        self._R_BI = rotation_from_quaternion(q_BI)
        self._q_IB = q_BI * np.array([1.0, -1.0, -1.0, -1.0])
        self.imu_B = flu_to_frd(np.array([mount.x_m, mount.y_m, mount.z_m]))
        """[m] (3,) The IMU from the vessel's origin."""
        self.antenna_B = flu_to_frd(np.array([antenna.x_m, antenna.y_m, antenna.z_m]))
        """[m] (3,) The antenna from the vessel's origin."""
        self.antenna_from_imu_B = self.antenna_B - self.imu_B
        """[m] (3,) The antenna from the IMU."""

    def sample(self, imu: Imu) -> ImuSample:
        """Turn an IMU's message into the vessel's axes."""
        attitude = None
        if imu.q_NI is not None:
            attitude = np.array(euler_from_quaternion(quaternion_product(imu.q_NI, self._q_IB)))
        rates, force = imu.rates_variance, imu.force_variance
        return ImuSample(
            stamp_ns=imu.stamp_ns,
            rates_B=self._R_BI @ imu.rates_I,
            force_B=self._R_BI @ imu.force_I,
            attitude=attitude,
            attitude_variance=imu.attitude_variance,
            rates_variance=None if rates is None else float(rates.mean()),
            force_variance=None if force is None else float(force.mean()),
        )

    def attitude_R(self, sample: ImuSample) -> Float64:
        """Give the covariance of an attitude, (3, 3) [rad2]: the message's, or the settings'."""
        if sample.attitude_variance is not None:
            return np.diag(sample.attitude_variance)
        tilt, heading = self._settings.tilt_sigma_rad, self._settings.heading_sigma_rad
        return np.diag([tilt**2, tilt**2, heading**2])

    def position_R(self, fix: Fix) -> Float64:
        """Give the covariance of a fix, (3, 3) [m2]: the message's, or the settings'."""
        if fix.covariance_N is not None:
            return fix.covariance_N + self._settings.least_sigma_m**2 * np.eye(3)
        across, up = self._settings.horizontal_sigma_m, self._settings.vertical_sigma_m
        return np.diag([across**2, across**2, up**2])
