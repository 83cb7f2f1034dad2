"""Long things stand, or move: what the outline tells in scenes whose truth is known."""

import math
from dataclasses import replace

import numpy as np
import pytest
from tests.reference.flat_world import Eye, look, scans, ship, stand, wall, watch

from twinscrew.runtime.messages.types import Objects, Outline
from twinscrew.runtime.tracking.lidar_motion import LongObjects, LongObjectSettings

STILL = lambda t: (0.0, 0.0, 0.0)  # noqa: E731
AHEAD = lambda t: (2.0 * t, 0.0, 0.0)  # noqa: E731
QUAY = wall((-100.0, 6.0), (100.0, 6.0))
"""Longer than can be seen."""
SHIP = ship(-12.0, 8.0, 0.0, 2.0)
"""It goes past at 2 m/s."""
ON_ODOMETRY_ERROR = 0.1, math.radians(0.3)
"""[m], [rad] How far places and headings are off, at most."""


def told_of(answers, body=0):
    """Give all that was said of a body."""
    return set().union(*(answer[body] for answer in answers))


def test_nothing_is_said_before_the_outlines_are_far_enough_apart():
    answers = watch([QUAY], AHEAD, scans(1.0))
    assert told_of(answers) == {None}


def test_a_long_wall_that_is_passed_stands():
    answers = watch([QUAY], AHEAD, scans(6.0))
    assert told_of(answers[10:]) == {True}


@pytest.mark.parametrize(
    "vessel",
    [
        SHIP,
        ship(-12.0, 8.0, 0.0, 1.0),
        ship(22.0, 4.0, math.pi, 2.0),  # comes, bow-on
        ship(11.0, 4.0, 0.0, 2.0),  # goes away
    ],
    ids=["passing", "slow", "coming", "going away"],
)
def test_a_ship_under_way_moves(vessel):
    answers = watch([vessel], STILL, scans(8.0))
    assert {False} in (answer[0] for answer in answers)
    assert told_of(answers) <= {None, False}


def test_a_ship_too_slow_for_one_second_is_told_by_two():
    """In one she comes ahead by two degrees, most of which is the guard."""
    answers = watch([ship(-2.0, 8.0, 0.0, 0.3)], STILL, scans(4.0))
    assert told_of(answers[10:13]) == {True}
    assert told_of(answers[20:]) == {False}


@pytest.mark.parametrize(("strays", "verdict"), [(1, True), (2, False)])
def test_a_stray_echo_of_a_quay_does_not_move_it(strays, verdict):
    """Half a degree is too little to tell of it; a whole one is not."""
    standing = LongObjects(LongObjectSettings())
    for t in scans(2.0):
        objects, _ = look([QUAY], t, STILL(t), Eye())
        if t == scans(2.0)[-1]:
            abeam = len(objects.outline.boundary_L) * 3 // 4
            objects.outline.boundary_L[abeam : abeam + strays, 1] -= 2.0
        said = set(standing.at_rest(objects, stand(STILL(t))))
    assert said == {verdict}


def test_a_ship_passed_at_anchor_stands():
    answers = watch([ship(10.0, 7.0, 0.0, 0.0)], AHEAD, scans(8.0))
    assert told_of(answers[20:]) == {True}


@pytest.mark.parametrize("behind_m", [1.0, 2.0, 4.0, 6.0, 8.0])
def test_a_wall_behind_a_passing_ship_stands_while_the_ship_moves(behind_m):
    """The ship hides a part of it, which comes out again."""
    far = SHIP.corners_N[:, 1].max() + behind_m
    answers = watch([SHIP, wall((-60.0, far), (60.0, far))], STILL, scans(14.0))
    assert told_of(answers, 0) == {None, False}
    assert told_of(answers, 1) == {None, True}
    assert {True} in (answer[1] for answer in answers[60:])


@pytest.mark.parametrize("speed", [1.0, 2.0, 4.0])
@pytest.mark.parametrize("behind_m", [1.0, 2.0, 3.0, 4.0, 8.0])
def test_a_quay_that_a_ship_leaves_stands_while_the_ship_moves(behind_m, speed):
    """Where she was is free now, and the quay is not far: what is gone was hers."""
    leaves = ship(0.0, 7.0, 0.0, speed, start_s=2.0)
    far = leaves.corners_N[:, 1].max() + behind_m
    answers = watch([leaves, wall((-60.0, far), (60.0, far))], STILL, scans(12.0))
    assert told_of(answers[10:20], 0) == {True}
    assert told_of(answers[30:45], 0) == {False}
    assert told_of(answers, 1) <= {None, True}  # what she hid is not known at once
    assert answers[-1][1] == {True}


