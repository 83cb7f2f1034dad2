"""Centroids and velocities taken in: jumps are charged to the bias, bad velocities trusted less."""

import numpy as np
import pytest
from tests.reference.measurement import observation_matrix

from twinscrew.runtime.tracking.kalman import FilterBank, first_covariance
from twinscrew.runtime.tracking.lidar_motion import (
    MeasuredVelocity,
    corrected,
    inflated_noise,
    jumps_to_bias,
)

H = observation_matrix(np.array([[0.6, 0.8]]))
R = np.array([np.diag([0.01, 0.02])])
PRIOR = np.array([0.0, 0.0, 4.0, 4.0, 0.09, 0.04])
BANK = FilterBank()
FIRST = np.array([[5.0, 6.0, 0.0, 0.0, 0.0, 0.0]]), first_covariance(H[0], R[0], PRIOR)[None]
MOVED = np.eye(6)
MOVED[0, 2] = MOVED[1, 3] = 0.1


def update(state, z, excess=-1.0, velocity=None, limit_sigma=1e9):
    x, P = state
    measured = np.array([z], dtype=float), H, R
    return corrected(BANK, x, P, measured, np.array([excess]), [velocity], limit_sigma)


def innovation(state, z):
    x, P = state
    return z - H[0] @ x[0], H[0] @ P[0] @ H[0].T + R[0]


def distance2(state, z):
    y, S = innovation(state, z)
    return float(y @ np.linalg.solve(S, y))


def settled():
    state = FIRST
    for _ in range(20):
        state = BANK.predict(*state, MOVED, np.zeros((1, 6, 6)))
        state = update(state, H[0] @ np.array([5, 6, 0, 0, 0, 0.0]))
    return state


def test_a_small_innovation_is_left_to_the_filter():
    P = jumps_to_bias(FIRST[1], H, R, np.array([-0.5]))
    assert P is FIRST[1]


def test_a_jump_goes_to_the_bias_and_not_to_the_velocity():
    state, z = settled(), H[0] @ np.array([5, 6, 0, 0, 0, 0.0]) + np.array([1.5, 0.0])
    jumping, _ = update(state, z, excess=distance2(state, z) / 2.0**2 - 1.0)
    plain, _ = update(state, z)
    assert np.hypot(*jumping[0, 2:4]) < 0.7 * np.hypot(*plain[0, 2:4])
    assert np.hypot(*jumping[0, 4:]) > 2 * np.hypot(*plain[0, 4:])


def test_the_excess_brings_the_innovation_to_the_limit():
    z = np.array([9.0, 6.0])
    excess = np.array([distance2(FIRST, z) / 2.0**2 - 1.0])
    charged = FIRST[0], jumps_to_bias(FIRST[1], H, R, excess)
    assert distance2(charged, z) == pytest.approx(2.0**2)


def test_only_what_jumped_is_charged():
    P = np.concatenate([FIRST[1], FIRST[1]])
    charged = jumps_to_bias(P, np.tile(H, (2, 1, 1)), np.tile(R, (2, 1, 1)), np.array([-0.5, 3.0]))
    assert np.array_equal(charged[0], P[0])
    assert charged[1, 4, 4] > 2 * P[1, 4, 4]


def test_covariances_stay_symmetric_and_positive():
    state, rng = FIRST, np.random.default_rng(0)
    for _ in range(200):
        state = BANK.predict(*state, np.eye(6), 1e-3 * np.eye(6)[None])
        state = update(state, np.array([5.0, 6.0]) + rng.normal(size=2), excess=rng.normal())
    P = state[1][0]
    assert np.allclose(P, P.T)
    assert np.linalg.eigvalsh(P).min() > 0.0


def velocity(north, variance=0.01):
    return MeasuredVelocity(np.array([north, 0.0]), variance * np.eye(2))


def test_without_a_velocity_the_rows_for_it_say_nothing():
    x, P = update(FIRST, np.array([5.1, 6.0]))
    y, S = innovation(FIRST, np.array([5.1, 6.0]))
    K = FIRST[1][0] @ H[0].T @ np.linalg.inv(S)
    assert x[0] == pytest.approx(FIRST[0][0] + K @ y)
    assert P[0] == pytest.approx(FIRST[1][0] - K @ S @ K.T)


def test_a_velocity_is_taken_in_as_if_it_were_measured_alone():
    x, P = update(FIRST, np.array([5.1, 6.0]), velocity=velocity(1.0))
    first, spread = update(FIRST, np.array([5.1, 6.0]))
    y, S = np.array([1.0, 0.0]) - first[0, 2:4], spread[0, 2:4, 2:4] + 0.01 * np.eye(2)
    K = spread[0][:, 2:4] @ np.linalg.inv(S)
    assert x[0] == pytest.approx(first[0] + K @ y, abs=1e-9)
    assert P[0] == pytest.approx(spread[0] - K @ S @ K.T, abs=1e-9)


def doubt(speed, variance, P, limit=2.0):
    v = velocity(speed, variance)
    return inflated_noise(v.v_N[None], v.R[None], np.zeros((1, 6)), P[None], limit)[0]


def test_a_likely_velocity_is_not_doubted():
    assert np.array_equal(doubt(3.0, 0.01, np.diag(PRIOR)), 0.01 * np.eye(2))


def test_a_velocity_is_doubted_until_it_lies_on_the_limit():
    P = np.diag([0, 0, 0.03, 0.03, 0, 0])
    R_raised = doubt(1.0, 0.01, P)
    assert 1.0**2 / (P[2, 2] + R_raised[0, 0]) == pytest.approx(2.0**2)


def test_a_velocity_that_is_told_again_and_again_is_believed():
    state = FIRST
    for speed, times in ((0.0, 20), (3.0, 30)):
        for _ in range(times):
            noise = 0.1 * np.diag([0, 0, 0.5, 0.5, 0, 0])
            state = BANK.predict(*state, np.eye(6), noise[None])
            z = H[0] @ state[0][0]
            state = update(state, z, velocity=velocity(speed, 0.02), limit_sigma=2.0)
    assert state[0][0, 2] == pytest.approx(3.0, abs=0.1)
