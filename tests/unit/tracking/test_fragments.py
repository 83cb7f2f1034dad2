"""Pieces of one hull become one object; two objects stay two."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from twinscrew.runtime._native import crowded
from twinscrew.runtime.messages.types import Objects, Strips
from twinscrew.runtime.tracking.lidar import join_fragments


def objects(*rows):
    table = np.array(rows, dtype=float).reshape(-1, 4)
    return Objects(
        stamp_ns=7, p_L=table[:, :2], radius=table[:, 2], points=table[:, 3].astype(np.int64)
    )


def join_told(seen, stands, *circles):
    table = np.array(circles, dtype=float).reshape(-1, 3)
    return join_fragments(seen, stands, table[:, :2], table[:, 2])


def join(seen, *circles):
    return join_told(seen, [None] * len(seen.radius), *circles)[0]


def test_pieces_within_one_circle_are_joined_by_their_points():
    whole = join(objects((10, -1, 0.5, 300), (10, 1, 0.6, 100)), (10, 0, 2.5))
    assert whole.p_L == pytest.approx(np.array([[10.0, -0.5]]))
    assert whole.points.tolist() == [400]
    assert whole.stamp_ns == 7


def test_the_joined_circle_holds_the_pieces_circles():
    whole = join(objects((10, -1, 0.5, 300), (10, 1, 0.6, 100)), (10, 0, 2.5))
    assert whole.radius[0] == pytest.approx(1.5 + 0.6)


def test_what_lies_outside_stays_as_it_is():
    whole = join(objects((10, -1, 0.5, 30), (10, 1, 0.6, 30), (3, 3, 0.7, 50)), (10, 0, 2.5))
    assert len(whole.p_L) == 2
    assert whole.p_L[1].tolist() == [3.0, 3.0]
    assert (whole.radius[1], whole.points[1]) == (0.7, 50)


def test_one_object_a_circle_is_left_alone():
    seen = objects((10, 0, 2.0, 300), (3, 3, 0.7, 50))
    assert join(seen, (10, 0, 2.5), (3, 3, 1.0)) is seen


def test_nothing_known_joins_nothing():
    seen = objects((10, -1, 0.5, 300), (10, 1, 0.6, 100))
    assert join(seen) is seen


def test_a_piece_belongs_to_the_older_track_only():
    seen = objects((10, 0, 0.5, 100), (11, 0, 0.5, 100), (12, 0, 0.5, 100))
    whole = join(seen, (10.4, 0, 1.0), (11.6, 0, 1.0))
    assert len(whole.p_L) == 2
    assert whole.points.tolist() == [200, 100]


def test_pieces_of_what_stands_remain_apart():
    seen = objects((10, -1, 0.5, 30), (10, 0, 0.5, 40), (10, 1, 0.6, 50), (3, 3, 0.7, 60))
    whole, stands = join_told(seen, [True, False, True, None], (10, 0, 2.5))
    assert whole.points.tolist() == [30, 40, 50, 60]
    assert list(stands) == [True, False, True, None]


def test_what_moves_beside_what_stands_is_joined_without_it():
    seen = objects((10, -1, 0.5, 30), (10, 0, 0.5, 40), (10, 1, 0.6, 50), (3, 3, 0.7, 60))
    whole, stands = join_told(seen, [False, True, None, True], (10, 0, 2.5))
    assert whole.points.tolist() == [30 + 50, 40, 60]
    assert list(stands) == [None, True, True]


def test_what_is_told_stays_with_those_that_are_not_joined():
    seen = objects((3, 3, 0.7, 60), (10, -1, 0.5, 30), (-4, 0, 0.5, 40), (10, 1, 0.6, 50))
    whole, stands = join_told(seen, [True, False, False, False], (10, 0, 2.5))
    assert whole.points.tolist() == [80, 60, 40]
    assert list(stands) == [None, True, False]


def test_strips_go_where_their_objects_go():
    seen = replace(
        objects((3, 3, 0.7, 50), (10, -1, 0.5, 300), (10, 1, 0.6, 100)),
        strips=Strips(
            begin=np.array([0, 1, 3, 4]), rows_L=np.arange(16, dtype=np.float64).reshape(4, 4)
        ),
    )
    whole = join(seen, (10, 0, 2.5))
    assert whole.strips.begin.tolist() == [0, 3, 4]
    assert whole.strips.rows_L[:, 0].tolist() == [4.0, 8.0, 12.0, 0.0]


@given(st.integers(0, 6), st.integers(0, 4), st.integers(0, 1 << 20))
def test_circles_that_hold_two_or_more_tell_which(places, circles, seed):
    rng = np.random.default_rng(seed)
    p, centres, radii = (
        rng.normal(size=(places, 2)),
        rng.normal(size=(circles, 2)),
        rng.random(circles),
    )
    within = [
        [i for i, p_i in enumerate(p) if math.dist(p_i, c) <= r]
        for c, r in zip(centres, radii, strict=True)
    ]
    assert crowded(p, centres, radii) == [members for members in within if len(members) > 1]


def test_every_circle_needs_a_radius():
    with pytest.raises(ValueError, match="a radius for each centre"):
        crowded(np.zeros((2, 2)), np.zeros((2, 2)), np.zeros(1))
