"""Joint association: probabilities of pairs, and how well pairs fit."""

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from twinscrew.runtime._native import association_marginals, mixtures, pair_fits, shadowed
from twinscrew.runtime.tracking.kalman import STATES, FilterBank

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


def mixed_one_by_one(x, P, z, H, R, R_rad2, origin, shares):
    """The mixtures, by filterpy's filter and in plain numpy."""
    bank, means, spreads = FilterBank(), [], []
    for k in range(len(x)):
        parts = [(1.0 - shares[k].sum(), x[k], P[k])]
        grown = R_rad2 * ((x[k, :2] - origin) ** 2).sum()
        for m in np.flatnonzero(shares[k]):
            noise = R[m] + grown[m] * np.eye(len(z[m]))
            found = bank.update(x[k][None], P[k][None], z[m][None], H[m][None], noise[None])
            parts.append((shares[k, m], found[0][0], found[1][0]))
        mean = sum(w * x_part for w, x_part, _ in parts)
        means.append(mean)
        spreads.append(
            sum(
                w * (P_part + np.outer(x_part - mean, x_part - mean)) for w, x_part, P_part in parts
            )
        )
    return np.array(means), np.array(spreads)


@given(st.integers(0, 10_000), st.integers(1, 4), st.integers(1, 4), st.sampled_from([1, 2]))
def test_a_mixture_has_the_mean_and_the_covariance_of_its_parts(seed, tracks, detections, d):
    rng = np.random.default_rng(seed)
    root = rng.standard_normal((tracks, 6, 6))
    P, x = root @ root.transpose(0, 2, 1) + np.eye(6), rng.standard_normal((tracks, 6))
    z, H = rng.standard_normal((detections, d)), rng.standard_normal((detections, d, 6))
    noise = rng.standard_normal((detections, d, d))
    R, R_rad2 = noise @ noise.transpose(0, 2, 1) + np.eye(d), rng.random(detections)
    shares = rng.dirichlet(np.ones(detections + 1), tracks)[:, 1:]
    shares[rng.random(shares.shape) < 0.3] = 0.0
    look = z, H, R, R_rad2, (3.0, -2.0), shares
    found = mixtures(x, P, *look)
    mean, spread = mixed_one_by_one(x, P, *look)
    np.testing.assert_allclose(found[:, :STATES], mean, rtol=1e-8, atol=1e-10)
    np.testing.assert_allclose(found[:, STATES:].reshape(-1, 6, 6), spread, rtol=1e-8, atol=1e-10)


@given(st.integers(0, 10_000), st.integers(0, 6))
def test_what_lies_behind_something_that_hides_is_in_its_shadow(seed, count):
    rng = np.random.default_rng(seed)
    offsets, hides = rng.normal(0.0, 30.0, (count, 2)), rng.random(count) < 0.6
    distance, bearing = np.hypot(*offsets.T), np.arctan2(offsets[:, 1], offsets[:, 0])
    expected = []
    for k in range(count):
        turn = bearing - bearing[k]
        behind = hides & (distance[k] > distance + 3.0) & (np.cos(turn) > 0.0)
        expected.append(bool((behind & (np.abs(np.sin(turn)) * distance < 10.0)).any()))
    assert shadowed(offsets, hides, 10.0).tolist() == expected
