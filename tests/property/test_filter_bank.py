"""Tracks filtered together are what each is filtered alone, by filterpy as it comes."""

import numpy as np
import pytest
from filterpy.kalman import KalmanFilter
from hypothesis import given
from hypothesis import strategies as st

from twinscrew.runtime._native import invert_stack
from twinscrew.runtime.tracking.kalman import STATES, FilterBank, MatrixStack, transition
from twinscrew.runtime.tracking.lidar_motion import MEASURED


def spd(rng, count, size):
    """Draw symmetric positive definite matrices whose scales differ by many decades."""
    root = rng.normal(size=(count, size, size))
    scale = 10.0 ** rng.uniform(-2.0, 2.0, (count, size, 1))
    return scale * (root @ root.transpose(0, 2, 1) + 0.1 * np.eye(size)) * scale.transpose(0, 2, 1)


def alone(x, P, F, Q, z, H, R):
    one = KalmanFilter(dim_x=STATES, dim_z=MEASURED)
    one.x, one.P = x, P
    one.predict(F=F, Q=Q)
    one.update(z, R=R, H=H)
    return one.x, one.P


@given(st.integers(1, 12), st.integers(0, 1 << 20))
def test_tracks_filtered_together_are_what_they_are_alone(count, seed):
    rng, bank = np.random.default_rng(seed), FilterBank()
    x, z = rng.normal(size=(count, STATES)), rng.normal(size=(count, MEASURED))
    P, Q, R = (spd(rng, count, size) for size in (STATES, STATES, MEASURED))
    H = rng.normal(size=(count, MEASURED, STATES)) * (rng.random((count, MEASURED, 1)) < 0.8)
    F = transition(0.1, 1.0)
    for _ in range(2):  # the second time on the first's memory
        after, spread = bank.update(*bank.predict(x, P, F, Q), z, H, R)
        for k in range(count):
            x_k, P_k = alone(x[k], P[k], F, Q[k], z[k], H[k], R[k])
            size = np.sqrt(np.diagonal(P_k))
            assert np.abs(after[k] - x_k) / size == pytest.approx(0.0, abs=1e-7)
            assert spread[k] / np.outer(size, size) == pytest.approx(
                P_k / np.outer(size, size), abs=1e-7
            )


def test_a_track_of_which_nothing_was_measured_stays_as_it_is():
    rng, bank = np.random.default_rng(0), FilterBank()
    x, P = rng.normal(size=(3, STATES)), spd(rng, 3, STATES)
    z, H, R = np.zeros((3, MEASURED)), np.zeros((3, MEASURED, STATES)), spd(rng, 3, MEASURED)
    after, spread = bank.update(x, P, z, H, R)
    assert np.array_equal(after, x)
    assert spread == pytest.approx(P, rel=1e-12)


def test_no_tracks_are_no_error():
    x, P = np.empty((0, STATES)), np.empty((0, STATES, STATES))
    after, spread = FilterBank().predict(x, P, np.eye(STATES), P)
    assert (after.shape, spread.shape) == (x.shape, P.shape)


@given(st.integers(1, 8), st.integers(0, 4), st.integers(0, 1 << 20))
def test_stacks_are_inverted_as_numpy_does(size, count, seed):
    matrices = spd(np.random.default_rng(seed), count, size)
    for inverse, matrix in zip(invert_stack(matrices), matrices, strict=True):
        condition = np.linalg.cond(matrix)
        assert inverse @ matrix == pytest.approx(np.eye(size), abs=1e-14 * condition + 1e-12)


@pytest.mark.parametrize("shape", [(4, 4, 6), (2, 9, 9), (3, 0, 0)])
def test_what_is_no_stack_of_small_squares_is_refused(shape):
    with pytest.raises(ValueError, match="square matrices of at most 8 rows"):
        invert_stack(np.ones(shape))


def test_a_stack_is_multiplied_and_transposed_matrix_by_matrix():
    rng = np.random.default_rng(0)
    a, b, one = rng.normal(size=(3, 4, 6)), rng.normal(size=(3, 5, 6)), rng.normal(size=(6, 2))
    product = np.dot(MatrixStack(a), MatrixStack(b).T)
    assert product.values.shape == (3, 4, 5)
    for k in range(3):
        assert product.values[k] == pytest.approx(a[k] @ b[k].T)
        assert np.dot(MatrixStack(a), one).values[k] == pytest.approx(a[k] @ one)


def test_no_other_function_of_numpy_takes_a_stack_for_an_array():
    with pytest.raises(TypeError, match="no implementation found"):
        np.concatenate([MatrixStack(np.zeros((1, 2, 2)))])
