"""When tracks that the LiDAR sees are reported first, and what a track keeps."""

import numpy as np
import pytest

from twinscrew.runtime.tracking.lidar import NO_SEGMENTS, LidarExtras
from twinscrew.runtime.tracking.track import LifeSettings, Track, is_born


def track(hits=1, at_rest=None, confirmed=False):
    """Give a track that was seen so often."""
    one = Track(
        np.array([5.0, 6.0, 0.0, 0.0, 0.0, 0.0]),
        np.eye(6),
        key=(1, 0),
        source="lidar",
        stamp_ns=0,
        first_R=np.eye(2),
        radius=2.0,
        existence=0.5,
        extras=LidarExtras(0, NO_SEGMENTS, at_rest),
    )
    one.hits, one.confirmed = hits, confirmed
    return one


@pytest.mark.parametrize("at_rest", [None, False])
def test_what_may_move_is_born_once_it_was_seen_often_enough(at_rest):
    settings = LifeSettings(birth_hits=3)
    assert [is_born(track(hits, at_rest), settings) for hits in (1, 2, 3)] == [False, False, True]


def test_a_piece_of_what_lies_at_rest_is_born_at_once():
    assert is_born(track(1, at_rest=True), LifeSettings(birth_hits=3))


@pytest.mark.parametrize("at_rest", [None, True])
def test_nothing_is_born_twice(at_rest):
    assert not is_born(track(9, at_rest, confirmed=True), LifeSettings())


def test_a_track_counts_how_long_it_is_known_and_how_long_unseen():
    one = track()
    for _ in range(3):
        one.predicted(0.1, one.x, one.P)
    assert (one.known_s, one.age_s) == pytest.approx((0.3, 0.3))
    one.seen(one.x, one.P, 2.1, LidarExtras(1, NO_SEGMENTS))
    assert (one.hits, one.radius) == (2, 2.1)
    assert (one.known_s, one.age_s) == pytest.approx((0.3, 0.0))


@pytest.mark.parametrize(("seen", "at_rest"), [(True, True), (False, False), (None, False)])
def test_a_track_is_at_rest_as_it_was_last_seen(seen, at_rest):
    one = track(at_rest=not at_rest)
    assert one.at_rest is not at_rest
    one.seen(one.x, one.P, 2.0, LidarExtras(1, NO_SEGMENTS, seen))
    assert one.at_rest is at_rest


def test_a_track_that_was_saved_is_restored_with_all_that_was_known():
    one = track(hits=4)
    one.visible = {"radar": 0.4}
    saved = one.saved()
    one.seen(one.x + 1.0, 2.0 * one.P, 3.0, LidarExtras(9, NO_SEGMENTS, True))
    one.visible = one.visible | {"radar": 0.9}
    again = Track.restored(saved)
    assert (again.hits, again.radius, again.visible) == (4, 2.0, {"radar": 0.4})
    assert again.x[0] == 5.0
