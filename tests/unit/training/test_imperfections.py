"""Each imperfection does what it says, and nothing else."""

from __future__ import annotations

import numpy as np
import pytest

from twinscrew.training.imperfections import Imperfections, ImperfectionSettings, merge, split

SHAPE = (40, 5, 8)


def seen_by_all() -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    p = np.full(SHAPE, 8 + 1j, np.complex64)
    return p, np.full(SHAPE, 1j, np.complex64), np.ones(SHAPE, np.float32), np.ones(SHAPE, bool)


def imperfect(**values: float) -> Imperfections:
    streams = [np.random.default_rng(k) for k in range(SHAPE[0])]
    return Imperfections(ImperfectionSettings(**values), streams, SHAPE[1:], period_s=0.5)


def test_nothing_is_imperfect_by_default() -> None:
    assert not ImperfectionSettings().used


def test_a_perceived_velocity_lags_by_its_time_constant() -> None:
    model = imperfect(velocity_lag_s=1.0)
    for _ in range(3):
        velocity = model.lagged(np.ones((SHAPE[0], SHAPE[2]), complex))
    assert velocity == pytest.approx(1.0 - np.exp(-1.5))


def test_objects_are_lost_as_often_and_as_long_as_stated() -> None:
    model = imperfect(lost_rate_hz=0.5, lost_time_s=2.0)
    shares, changes, lost = [], 0, 0
    before = np.zeros(SHAPE, bool)
    for _ in range(200):
        gone = ~model.distort(*seen_by_all())[3]
        shares.append(gone.mean())
        changes += int((before & ~gone).sum())
        lost += int(before.sum())
        before = gone
    lose, find = 1 - np.exp(-0.25), 1 - np.exp(-0.25)
    assert np.mean(shares[20:]) == pytest.approx(lose / (lose + find), abs=0.01)
    assert changes / lost == pytest.approx(find, abs=0.01)


def test_drift_has_its_deviation_and_lasts() -> None:
    model = imperfect(drift_position_m=0.3, drift_time_s=2.0)
    errors = np.array([model.distort(*seen_by_all())[0] - (8 + 1j) for _ in range(200)])[40:]
    assert errors.real.std() == pytest.approx(0.3, rel=0.05)
    lag = (errors[1:] * errors[:-1].conj()).real.mean() / (np.abs(errors) ** 2).mean()
    assert lag == pytest.approx(np.exp(-0.25), abs=0.03)


def test_two_near_objects_melt_into_the_circle_around_both_and_far_ones_do_not() -> None:
    p = np.array([[0, 3, 20]], np.complex64)
    v = np.array([[1, 3, 5]], np.complex64)
    radius, seen = np.ones((1, 3), np.float32), np.ones((1, 3), bool)
    q, w, r, visible = merge(p, v, radius, seen, 1.5)
    assert visible.tolist() == [[True, False, True]]
    assert q[0, 0] == pytest.approx(1.5)
    assert r[0].tolist() == [2.5, 1.0, 1.0]
    assert w[0, 0] == 2
    assert merge(p, v, radius, seen, 0.5)[3].all()


def test_a_small_object_within_a_large_one_disappears_in_it() -> None:
    p, radius = np.array([[0, 0.5]], np.complex64), np.array([[0.2, 3.0]], np.float32)
    q, _, r, visible = merge(p, p, radius, np.ones((1, 2), bool), 0.1)
    assert visible.tolist() == [[True, False]]
    assert q[0, 0] == pytest.approx(0.5)
    assert r[0, 0] == 3.0


def test_a_split_object_becomes_two_halves_on_either_side_of_its_place() -> None:
    p, v, radius, seen = seen_by_all()
    uniform = np.random.default_rng(0).random(SHAPE, dtype=np.float32)
    q, _, r, visible = split(p, v, radius, seen, uniform, 0.3)
    halved = visible[..., -1]
    assert halved.mean() == pytest.approx(0.3, abs=0.1)
    assert (visible[..., :-1].sum(axis=-1) == SHAPE[2]).all()
    moved = np.argwhere(q[..., :-1] != p)
    assert len(moved) == halved.sum()
    for e, k, o in moved:
        assert (q[e, k, o] + q[e, k, -1]) / 2 == pytest.approx(p[e, k, o], abs=1e-5)
        assert abs(q[e, k, o] - q[e, k, -1]) == pytest.approx(1.0, abs=1e-5)
        assert r[e, k, o] == r[e, k, -1] == 0.5
