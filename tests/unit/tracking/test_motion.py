"""The filter's model: what it must be between any two times."""

import math

import numpy as np
import pytest

from twinscrew.runtime.tracking.kalman import (
    add_bias_noise,
    add_slide_noise,
    motion_noise,
    transition,
)

BIAS = np.array([[0.04, 0.09]])
"""[m2] Along and across."""


def bias_noise(dt):
    Q = np.zeros((1, 6, 6))
    add_bias_noise(Q, dt, 2.0, BIAS)
    return Q[0]


def noise(dt):
    return motion_noise(dt, 0.7) + bias_noise(dt)


def test_a_velocity_moves_the_position_and_nothing_else():
    x = transition(0.5, 2.0) @ np.array([1.0, 2.0, 3.0, -4.0, 0.0, 0.0])
    assert x.tolist() == [2.5, 0.0, 3.0, -4.0, 0.0, 0.0]


def test_the_bias_is_forgotten_with_its_time_constant():
    x = transition(2.0, 2.0) @ np.array([0, 0, 0, 0, 1.0, 1.0])
    assert x[4:] == pytest.approx(2 * [math.exp(-1.0)])


def test_two_short_steps_are_one_long_step():
    a, b = 0.3, 0.8
    F_b = transition(b, 2.0)
    assert F_b @ transition(a, 2.0) == pytest.approx(transition(a + b, 2.0))
    assert F_b @ noise(a) @ F_b.T + noise(b) == pytest.approx(noise(a + b))


def test_the_bias_keeps_its_variance():
    F, P = transition(0.4, 2.0), np.diag([0, 0, 0, 0, 0.04, 0.09])
    assert (F @ P @ F.T + bias_noise(0.4))[4:, 4:] == pytest.approx(P[4:, 4:])


def test_no_time_brings_no_noise():
    assert not noise(0.0).any()


def test_the_noise_is_a_covariance():
    Q = noise(0.1)
    assert np.array_equal(Q, Q.T)
    assert np.linalg.eigvalsh(Q).min() > 0.0


def test_what_slides_may_be_elsewhere_and_nothing_else():
    Q = np.zeros((2, 6, 6))
    add_slide_noise(Q, 0.5, np.array([0.0, 3.0]))
    assert not Q[0].any()
    assert np.array_equal(Q[1], np.diag([2.25, 2.25, 0.0, 0.0, 0.0, 0.0]))