@pytest.mark.parametrize(
    ("vessel", "own_speed", "own_course"),
    [
        (ship(-1.3088, 10.9014, 1.8751, 2.7808, (9.9756, 3.4138)), 2.3109, 2.4514),
        (ship(6.6223, 6.4932, 0.9335, 3.0458, (11.0, 3.5907)), 2.0491, 0.0),
        (ship(4.0, 6.0, math.pi / 4, 5.0), 0.0, 0.0),
    ],
)
def test_a_fast_ship_that_goes_away_is_never_told_to_stand(vessel, own_speed, own_course):
    """Two seconds ago she was where she has nothing in common with where she is now."""
    north, east = own_speed * math.cos(own_course), own_speed * math.sin(own_course)
    answers = watch([vessel], lambda t: (north * t, east * t, 0.0), scans(4.5))
    assert told_of(answers) == {None, False}


@pytest.mark.parametrize("first_s", [0.0, 0.5, 3.0])
def test_a_quay_that_comes_into_sight_is_known_after_a_second(first_s):
    """The boat turns around to it at once; before that nothing is in sight."""
    eye = Eye(240, 2 * math.pi / 3)
    path = lambda t: (0.0, 0.0, math.copysign(math.pi / 2, t - first_s + 0.05))  # noqa: E731
    answers, first = watch([QUAY], path, scans(first_s + 2.5), eye), round(10 * first_s)
    assert all(answer == [set()] for answer in answers[:first])
    assert all(answer == [{None}] for answer in answers[first : first + 10])
    assert all(answer == [{True}] for answer in answers[first + 10 :])


def test_a_wall_that_comes_out_from_behind_a_nearer_thing_stands():
    nearer = ship(8.0, 5.0, 0.0, 0.0, (5.0, 2.0))
    answers = watch([wall((-100.0, 10.0), (100.0, 10.0)), nearer], AHEAD, scans(8.0))
    assert told_of(answers[10:30], 0) == {True}
    assert told_of(answers[30:37], 0) == {None, True}  # a part that was not seen a second ago
    assert told_of(answers[37:], 0) == {True}


@pytest.mark.parametrize("turn_radps", [0.4, -0.4])
def test_a_quay_that_comes_out_of_the_blind_sector_stands(turn_radps):
    """The sensor sees a third of the turn, and the boat turns until the quay is abeam of it."""
    eye = Eye(240, 2 * math.pi / 3)
    path = lambda t: (0.5 * t, 0.0, math.pi / 2 + turn_radps * (t - 6.0))  # noqa: E731
    answers = watch([QUAY], path, scans(9.0), eye)
    assert answers[0] == [set()]
    assert told_of(answers) <= {None, True}
    assert answers[-1] == [{True}]


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize(
    "bank", [QUAY, wall((-100.0, 6.0), (10.0, 6.0), (10.0, 30.0))], ids=["endless", "corner"]
)
def test_places_and_headings_that_are_a_little_off_move_no_wall(bank, seed):
    rng = np.random.default_rng(seed)
    place_m, heading_rad = ON_ODOMETRY_ERROR

    def told(place):
        return stand(tuple(place + rng.uniform(-1, 1, 3) * [place_m, place_m, heading_rad]))

    answers = watch([bank], lambda t: (2.0 * t - 10.0, 0.0, 0.0), scans(10.0), told=told)
    assert told_of(answers[10:]) == {True}


def disturbed(body, spoil):
    """Give what is said of a body of which the 21st scan is spoilt."""
    standing, verdicts = LongObjects(LongObjectSettings()), []
    for k, t in enumerate(scans(5.0)):
        objects, _ = look([body], t, STILL(t), Eye())
        own = stand(STILL(t))
        if k == 20:
            objects, own = spoil(objects, own)
        verdicts.append(set(standing.at_rest(objects, own)))
    return verdicts


