"""Which measurement belongs to which track."""

import itertools

import numpy as np
import pytest
from tests.reference.measurement import observation_matrix

from twinscrew.runtime._native import innovations
from twinscrew.runtime.tracking.association import associate
from twinscrew.runtime.tracking.lidar import NO_SEGMENTS, LidarExtras, Measurements


def tracks(*p_N, variance=0.1):
    x = np.zeros((len(p_N), 6))
    x[:, :2] = np.array(p_N).reshape(-1, 2)
    return x, np.tile(np.diag([variance, variance, 1, 1, 0.01, 0.01]), (len(p_N), 1, 1))


def measured(*z_N, gate=0.0):
    count = len(z_N)
    return Measurements(
        z_N=np.array(z_N, dtype=float).reshape(-1, 2),
        H=observation_matrix(np.tile([1.0, 0.0], (count, 1))),
        R=np.tile(0.01 * np.eye(2), (count, 1, 1)),
        radius=np.ones(count),
        gate=np.full(count, gate),
        extras=[LidarExtras(0, NO_SEGMENTS)] * count,
    )


def paired(found):
    return [pair[:2] for pair in found.pairs]


def test_each_track_gets_what_is_near_it():
    found = associate(*tracks((0, 0), (5, 5)), measured((5.1, 5.0), (0.1, 0.0)), 3.0)
    assert paired(found) == [(0, 1), (1, 0)]
    assert (found.unseen, found.new) == ([], [])


def test_what_is_far_from_all_starts_a_new_track():
    found = associate(*tracks((0, 0)), measured((9.0, 0.0)), 3.0)
    assert (paired(found), found.unseen, found.new) == ([], [0], [0])


def test_the_best_for_all_is_not_the_best_for_each():
    # The first track is nearest to the measurement that is the second's only one.
    found = associate(*tracks((0.0, 0), (0.9, 0)), measured((0.4, 0.0), (-0.7, 0.0)), 3.0)
    assert paired(found) == [(0, 1), (1, 0)]


@pytest.mark.parametrize(("count_x", "count_z"), [(0, 2), (2, 0), (0, 0)])
def test_nothing_on_either_side_is_no_error(count_x, count_z):
    found = associate(*tracks(*[(k, k) for k in range(count_x)]), measured(*[(1, 1)] * count_z), 3)
    assert paired(found) == []
    assert (found.unseen, found.new) == (list(range(count_x)), list(range(count_z)))


def test_a_vague_track_does_not_steal_from_a_sure_one():
    x, P = tracks((0.0, 0.0), (0.35, 0.0))
    P[1, :2, :2] *= 100.0
    assert paired(associate(x, P, measured((0.3, 0.0)), 3.0)) == [(0, 0)]


def test_the_gate_allows_for_a_jump_of_the_visible_side():
    assert paired(associate(*tracks((0, 0)), measured((2.0, 0.0)), 3.0)) == []
    assert paired(associate(*tracks((0, 0)), measured((2.0, 0.0), gate=1.0), 3.0)) == [(0, 0)]


def test_distances_are_those_of_the_textbook():
    rng = np.random.default_rng(0)
    x, P = tracks((0, 0), (1, 2), (3, 1))
    P = P + np.array([a @ a.T for a in rng.normal(size=(3, 6, 6))])
    z = measured((0.5, 0.5), (2.0, 2.0), gate=0.2)
    strict2, distance2, log_det = innovations(x, P, z.z_N, z.H, z.R, z.gate, 1e6)
    for k, m in itertools.product(range(3), range(2)):
        S = z.H[m] @ P[k] @ z.H[m].T + z.R[m]
        y = z.z_N[m] - z.H[m] @ x[k]
        assert strict2[k, m] == pytest.approx(y @ np.linalg.solve(S, y))
        S = S + z.gate[m] * np.eye(2)
        assert distance2[k, m] == pytest.approx(y @ np.linalg.solve(S, y))
        assert log_det[k, m] == pytest.approx(np.linalg.slogdet(S)[1])


def test_arrays_that_disagree_are_refused():
    x, P = tracks((0, 0), (1, 2))
    z = measured((0.5, 0.5), (2.0, 2.0))
    with pytest.raises(ValueError, match="of each"):
        innovations(x, P[:1].copy(), z.z_N, z.H, z.R, z.gate, 1e6)
    with pytest.raises(ValueError, match="of each"):
        innovations(x, P, z.z_N, z.H, z.R, z.gate[:1].copy(), 1e6)
