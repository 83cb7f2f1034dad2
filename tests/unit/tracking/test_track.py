"""One track: how it begins, and what it keeps."""

import numpy as np
import pytest
from tests.reference.measurement import observation_matrix

from twinscrew.runtime.tracking.displacement import Sight
from twinscrew.runtime.tracking.measurement import NO_STRIPS
from twinscrew.runtime.tracking.track import Track, first_covariance

H = observation_matrix(np.array([[0.6, 0.8]]))[0]
R = np.diag([0.01, 0.02])
PRIOR = np.array([0.0, 0.0, 4.0, 4.0, 0.09, 0.04])


def test_the_first_covariance_is_the_limit_of_a_vague_prior():
    P = np.diag([1e9, 1e9, *PRIOR[2:]])
    K = P @ H.T @ np.linalg.inv(H @ P @ H.T + R)
    updated = (np.eye(6) - K @ H) @ P
    assert first_covariance(H, R, PRIOR) == pytest.approx(updated, abs=1e-4)


def test_a_track_counts_how_long_it_is_known_and_how_long_unseen():
    sight = Sight(0, NO_STRIPS)
    track = Track(np.array([5.0, 6.0]), H, R, 2.0, PRIOR, sight)
    for _ in range(3):
        track.moved_on(0.1, track.x, track.P)
    assert (track.known_s, track.age_s) == pytest.approx((0.3, 0.3))
    track.seen(track.x, track.P, 2.1, sight)
    assert (track.hits, track.scans, track.radius) == (2, 4, 2.1)
    assert (track.known_s, track.age_s) == pytest.approx((0.3, 0.0))


@pytest.mark.parametrize(("told", "stands"), [(True, True), (False, False), (None, False)])
def test_a_track_stands_as_it_was_last_seen(told, stands):
    track = Track(np.array([5.0, 6.0]), H, R, 2.0, PRIOR, Sight(0, NO_STRIPS, not stands))
    assert track.stands is not stands
    track.seen(track.x, track.P, 2.0, Sight(1, NO_STRIPS, told))
    assert track.stands is stands
