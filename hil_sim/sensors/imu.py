"""An inertial measurement unit: rates, specific force and attitude, with noise and biases.

Noise as VRX's: white, a bias that is drawn once, and one that wanders (first-order Gauss-Markov).
VRX's attitude has no noise; a real one has.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.random import Generator

from twinscrew.hil_sim.vessel.state import VesselState
from twinscrew.runtime.estimation.kinematics import GRAVITY_N
from twinscrew.runtime.estimation.sensors import SensorSettings
from twinscrew.runtime.geometry.frames import (
    flu_to_frd,
    quaternion_from_euler,
    quaternion_product,
    rotation_from_quaternion,
)
from twinscrew.runtime.messages.types import Float64, Imu
from twinscrew.runtime.settings import NonNegative, Positive, Settings


class TriadSettings(Settings, frozen=True, kw_only=True):
    """The errors of three sensors of one kind."""

    sigma: NonNegative
    """White noise of a sample."""
    bias_mean: NonNegative
    """A bias is drawn once for each axis: this,"""
    bias_sigma: NonNegative
    """with this standard deviation, with either sign."""
    wander_sigma: NonNegative
    """Standard deviation of a bias that wanders,"""
    wander_time_s: Positive
    """[s] with this time constant."""


class ImuSettings(Settings, frozen=True, kw_only=True):
    """VRX 2.3.2's unit (wamv_imu.xacro), but for the errors of the attitude."""

    rate_hz: Positive = 100.0
    """[Hz]"""
    gyro: TriadSettings = TriadSettings(
        sigma=0.009, bias_mean=0.00075, bias_sigma=0.005, wander_sigma=0.00002, wander_time_s=400.0
    )
    """[rad/s]"""
    force: TriadSettings = TriadSettings(
        sigma=0.021, bias_mean=0.05, bias_sigma=0.0075, wander_sigma=0.000375, wander_time_s=175.0
    )
    """[m/s2]"""
    tilt_sigma_rad: NonNegative = 0.01
    """[rad] White noise of roll and pitch: half a degree (our choice; VRX: none)."""
    heading_sigma_rad: NonNegative = 0.02
    """[rad] White noise of the heading: a degree (our choice; VRX: none)."""
    heading_offset_rad: float = 0.0
    """[rad] What a compass is off by, clockwise."""


class Triad:
    """Three sensors along the axes."""

    def __init__(self, settings: TriadSettings, rng: Generator) -> None:
        self._settings = settings
        self._rng = rng
        sign = rng.choice([-1.0, 1.0], 3)
        self._fixed = sign * rng.normal(settings.bias_mean, settings.bias_sigma, 3)
        self._wander = np.zeros(3)

    @property
    def bias(self) -> Float64:
        """The present bias, (3,)."""
        return self._fixed + self._wander

    def measure(self, truth: Float64, dt_s: float) -> Float64:
        """Give what they tell of the truth, (3,), `dt_s` [s] after the last time."""
        s = self._settings
        keep = math.exp(-dt_s / s.wander_time_s)
        kick = s.wander_sigma * math.sqrt(1.0 - keep * keep)
        self._wander = keep * self._wander + kick * self._rng.standard_normal(3)
        return truth + self.bias + s.sigma * self._rng.standard_normal(3)


class SimulatedImu:
    """One vessel's unit; `sense` is called after every step of the world that it measures."""

    def __init__(
        self,
        settings: ImuSettings,
        place: SensorSettings,
        state: VesselState,
        vessel: int,
        rng: Generator,
    ) -> None:
        self._settings = settings
        self._vessel = vessel
        self._rng = rng
        mount = place.imu
        self._imu_B = flu_to_frd(np.array([mount.x_m, mount.y_m, mount.z_m]))
        self._q_BI = quaternion_from_euler(mount.roll_rad, -mount.pitch_rad, -mount.yaw_rad)
        self._R_IB = rotation_from_quaternion(self._q_BI).T
        self.gyro, self.force = Triad(settings.gyro, rng), Triad(settings.force, rng)
        self._v_N = self._velocity_N(state)

    def sense(self, state: VesselState, stamp_ns: int, dt_s: float) -> Imu:
        """Give the unit's message; the acceleration is the mean over the last `dt_s` [s]."""
        settings, q_NB = self._settings, state.q_NB[self._vessel]
        before_N, self._v_N = self._v_N, self._velocity_N(state)
        force_N = (self._v_N - before_N) / dt_s - GRAVITY_N
        force_B = rotation_from_quaternion(q_NB).T @ force_N
        rates_B = state.rates_B[self._vessel]
        tilt, heading = settings.tilt_sigma_rad, settings.heading_sigma_rad
        variance = np.array([tilt**2, tilt**2, heading**2])
        return Imu(
            stamp_ns=stamp_ns,
            rates_I=self.gyro.measure(self._R_IB @ rates_B, dt_s),
            force_I=self.force.measure(self._R_IB @ force_B, dt_s),
            q_NI=quaternion_product(self._measured_attitude(q_NB, variance), self._q_BI),
            attitude_variance=variance if variance.all() else None,
        )

    def _measured_attitude(self, q_NB: Float64, variance: Float64) -> Float64:
        roll, pitch, yaw = (np.sqrt(variance) * self._rng.standard_normal(3)).tolist()
        north = quaternion_from_euler(0.0, 0.0, yaw + self._settings.heading_offset_rad)
        tilt = quaternion_from_euler(roll, pitch, 0.0)
        return quaternion_product(quaternion_product(north, q_NB), tilt)

    def _velocity_N(self, state: VesselState) -> Float64:
        """Give the velocity of the place where the unit sits, (3,) [m/s]."""
        i = self._vessel
        v_B = state.velocity_B[i] + np.cross(state.rates_B[i], self._imu_B)
        velocity: Float64 = rotation_from_quaternion(state.q_NB[i]) @ v_B
        return velocity
