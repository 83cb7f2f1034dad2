"""The motion model against closed forms and difference quotients; the states that are kept."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from twinscrew.runtime.estimation.inertial import (
    ATTITUDE,
    FORCE_BIAS,
    GRAVITY_MPS2,
    GYRO_BIAS,
    POSITION,
    SIZE,
    STATES,
    VELOCITY,
    InertialFilter,
    InertialSettings,
    StateHistory,
    euler_rates,
    euler_rates_by_attitude,
    moved,
    rotation,
    transition,
    turned_by_attitude,
)
from twinscrew.runtime.geometry import quaternion_from_euler, rotation_from_quaternion

TILT = st.floats(-0.6, 0.6)
ATTITUDES = st.builds(lambda *a: np.array(a), TILT, TILT, st.floats(-3.1, 3.1))
VECTORS = st.builds(lambda *a: np.array(a), *[st.floats(-2.0, 2.0)] * 3)
AT_REST_B = np.array([0.0, 0.0, -GRAVITY_MPS2])


def quotient(function, at, step=1e-6):
    """The derivative of a function by a vector, by central differences."""
    columns = []
    for i in range(len(at)):
        ahead, behind = at.copy(), at.copy()
        ahead[i] += step
        behind[i] -= step
        columns.append((function(ahead) - function(behind)) / (2 * step))
    return np.column_stack(columns)


@given(ATTITUDES)
def test_the_rotation_is_that_of_the_quaternion(attitude):
    expected = rotation_from_quaternion(quaternion_from_euler(*attitude))
    np.testing.assert_allclose(rotation(attitude), expected, atol=1e-14)


@given(ATTITUDES, VECTORS)
def test_the_derivative_of_a_turned_vector_is_its_difference_quotient(attitude, v_B):
    expected = quotient(lambda a: rotation(a) @ v_B, attitude)
    found = turned_by_attitude(attitude, rotation(attitude), v_B)
    np.testing.assert_allclose(found, expected, atol=1e-8)


@given(ATTITUDES, VECTORS)
def test_the_derivative_of_the_angles_rates_is_their_difference_quotient(attitude, rates_B):
    expected = quotient(lambda a: euler_rates(a) @ rates_B, attitude)
    np.testing.assert_allclose(euler_rates_by_attitude(attitude, rates_B), expected, atol=1e-7)


@given(ATTITUDES, VECTORS, VECTORS, VECTORS)
def test_the_transition_is_the_models_difference_quotient(attitude, velocity, rates_B, force_B):
    x = np.concatenate([np.zeros(3), velocity, attitude, np.full(3, 0.01), np.full(3, 0.1)])
    dt = 1e-3
    expected = quotient(lambda state: moved(state, rates_B, force_B, dt), x)
    np.testing.assert_allclose(transition(x, rates_B, force_B, dt), expected, atol=2e-5)


def test_a_unit_at_rest_stays_at_rest_whatever_its_attitude():
    x = np.zeros(STATES)
    x[ATTITUDE] = 0.2, -0.1, 2.0
    force_B = rotation(x[ATTITUDE]).T @ AT_REST_B
    for _ in range(1000):
        x = moved(x, np.zeros(3), force_B, 0.01)
    np.testing.assert_allclose(x[:6], 0.0, atol=1e-9)
    np.testing.assert_allclose(x[ATTITUDE], (0.2, -0.1, 2.0), atol=1e-12)


def test_a_steady_turn_is_a_circle():
    """Speed u, yaw rate r: radius u / r, and back where it began after 2 pi / r."""
    u, r, steps = 2.0, 0.5, 2000
    dt = 2 * np.pi / r / steps
    x = np.zeros(STATES)
    x[VELOCITY] = u, 0.0, 0.0
    ways = []
    for _ in range(steps):
        x = moved(x, np.array([0.0, 0.0, r]), np.array([0.0, u * r, 0.0]) + AT_REST_B, dt)
        ways.append(x[POSITION].copy())
    assert max(p[1] for p in ways) == pytest.approx(2 * u / r, abs=1e-3)
    np.testing.assert_allclose(ways[-1], 0.0, atol=1e-4)
    np.testing.assert_allclose(x[VELOCITY], (u, 0.0, 0.0), atol=1e-5)


def test_biases_are_taken_out_of_what_the_unit_measured():
    x = np.zeros(STATES)
    x[GYRO_BIAS], x[FORCE_BIAS] = (0.01, -0.02, 0.03), (0.1, 0.2, -0.3)
    after = moved(x, x[GYRO_BIAS], x[FORCE_BIAS] + AT_REST_B, 0.5)
    np.testing.assert_allclose(after, x, atol=1e-12)


def test_the_uncertainty_is_that_of_the_worst_direction_in_the_plane():
    R = np.diag([1.0, 4.0, 100.0])
    turn = np.array([[0.8, -0.6, 0.0], [0.6, 0.8, 0.0], [0.0, 0.0, 1.0]])
    settings = InertialSettings(first_speed_mps=0.3)
    one = InertialFilter(settings, np.zeros(3), np.eye(3), np.zeros(3), 1e-4 * np.eye(3))
    one.place(np.zeros(3), turn @ R @ turn.T)
    assert np.isclose(one.horizontal_sigma(slice(0, 3)), 2.0)
    assert np.isclose(one.horizontal_sigma(slice(3, 6)), 0.3)


def filled(count: int) -> StateHistory:
    history = StateHistory()
    for k in range(count):
        history.add(100 * k, np.full(STATES, float(k)))
    return history


def test_without_states_there_is_none():
    assert StateHistory().at(5) is None
    assert StateHistory().newest_ns is None


def test_between_two_states_all_but_the_attitude_is_interpolated():
    x = filled(10).at(425)
    np.testing.assert_allclose(np.delete(x, range(6, 9)), 4.25)
    np.testing.assert_array_equal(x[ATTITUDE], 4.0)


def test_after_the_newest_it_is_the_newest_and_before_the_oldest_none():
    history = filled(SIZE + 10)
    assert history.newest_ns == 100 * (SIZE + 9)
    np.testing.assert_array_equal(history.at(10**9), SIZE + 9)
    np.testing.assert_array_equal(history.at(1000), 10)
    assert history.at(999) is None


def test_a_correction_holds_for_the_history_too():
    history = filled(10)
    history.correct(np.full(STATES, 0.5))
    np.testing.assert_array_equal(history.at(300), 3.5)


def test_what_is_given_is_a_copy():
    history = filled(10)
    history.at(300)[:] = -1.0
    np.testing.assert_array_equal(history.at(300), 3.0)


def test_after_clearing_the_ring_begins_anew():
    history = filled(SIZE + 10)
    history.clear()
    assert history.at(10**9) is None
    history.add(7, np.zeros(STATES))
    np.testing.assert_array_equal(history.at(8), 0.0)
    assert history.at(6) is None
