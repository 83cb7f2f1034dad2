"""When tracks are reported first."""

import numpy as np
import pytest
from tests.reference.measurement import observation_matrix

from twinscrew.runtime.tracking.displacement import Sight
from twinscrew.runtime.tracking.life import LifeSettings, is_born
from twinscrew.runtime.tracking.measurement import NO_STRIPS
from twinscrew.runtime.tracking.track import Track

H = observation_matrix(np.array([[0.6, 0.8]]))[0]


def track(hits, stands=None, confirmed=False):
    """Give a track that was seen so often."""
    sight = Sight(0, NO_STRIPS, stands)
    one = Track(np.zeros(2), H, np.eye(2), 2.0, np.ones(6), sight)
    one.hits, one.confirmed = hits, confirmed
    return one


@pytest.mark.parametrize("stands", [None, False])
def test_what_may_move_is_born_once_it_was_seen_often_enough(stands):
    settings = LifeSettings(birth_hits=3)
    assert [is_born(track(hits, stands), settings) for hits in (1, 2, 3)] == [False, False, True]


def test_a_piece_of_what_stands_is_born_at_once():
    assert is_born(track(1, stands=True), LifeSettings(birth_hits=3))


@pytest.mark.parametrize("stands", [None, True])
def test_nothing_is_born_twice(stands):
    assert not is_born(track(9, stands, confirmed=True), LifeSettings())