@pytest.mark.parametrize(
    "spoil",
    [
        lambda objects, own: (objects, own._replace(p_N=np.array([math.nan, 0.0]))),
        lambda objects, own: (objects, own._replace(p_N=np.array([0.0, math.inf]))),
        lambda objects, own: (objects, own._replace(R_NL=np.full((2, 2), math.nan))),
        lambda objects, own: (replace(objects, outline=None), own),
    ],
    ids=["nan", "infinite", "heading", "no outline"],
)
@pytest.mark.parametrize(("body", "verdict"), [(QUAY, True), (SHIP, False)])
def test_after_a_scan_that_tells_nothing_nothing_is_known_and_then_the_truth(body, verdict, spoil):
    verdicts = disturbed(body, spoil)
    assert verdicts[19] == {verdict}
    assert all(one == {None} for one in verdicts[20:31])
    assert all(one == {verdict} for one in verdicts[31:])


@pytest.mark.parametrize(("body", "verdict"), [(QUAY, True), (ship(-6, 8, 0, 2), False)])
def test_after_a_gap_of_three_seconds_the_truth_is_told_at_once(body, verdict):
    answers = watch([body], STILL, [0.0, 3.0, 3.1, 3.2])
    assert answers == [[{None}], *[[{verdict}]] * 3]


def test_after_a_reset_nothing_is_known():
    standing = LongObjects(LongObjectSettings())
    for t in scans(3.0):
        last = standing.at_rest(look([QUAY], t, STILL(t), Eye())[0], stand(STILL(t)))
    standing.reset()
    fresh = standing.at_rest(look([QUAY], 3.0, STILL(3.0), Eye())[0], stand(STILL(3.0)))
    assert (set(last), set(fresh)) == ({True}, {None})


@pytest.mark.parametrize("speed", [1.0, 2.0])
def test_a_moored_ship_that_starts_is_told_within_two_seconds(speed):
    answers = watch([ship(0.0, 8.0, 0.0, speed, start_s=3.0)], STILL, scans(8.0))
    assert told_of(answers[10:31]) == {True}
    assert told_of(answers[50:]) == {False}


def test_a_ship_that_has_moored_stands_once_no_outline_of_before_is_left():
    answers = watch([ship(-6.0, 8.0, 0.0, 2.0, stop_s=3.0)], STILL, scans(8.0))
    assert told_of(answers[10:31]) == {False}
    assert told_of(answers[51:]) == {True}


def test_a_ship_that_was_too_short_to_tell_of_is_unknown_until_she_can_be_told_of():
    """End-on she is no long thing; then the boat comes to see her side."""
    vessel = ship(10.7, 1.3, 0.1, 1.05, (9.5, 1.8))
    answers = watch([vessel], lambda t: (0.76 * t, 1.18 * t, 0.0), scans(6.0))
    assert [answer[0] for answer in answers[:10]] == [set()] * 10
    assert told_of(answers) == {None, False}
    assert answers[-1] == [{False}]


def test_what_is_not_long_is_not_told_of_beside_what_is():
    buoy = ship(4.0, -5.0, 0.0, 0.0, (1.0, 1.0))
    standing = LongObjects(LongObjectSettings())
    for t in scans(2.0):
        objects, owner = look([QUAY, buoy], t, STILL(t), Eye())
        verdicts = standing.at_rest(objects, stand(STILL(t)))
    assert {v for v, body in zip(verdicts, owner, strict=True) if body == 1} == {None}
    assert {v for v, body in zip(verdicts, owner, strict=True) if body == 0} == {True}


@pytest.mark.parametrize(("is_closed", "verdict"), [(True, True), (False, None)])
@pytest.mark.parametrize("sectors", [2, 3])
def test_few_sectors_are_enough_to_be_asked(sectors, is_closed, verdict):
    """Beside the first and the last of no full turn nothing is looked at, here everywhere."""
    azimuth = 2 * math.pi * (np.arange(sectors) + 0.5) / sectors
    boundary_L = 8.0 * np.column_stack([np.cos(azimuth), np.sin(azimuth)])
    outline = Outline(
        boundary_L=boundary_L,
        height_m=np.zeros(sectors),
        seen=np.zeros(sectors, dtype=np.int64),
        cut_from=np.array([0, 0]),
        sector_rad=2 * math.pi / sectors,
        is_closed=is_closed,
        sensor_L=np.zeros(3),
        down_L=np.array([0.0, 0.0, 1.0]),
        elevation_rad=np.empty(0),
        least_m=-math.inf,
    )
    standing = LongObjects(LongObjectSettings())
    for k in range(20):
        objects = Objects(
            stamp_ns=k * 100_000_000,
            p_L=boundary_L[:2],
            radius=np.full(2, 2.0),
            points=np.full(2, 50),
            outline=outline,
        )
        verdicts = standing.at_rest(objects, stand((0.0, 0.0, 0.0)))
    assert verdicts == [verdict, verdict]


