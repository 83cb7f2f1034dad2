"""The extended Kalman filter of position, velocity, attitude and the sensors' biases.

filterpy's filter, with the motion model and the measurements of this problem; equations in
docs/estimation.md. No time, no frames on the earth, no messages here: `estimator` has those.

The state x, (15,), is the IMU's position p_N and velocity v_N, the vessel's zyx Euler angles (roll,
pitch, yaw), and the biases of the gyroscopes b_g and of the accelerometers b_a. A vessel does not
pitch by 90 degrees, so that Euler angles are safe.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from twinscrew.runtime.geometry import (
    euler_from_quaternion,
    quaternion_from_euler,
    quaternion_product,
    wrap,
)
from twinscrew.runtime.lean_imports import extended_kalman_filter
from twinscrew.runtime.messages.types import Float64
from twinscrew.runtime.settings import Positive, Settings

STATES = 15
POSITION, VELOCITY, ATTITUDE = slice(0, 3), slice(3, 6), slice(6, 9)
GYRO_BIAS, FORCE_BIAS = slice(9, 12), slice(12, 15)
GRAVITY_MPS2 = 9.81
"""[m/s2] What the accelerometers measure at rest; VRX's gravity. The bias takes up the rest."""
GRAVITY_N = np.array([0.0, 0.0, GRAVITY_MPS2])
_DOWN = np.array([0.0, 0.0, 1.0])
_AHEAD = np.array([1.0, 0.0, 0.0])


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
    """One vessel's state and its covariance."""

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


SIZE = 256
"""[-] States kept: 2.5 s at 100 Hz."""


class StateHistory:
    """The filter's states of the last seconds, for fixes that come late; a ring."""

    def __init__(self) -> None:
        self._x = np.zeros((SIZE, STATES))
        self._stamps_ns = np.zeros(SIZE, dtype=np.int64)
        self._count = 0

    @property
    def newest_ns(self) -> int | None:
        """[ns] The newest state's time; None if there is none."""
        return None if self._count == 0 else int(self._stamps_ns[(self._count - 1) % SIZE])

    def clear(self) -> None:
        """Forget everything."""
        self._count = 0

    def add(self, stamp_ns: int, x: Float64) -> None:
        """Keep a state that is newer than all others."""
        place = self._count % SIZE
        self._x[place], self._stamps_ns[place] = x, stamp_ns
        self._count += 1

    def correct(self, dx: Float64) -> None:
        """Add the filter's correction `dx`, (15,), to all states kept.

        Otherwise the next late fix would be compared with states from before this correction, and
        would make it again.
        """
        self._x += dx

    def at(self, stamp_ns: int) -> Float64 | None:
        """Give the state at a time, (15,); None before the oldest.

        Between two states all but the attitude is interpolated: yaw jumps by a turn at south.
        """
        later: int | None = None
        for place in range(self._count - 1, max(-1, self._count - 1 - SIZE), -1):
            index = place % SIZE
            stamp = int(self._stamps_ns[index])
            if stamp <= stamp_ns:
                if later is None or stamp == stamp_ns:
                    then: Float64 = self._x[index].copy()
                    return then
                f = (stamp_ns - stamp) / (int(self._stamps_ns[later]) - stamp)
                between: Float64 = self._x[index] + f * (self._x[later] - self._x[index])
                between[ATTITUDE] = self._x[index, ATTITUDE]
                return between
            later = index
        return None


def rotation(attitude: Float64) -> Float64:
    """Give R_NB, (3, 3), of roll, pitch, yaw [rad]. Fossen (2021), eq. 2.31."""
    (s_phi, s_the, s_psi), (c_phi, c_the, c_psi) = np.sin(attitude), np.cos(attitude)
    return np.array(
        [
            [
                c_psi * c_the,
                -s_psi * c_phi + c_psi * s_the * s_phi,
                s_psi * s_phi + c_psi * c_phi * s_the,
            ],
            [
                s_psi * c_the,
                c_psi * c_phi + s_phi * s_the * s_psi,
                -c_psi * s_phi + s_the * s_psi * c_phi,
            ],
            [-s_the, c_the * s_phi, c_the * c_phi],
        ]
    )


