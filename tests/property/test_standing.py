"""No path past a wall moves it, and no long thing under way ever stands."""

import math

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from tests.harness.work import examples
from tests.reference.flat_world import Eye, scans, ship, wall, watch

ANGLE = st.floats(-math.pi, math.pi)
EYES = [
    Eye(),
    Eye(360),
    Eye(2160),
    Eye(240, 2 * math.pi / 3),
    Eye(70, 0.6, sensor_L=(-1.5, 0.5)),
    Eye(900, 5.5, reach_m=30.0),
]
LEAST_AWAY_M = 1.0
"""[m] The boat does not touch what is beside it."""


@pytest.mark.slow
@settings(max_examples=examples(60), deadline=None)
@given(
    away_m=st.floats(2.0, 18.0),
    speed=st.floats(0.0, 4.0),
    course=ANGLE,
    heading=ANGLE,
    turn_radps=st.floats(-0.8, 0.8),
    lies=ANGLE,
    eye=st.sampled_from(EYES),
)
def test_no_straight_path_moves_a_wall(away_m, speed, course, heading, turn_radps, lies, eye):
    """Nor does a boat that turns on it."""
    seconds = 3.0
    away = np.array([-math.sin(lies), math.cos(lies)])
    velocity = speed * np.array([math.cos(course), math.sin(course)])
    assume(seconds * (velocity @ away) < away_m - LEAST_AWAY_M - abs(eye.sensor_L[0]))
    along = 200.0 * np.array([math.cos(lies), math.sin(lies)])
    endless = wall(tuple(away_m * away - along), tuple(away_m * away + along))

    def path(t):
        return (*(t * velocity), heading + turn_radps * t)

    for answer in watch([endless], path, scans(seconds), eye):
        assert answer[0] <= {None, True}


@pytest.mark.slow
@settings(max_examples=examples(60), deadline=None)
@given(
    bearing=ANGLE,
    away_m=st.floats(5.0, 15.0),
    course=ANGLE,
    speed=st.floats(1.0, 5.0),
    length_m=st.floats(8.0, 14.0),
    beam_m=st.floats(1.5, 4.0),
    own_course=ANGLE,
    own_speed=st.floats(0.0, 2.5),
    heading=ANGLE,
)
def test_no_ship_under_way_stands(
    bearing, away_m, course, speed, length_m, beam_m, own_course, own_speed, heading
):
    """While it looks long and one of its ends is in sight; two seconds of that are looked back.

    Within any such two seconds it is found to move; single scans may tell too little.
    """
    place = away_m * math.cos(bearing), away_m * math.sin(bearing)
    vessel = ship(*place, course, speed, (length_m, beam_m))
    velocity = own_speed * np.array([math.cos(own_course), math.sin(own_course)])
    times_s, reach_m = scans(4.0), Eye().reach_m

    def path(t):
        return (*(t * velocity), heading)

    said, in_sight = watch([vessel], path, times_s), []
    for t, answer in zip(times_s, said, strict=True):
        corners = vessel.corners(t) - t * velocity
        assume(_distance(corners) > LEAST_AWAY_M)
        bow, stern = np.linalg.norm(corners[[[0, 1], [2, 3]]], axis=2).max(axis=1)
        is_seen = min(bow, stern) < reach_m - 2.0 and bool(answer[0])
        in_sight = [*in_sight, answer[0]] if is_seen else []
        if len(in_sight) > 20:
            assert True not in answer[0]
            assert {False} in in_sight[-21:]


def _distance(corners):
    """Give how far the sides, from corner to corner, are from the origin [m]; 0 inside."""
    begin, side = corners[:-1], np.diff(corners, axis=0)
    share = np.clip(-(begin * side).sum(axis=1) / (side**2).sum(axis=1), 0.0, 1.0)
    to_left = side[:, 0] * -begin[:, 1] - side[:, 1] * -begin[:, 0]
    is_inside = (to_left > 0).all() or (to_left < 0).all()
    return 0.0 if is_inside else np.linalg.norm(begin + share[:, None] * side, axis=1).min()
