"""A long vessel under way is one track with an outline; what is long and stands is none."""

import importlib.util
import math
from pathlib import Path

import numpy as np
import pytest
from tests.reference.flat_world import Eye, look, scans, ship, wall

from twinscrew.runtime.tracking.ships import ShipSettings
from twinscrew.runtime.tracking.tracker import Tracker, TrackerSettings

_spec = importlib.util.spec_from_file_location("scene", Path(__file__).with_name("scene.py"))
scene = importlib.util.module_from_spec(_spec)
_spec.loader.exec_module(scene)

EYE = Eye(reach_m=60.0)
SIZE = (20.0, 5.0)


def track(bodies, path, seconds, settings=None):
    """Give the tracks of each scan."""
    tracker = Tracker(settings)
    for t in scans(seconds):
        objects, _ = look(bodies, t, path(t), EYE)
        yield t, tracker.step(objects, scene.odometry(objects.stamp_ns, *path(t)))


def still(t):
    return 0.0, 0.0, 0.0


def of_ship(tracks, p_N):
    """Give the rows of the tracks on a ship."""
    return np.flatnonzero(np.hypot(*(tracks.p_N - p_N).T) < 13.0)


@pytest.mark.parametrize(
    ("north", "east", "heading", "speed"),
    [
        (-20.0, 30.0, 0.0, 4.0),  # passes abeam
        (-20.0, 20.0, 0.4, 3.0),  # goes away, her quarter in sight
        (50.0, -25.0, math.pi, 4.0),  # comes towards the boat
        (30.0, 40.0, -math.pi / 2, 2.0),  # crosses ahead
    ],
)
def test_a_long_ship_is_one_track_with_her_velocity_and_outline(north, east, heading, speed):
    body = ship(north, east, heading, speed, SIZE)
    way = speed * np.array([math.cos(heading), math.sin(heading)])
    judged = 0
    for t, tracks in track([body], still, 9.0):
        place = np.array([north, east]) + t * way
        if t < 4.0 or math.hypot(*place) > 48.0:
            continue
        (row,) = of_ship(tracks, place)
        judged += 1
        assert np.hypot(*(tracks.v_N[row] - way)) < 0.5
        assert abs(math.sin(tracks.heading[row] - heading)) < 0.15
        assert np.hypot(*(tracks.p_N[row] - place)) < 2.5
        assert tracks.half_length[row] == pytest.approx(10.0, abs=1.5)
        assert 2.0 < tracks.half_beam[row] < 4.0
    assert judged > 10


def test_a_ship_keeps_her_identity_while_she_passes():
    body = ship(-20.0, 15.0, 0.0, 4.0, SIZE)
    ids = set()
    for t, tracks in track([body], still, 10.0):
        if t > 3.0:
            rows = of_ship(tracks, np.array([-20.0 + 4.0 * t, 15.0]))
            ids.add(tuple(tracks.id[rows].tolist()))
    assert len(ids) == 1
    assert len(next(iter(ids))) == 1


def test_more_of_a_ship_that_comes_into_sight_is_no_motion():
    """She lies behind a shed, and comes out from behind it while the boat goes ahead."""
    body, shed = ship(0.0, 30.0, 0.0, 2.0, SIZE), wall((-40.0, 14.0), (2.0, 14.0))
    known = []
    for t, tracks in track([body, shed], lambda t: (1.0 * t, 0.0, 0.0), 8.0):
        if tracks.half_length is not None:
            (row,) = np.flatnonzero(np.isfinite(tracks.half_length))
            known.append((t, tracks.v_N[row]))
    first_s = known[0][0]
    settled = np.array([v_N for t, v_N in known if t > first_s + 0.4])
    assert len(settled) > 20
    assert abs(settled - (2.0, 0.0)).max() < 0.3


def test_a_ship_that_stops_is_followed_in_pieces_again():
    body = ship(-10.0, 20.0, 0.0, 3.0, SIZE, stop_s=4.0)
    *_, (_, tracks) = track([body], still, 13.0)
    assert tracks.half_length is None
    assert len(tracks.id) >= 3
    assert np.linalg.norm(tracks.v_N, axis=1).max() < 0.1


@pytest.mark.parametrize(
    "bank",
    [
        wall((-100.0, 25.0), (100.0, 25.0)),
        wall((-30.0, 30.0), (20.0, 30.0), (20.0, -30.0)),
        wall((-8.0, 20.0), (10.0, 20.0)),
    ],
    ids=["endless", "corner", "pier"],
)
def test_what_stands_is_no_ship(bank):
    for _, tracks in track([bank], lambda t: (2.0 * t - 10.0, 0.0, 0.0), 8.0):
        assert tracks.half_length is None


def test_the_walls_of_a_basin_are_no_ship_though_something_moves_in_it():
    basin = wall((-30.0, -30.0), (30.0, -30.0), (30.0, 30.0), (-30.0, 30.0), (-30.0, -30.0))
    boat = ship(-20.0, 15.0, 0.0, 3.0, (4.0, 2.0))
    for _, tracks in track([basin, boat], still, 9.0):
        assert tracks.half_length is None or not np.isfinite(tracks.half_length).any()


def test_pieces_are_followed_where_no_length_is_allowed():
    settings = TrackerSettings(ships=ShipSettings(longest_m=0.0))
    *_, (_, tracks) = track([ship(-20.0, 25.0, 0.0, 4.0, SIZE)], still, 6.0, settings)
    assert tracks.half_length is None
    assert len(tracks.id) >= 3
