"""The extended Kalman filter of position, velocity, attitude and the sensors' biases.

filterpy's filter, with the motion model and the measurements of this problem; equations in
docs/estimation.md. No time, no frames on the earth, no messages here: `estimator` has those.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from twinscrew.runtime.estimation.kinematics import (
    ATTITUDE,
    FORCE_BIAS,
    GYRO_BIAS,
    POSITION,
    STATES,
    VELOCITY,
    moved,
    rotation,
    transition,
    turned_by_attitude,
)
from twinscrew.runtime.geometry.angles import wrap
from twinscrew.runtime.messages.types import Float64
from twinscrew.runtime.settings import Positive, Settings
from twinscrew.runtime.tracking.light import extended_kalman_filter


class InertialSettings(Settings, frozen=True):
    """How good the inertial measurement unit is, and what is known at the start."""

    gyro_noise: Positive = 1e-3
    """[rad/s/sqrt(Hz)] White noise of the gyroscopes (VRX: 0.009 rad/s at 100 Hz), where the
    messages tell none."""
    force_noise: Positive = 3e-3
    """[m/s2/sqrt(Hz)] The same of the accelerometers (VRX: 0.021 m/s2 at 100 Hz), and of what
    changes between two samples."""
    gyro_drift: Positive = 2e-5
    """[rad/s2/sqrt(Hz)] How the gyroscopes' biases wander."""
    force_drift: Positive = 4e-4
    """[m/s3/sqrt(Hz)] How the accelerometers' biases wander."""
    first_speed_mps: Positive = 2.0
    """[m/s] Standard deviation of each component of the velocity at the start."""
    first_gyro_bias_radps: Positive = 0.01
    """[rad/s] The same of the gyroscopes' biases."""
    first_force_bias_mps2: Positive = 0.1
    """[m/s2] The same of the accelerometers' biases."""
    gate_sigma: Positive = 4.5
    """[-] Measurements farther from what is expected than this Mahalanobis distance are not used:
    of good ones, one in ten thousand."""


class InertialFilter:
    """One vessel's state, see `kinematics` for its layout, and its covariance."""

    def __init__(
        self,
        settings: InertialSettings,
        position_N: Float64,
        position_R: Float64,
        attitude: Float64,
        attitude_R: Float64,
    ) -> None:
        """Start from the unit's position [m] and attitude [rad], and their covariances (3, 3)."""
        self._settings = settings
        self._filter: Any = extended_kalman_filter()(dim_x=STATES, dim_z=3)
        self._filter.x = np.zeros(STATES)
        self._filter.x[ATTITUDE] = attitude
        self._filter.P = np.zeros((STATES, STATES))
        self._filter.P[ATTITUDE, ATTITUDE] = attitude_R
        self._filter.P[GYRO_BIAS, GYRO_BIAS] = settings.first_gyro_bias_radps**2 * np.eye(3)
        self._filter.P[FORCE_BIAS, FORCE_BIAS] = settings.first_force_bias_mps2**2 * np.eye(3)
        self.place(position_N, position_R)

    @property
    def x(self) -> Float64:
        """The state, (15,)."""
        state: Float64 = self._filter.x
        return state

    @property
    def P(self) -> Float64:
        """Its covariance, (15, 15)."""
        covariance: Float64 = self._filter.P
        return covariance

    @property
    def is_sound(self) -> bool:
        """Whether its numbers are numbers, and its variances positive."""
        variances = self.P.diagonal()
        return bool(np.isfinite(self.x).all() and (variances > 0.0).all())

    def horizontal_sigma(self, states: slice) -> float:
        """Give the standard deviation of position [m] or velocity [m/s] in its worst direction."""
        (a, b, _), (_, d, _), _ = self.P[states, states].tolist()
        return math.sqrt(0.5 * (a + d) + math.hypot(0.5 * (a - d), b))

    def place(self, position_N: Float64, position_R: Float64) -> None:
        """Start anew from a position, at an unknown speed; attitude and biases are kept."""
        x, P = self._filter.x, self._filter.P
        x[POSITION], x[VELOCITY] = position_N, 0.0
        P[:6, :], P[:, :6] = 0.0, 0.0
        P[POSITION, POSITION] = position_R
        P[VELOCITY, VELOCITY] = self._settings.first_speed_mps**2 * np.eye(3)

    def predict(
        self,
        rates_B: Float64,
        force_B: Float64,
        dt: float,
        *,
        rates_psd: float | None = None,
        force_psd: float | None = None,
    ) -> None:
        """Move on by `dt` [s] under what the unit measured [rad/s], [m/s2].

        `rates_psd` and `force_psd` are the densities of the white noise, [rad2/s], [m2/s3]; None
        for those of the settings.
        """
        s = self._settings
        Q = np.zeros(STATES)
        Q[VELOCITY] = s.force_noise**2 if force_psd is None else force_psd
        Q[ATTITUDE] = s.gyro_noise**2 if rates_psd is None else rates_psd
        Q[GYRO_BIAS], Q[FORCE_BIAS] = s.gyro_drift**2, s.force_drift**2
        ekf = self._filter
        ekf.F, ekf.Q = transition(ekf.x, rates_B, force_B, dt), np.diag(Q * dt)
        ekf.predict_x = lambda _: None  # not linear: the state is moved by the model itself
        after = moved(ekf.x, rates_B, force_B, dt)
        ekf.predict()
        ekf.x = after

    def measure_position(
        self, z_N: Float64, R: Float64, arm_B: Float64, x_then: Float64 | None = None
    ) -> bool:
        """Take in the position of the antenna, (3,) [m], which sits `arm_B` [m] from the unit.

        `x_then` is the state at the time of the fix, if that has passed. Gives False if the fix
        lies outside the gate.
        """
        then = self.x if x_then is None else x_then
        R_NB = rotation(then[ATTITUDE])
        H = np.zeros((3, STATES))
        H[:, POSITION] = np.eye(3)
        H[:, ATTITUDE] = turned_by_attitude(then[ATTITUDE], R_NB, arm_B)
        return self._update(z_N - then[POSITION] - R_NB @ arm_B, H, R)

    def measure_attitude(self, attitude: Float64, R: Float64) -> bool:
        """Take in roll, pitch, yaw, (3,) [rad]; False if they lie outside the gate."""
        H = np.zeros((3, STATES))
        H[:, ATTITUDE] = np.eye(3)
        return self._update(wrap(attitude - self.x[ATTITUDE]), H, R)

    def _update(self, y: Float64, H: Float64, R: Float64) -> bool:
        S = H @ self.P @ H.T + R
        # Not 0 or more: a covariance that cannot be one, or numbers that are not finite.
        if not 0.0 <= distance2(y, S) <= self._settings.gate_sigma**2:
            return False
        # The innovation is made here, because a fix is compared with the state at its own time.
        self._filter.update(y, lambda _: H, lambda _: 0.0, R=R)
        P = self._filter.P
        self._filter.P = 0.5 * (P + P.T)
        return True


def distance2(y: Float64, S: Float64) -> float:
    """Give the squared Mahalanobis distance y' S^-1 y; infinite where nonsense made S singular."""
    try:
        return float(y @ np.linalg.solve(S, y))
    except np.linalg.LinAlgError:
        return math.inf