def ring(stamp_s, seen, holes=()):
    """Give a scan of things 10 m off, by sector whose, and of something 15 m off in holes."""
    azimuth = 2 * math.pi * (np.arange(len(seen)) + 0.5) / len(seen)
    is_hole = np.isin(np.arange(len(seen)), [k for hole in holes for k in hole])
    away_m = np.where(is_hole, 15.0, 10.0)
    outline = Outline(
        boundary_L=away_m[:, None] * np.column_stack([np.cos(azimuth), np.sin(azimuth)]),
        height_m=np.zeros(len(seen)),
        seen=np.where(is_hole, -1, seen),
        cut_from=np.unique(seen),
        sector_rad=2 * math.pi / len(seen),
        is_closed=True,
        sensor_L=np.zeros(3),
        down_L=np.array([0.0, 0.0, 1.0]),
        elevation_rad=np.empty(0),
        least_m=-math.inf,
    )
    count = len(outline.cut_from)
    return Objects(
        stamp_ns=round(1e9 * stamp_s),
        p_L=np.zeros((count, 2)),
        radius=np.full(count, 2.0),
        points=np.full(count, 50),
        outline=outline,
    )


HOLES = np.arange(50, 57), np.arange(150, 157)
"""Sectors, of which the guard leaves one each."""


def compared(then, now):
    """Give what is said by the second of two scans a second apart."""
    standing, own = LongObjects(LongObjectSettings()), stand((0.0, 0.0, 0.0))
    standing.at_rest(then, own)
    return list(standing.at_rest(now, own))


@pytest.mark.parametrize(
    ("holes", "verdict"), [((), True), (HOLES[:1], True), (HOLES[1:], True), (HOLES, False)]
)
def test_what_is_gone_of_two_things_that_are_one_now_counts_together(holes, verdict):
    then = ring(0.0, np.repeat([0, 1, -1], [100, 100, 520]))
    now = ring(1.0, np.repeat([0, -1], [200, 520]), holes)
    assert compared(then, now) == [None, verdict]


def test_what_is_gone_counts_for_what_is_where_most_of_its_thing_was():
    then = ring(0.0, np.repeat([0, -1], [200, 520]))
    now = ring(1.0, np.repeat([0, 1, -1], [20, 180, 520]), HOLES)
    assert compared(then, now) == [None, True, False]


def test_what_the_oldest_outline_knows_is_not_asked_of_a_later_one():
    """A ship so slow that one second is too short; meanwhile the boat turns towards a quay."""
    bodies = [ship(-2.0, 8.0, 0.0, 0.3), wall((-8.0, -6.0), (8.0, -6.0))]
    path = lambda t: (0.0, 0.0, math.pi / 2 if t < 2.45 else 0.0)  # noqa: E731
    answers = watch(bodies, path, scans(4.0), Eye(480, 4 * math.pi / 3))
    assert told_of(answers[:25], 1) == set()
    assert told_of(answers[25:35], 1) == {None}
    assert told_of(answers[35:], 1) == {True}
    assert told_of(answers[20:], 0) == {False}


def test_an_empty_sea_is_told_of_without_objects():
    standing = LongObjects(LongObjectSettings())
    for t in scans(2.0):
        assert list(standing.at_rest(look([], t, STILL(t), Eye())[0], stand(STILL(t)))) == []


def test_times_between_which_no_outline_lies_are_refused():
    with pytest.raises(ValueError, match="least_s must not be greater"):
        LongObjectSettings(least_s=2.5, most_s=2.0)
    assert LongObjectSettings(least_s=2.0, most_s=2.0).least_s == 2.0