def turned_by_attitude(attitude: Float64, R_NB: Float64, v_B: Float64) -> Float64:
    """Give the derivative of R_NB v_B by roll, pitch, yaw, (3, 3); v_B is held."""
    phi = float(attitude[0])
    pitch_axis_B = np.array([0.0, math.cos(phi), -math.sin(phi)])
    return np.column_stack(
        [R_NB @ _cross(_AHEAD, v_B), R_NB @ _cross(pitch_axis_B, v_B), _cross(_DOWN, R_NB @ v_B)]
    )


def euler_rates(attitude: Float64) -> Float64:
    """Give T, (3, 3): the angles' rates are T times the body's rates. Fossen (2021), eq. 2.42."""
    phi, theta = float(attitude[0]), float(attitude[1])
    s, c, t, k = math.sin(phi), math.cos(phi), math.tan(theta), 1.0 / math.cos(theta)
    return np.array([[1.0, s * t, c * t], [0.0, c, -s], [0.0, s * k, c * k]])


def euler_rates_by_attitude(attitude: Float64, rates_B: Float64) -> Float64:
    """Give the derivative of T rates_B by roll, pitch, yaw, (3, 3); the rates are held."""
    phi, theta = float(attitude[0]), float(attitude[1])
    _, q, r = rates_B.tolist()
    s, c, t, k = math.sin(phi), math.cos(phi), math.tan(theta), 1.0 / math.cos(theta)
    along, across = s * q + c * r, c * q - s * r
    return np.array(
        [[across * t, along * k * k, 0.0], [-along, 0.0, 0.0], [across * k, along * t * k, 0.0]]
    )


def moved(x: Float64, rates_B: Float64, force_B: Float64, dt: float) -> Float64:
    """Give the state a moment later.

    Parameters
    ----------
    x : (15,) float64
        The state.
    rates_B, force_B : (3,) float64
        What the unit measured over the moment [rad/s], [m/s2], biases included.
    dt : float
        [s]
    """
    attitude = x[ATTITUDE]
    turn = (rates_B - x[GYRO_BIAS]) * dt
    acceleration_N = rotation(_turned(attitude, 0.5 * turn)) @ (force_B - x[FORCE_BIAS]) + GRAVITY_N
    after = x.copy()
    after[POSITION] += (x[VELOCITY] + 0.5 * dt * acceleration_N) * dt
    after[VELOCITY] += acceleration_N * dt
    after[ATTITUDE] = _turned(attitude, turn)
    return after


def transition(x: Float64, rates_B: Float64, force_B: Float64, dt: float) -> Float64:
    """Give F, (15, 15): the derivative of `moved` by the state, to first order in dt."""
    attitude = x[ATTITUDE]
    R_NB = rotation(attitude)
    by_attitude = turned_by_attitude(attitude, R_NB, force_B - x[FORCE_BIAS])
    F = np.eye(STATES)
    F[POSITION, VELOCITY] = dt * np.eye(3)
    F[POSITION, ATTITUDE] = 0.5 * dt * dt * by_attitude
    F[VELOCITY, ATTITUDE] = dt * by_attitude
    F[POSITION, FORCE_BIAS] = -0.5 * dt * dt * R_NB
    F[VELOCITY, FORCE_BIAS] = -dt * R_NB
    F[ATTITUDE, ATTITUDE] += dt * euler_rates_by_attitude(attitude, rates_B - x[GYRO_BIAS])
    F[ATTITUDE, GYRO_BIAS] = -dt * euler_rates(attitude)
    return F


def distance2(y: Float64, S: Float64) -> float:
    """Give the squared Mahalanobis distance y' S^-1 y; infinite where nonsense made S singular."""
    try:
        return float(y @ np.linalg.solve(S, y))
    except np.linalg.LinAlgError:
        return math.inf


def _turned(attitude: Float64, turn_B: Float64) -> Float64:
    """Give roll, pitch, yaw after a turn about a body-fixed axis, (3,) [rad]."""
    angle = math.sqrt(float(turn_B @ turn_B))
    half = 0.5 * angle
    scale = 0.5 if angle < 1e-9 else math.sin(half) / angle
    q = np.array([math.cos(half), *(scale * turn_B)])
    return np.array(
        euler_from_quaternion(quaternion_product(quaternion_from_euler(*attitude.tolist()), q))
    )


def _cross(a: Float64, b: Float64) -> Float64:
    """Give a x b: ten times faster than numpy's for single vectors."""
    a0, a1, a2 = a.tolist()
    b0, b1, b2 = b.tolist()
    return np.array([a1 * b2 - a2 * b1, a2 * b0 - a0 * b2, a0 * b1 - a1 * b0])
