"""Joint association: probabilities of pairs, and how well pairs fit."""

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from twinscrew.runtime._native import association_marginals, pair_fits

weights = st.lists(st.floats(0.01, 100.0), min_size=1, max_size=5)


def enumerated(w):
    """Sum over all ways in which no detection has two tracks and no track two detections."""
    tracks, detections = w.shape
    total, marginal = 0.0, np.zeros_like(w)
    for event in itertools.product(range(-1, detections), repeat=tracks):
        used = [m for m in event if m >= 0]
        if len(used) != len(set(used)):
            continue
        chance = np.prod([w[k, m] if m >= 0 else 1.0 for k, m in enumerate(event)])
        total += chance
        for k, m in enumerate(event):
            if m >= 0:
                marginal[k, m] += chance
    return marginal / total


@given(weights)
def test_one_track_shares_itself_among_its_detections(row):
    w = np.array([row])
    np.testing.assert_allclose(association_marginals(w), w / (1.0 + w.sum()), rtol=1e-9)


@given(weights)
def test_one_detection_shares_itself_among_its_tracks(column):
    w = np.array([column]).T
    np.testing.assert_allclose(association_marginals(w), enumerated(w), rtol=1e-6)


def test_a_chain_of_tracks_and_detections_is_exact():
    w = np.array([[2.0, 1.0, 0.0], [0.0, 3.0, 0.5], [0.0, 0.0, 4.0]])
    np.testing.assert_allclose(association_marginals(w), enumerated(w), rtol=1e-6)


@given(st.integers(0, 10_000), st.integers(2, 4), st.integers(2, 4))
def test_loops_are_nearly_exact_and_never_give_a_detection_away_twice(seed, tracks, detections):
    w = np.random.default_rng(seed).gamma(0.5, 5.0, (tracks, detections))
    found = association_marginals(w)
    assert (found.sum(axis=0) <= 1.0 + 1e-6).all()
    assert (found.sum(axis=1) <= 1.0).all()
    assert np.abs(found - enumerated(w)).max() < 0.12


def look(z, H, R, R_rad2=0.0):
    return np.array([z]), np.array([H]), np.array([R]), np.array([R_rad2])


def test_the_fit_of_a_position_is_its_normal_density():
    rng = np.random.default_rng(1)
    A = rng.standard_normal((6, 6))
    P, x, H = A @ A.T + np.eye(6), rng.standard_normal(6), np.eye(2, 6)
    z, R = np.array([1.0, -2.0]), np.diag([0.5, 0.7])
    distance2, density = pair_fits(x[None], P[None], *look(z, H, R), (0.0, 0.0), 10.0)
    y, S = z - H @ x, H @ P @ H.T + R
    assert distance2[0, 0] == pytest.approx(y @ np.linalg.solve(S, y))
    expected = np.exp(-0.5 * distance2[0, 0]) / (2 * np.pi * np.sqrt(np.linalg.det(S)))
    assert density[0, 0] == pytest.approx(expected)


def test_a_bearing_fits_what_lies_ahead_and_not_what_lies_behind():
    H = np.zeros((1, 6))
    H[0, 1] = 1.0  # bearing 0: north
    x = np.zeros((2, 6))
    x[:, 0] = [50.0, -50.0]
    P = np.tile(np.eye(6), (2, 1, 1))
    distance2, density = pair_fits(x, P, *look([0.0], H, [[1.0]]), (0.0, 0.0), 4.0)
    assert density[0, 0] > 0.0
    assert density[1, 0] == 0.0
    assert np.isinf(distance2[1, 0])


def test_the_noise_of_a_bearing_grows_with_the_range():
    H = np.zeros((1, 6))
    H[0, 1] = 1.0
    x = np.zeros((2, 6))
    x[:, 0], x[:, 1] = [10.0, 100.0], 3.0
    P = np.tile(1e-6 * np.eye(6), (2, 1, 1))
    distance2, _ = pair_fits(x, P, *look([0.0], H, [[0.0]], 0.1**2), (0.0, 0.0), 10.0)
    np.testing.assert_allclose(
        distance2[:, 0], 9.0 / (0.01 * (x[:, :2] ** 2).sum(axis=1)), rtol=1e-2
    )
