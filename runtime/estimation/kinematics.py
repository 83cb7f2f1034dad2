"""How an inertial measurement unit moves: the filter's motion model and its derivatives.

The state x, (15,), is the unit's position p_N and velocity v_N, the vessel's zyx Euler angles
(roll, pitch, yaw), and the biases of the gyroscopes b_g and of the accelerometers b_a. A vessel
does not pitch by 90 degrees, so that Euler angles are safe. Equations: docs/estimation.md.
"""

from __future__ import annotations

import math

import numpy as np

from twinscrew.runtime.geometry.frames import (
    euler_from_quaternion,
    quaternion_from_euler,
    quaternion_product,
)
from twinscrew.runtime.messages.types import Float64

STATES = 15
POSITION, VELOCITY, ATTITUDE = slice(0, 3), slice(3, 6), slice(6, 9)
GYRO_BIAS, FORCE_BIAS = slice(9, 12), slice(12, 15)
GRAVITY_MPS2 = 9.81
"""[m/s2] What the accelerometers feel at rest; VRX's gravity. The bias takes up the difference."""
GRAVITY_N = np.array([0.0, 0.0, GRAVITY_MPS2])
_DOWN = np.array([0.0, 0.0, 1.0])
_AHEAD = np.array([1.0, 0.0, 0.0])


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
