"""Encounters drawn by hand, and their mirror images."""

from __future__ import annotations

import math

import numpy as np
import pytest

from twinscrew.runtime.policy.colregs import (
    CROSSING_ZONE,
    HEAD_ON_ZONE,
    ColregsSettings,
    Situation,
    compliant_course,
    in_crossing_zone,
    in_head_on_zone,
    situation,
    starboard_turn,
)

NORTH, EAST, SOUTH, WEST = (2.0, 0.0), (0.0, 2.0), (-2.0, 0.0), (0.0, -2.0)


def classify(p: tuple[float, float], other: tuple[float, float], ego: tuple[float, float]) -> int:
    return int(situation(np.array(p), np.array(other), np.array(ego)))


@pytest.mark.parametrize(
    ("p", "other", "expected"),
    [
        ((10, 0), SOUTH, Situation.HEAD_ON),
        ((10, 4.4), SOUTH, Situation.HEAD_ON),
        ((10, -4.4), SOUTH, Situation.HEAD_ON),
        ((10, 4.6), SOUTH, Situation.NONE),  # beside the zone
        ((18, 0), SOUTH, Situation.NONE),  # before it
        ((-10, 0), SOUTH, Situation.NONE),  # the other has passed
        ((10, 0), NORTH, Situation.NONE),  # overtaking is not checked
        ((8, 8), WEST, Situation.GIVE_WAY),  # on the starboard side, crossing to port
        ((8, -8), EAST, Situation.NONE),  # on the port side: the ego stands on
        ((8, 8), EAST, Situation.NONE),  # sails away
        ((2, 14), WEST, Situation.NONE),  # farther ahead of the other than the zone
        ((1, 6), WEST, Situation.NONE),  # in the corner that was cut off
        ((10, 0), (-0.3, 0), Situation.NONE),  # not a vessel
    ],
)
def test_an_ego_vessel_sailing_north_is_told_its_duty(
    p: tuple[float, float], other: tuple[float, float], expected: Situation
) -> None:
    assert classify(p, other, NORTH) == expected


def test_a_slow_ego_vessel_has_no_duty() -> None:
    assert classify((10, 0), SOUTH, (0.4, 0.0)) == Situation.NONE


def test_turning_the_whole_scene_changes_nothing() -> None:
    generator = np.random.default_rng(0)
    p, v, w = (generator.uniform(-scale, scale, (5000, 2)) for scale in (15.0, 3.0, 3.0))
    before = situation(p, v, w)
    assert set(np.unique(before)) == {0, 1, 2}
    for angle in (0.5, 2.0, -2.5):
        c, s = math.cos(angle), math.sin(angle)
        R = np.array([[c, s], [-s, c]])
        assert np.mean(situation(p @ R, v @ R, w @ R) != before) < 1e-3  # rounding at the edges


def test_the_angle_limits_are_those_of_the_paper() -> None:
    for degrees in np.arange(-179.5, 180.0, 1.0):
        angle = math.radians(degrees)
        other = np.array([2.0, 0.0])
        ego = 2.0 * np.array([math.cos(angle), math.sin(angle)])
        head_on = situation(np.array([-5.0, 0.0]), other, ego)  # 5 m ahead of the other
        crossing = situation(np.array([0.0, 8.0]), other, ego)  # 8 m to port of the other
        assert (head_on == Situation.HEAD_ON) == (abs(degrees) > 135)
        assert (crossing == Situation.GIVE_WAY) == (45 <= degrees <= 135)


def test_the_zones_have_the_corners_of_the_reference() -> None:
    x, y = np.array([0.0, 17.0, 17.01, 5.0]), np.array([4.5, -4.5, 0.0, 4.51])
    assert in_head_on_zone(x, y).tolist() == [True, True, False, False]
    x = np.array([-9.0, -9.0, 12.0, 12.0, 6.0, 6.0, -9.01])
    y = np.array([0.0, -17.0, -17.0, -6.9, -3.6, -3.4, -5.0])
    assert in_crossing_zone(x, y).tolist() == [True, True, True, False, True, False, False]


def test_the_compliant_course_touches_the_widened_circle_plus_the_own_width() -> None:
    """Far away both angles are small: the course passes r_obj + 1 + r_ego to starboard."""
    course = compliant_course(np.array([1000.0, 0.0]), np.array(2.0), 2.795)
    assert 1000.0 * math.tan(course) == pytest.approx(2.0 + 1.0 + 2.795, rel=1e-4)


def test_within_the_clearance_the_course_leads_straight_away_and_stays_finite() -> None:
    for distance in (0.0, 1.0, 3.0):
        course = compliant_course(np.array([distance, 0.0]), np.array(2.0), 2.795)
        assert course == pytest.approx(math.pi)
    outside = compliant_course(np.array([3.0 + 1e-9, 0.0]), np.array(2.0), 2.795)
    assert outside == pytest.approx(math.pi, abs=1e-3)


def test_only_a_turn_to_starboard_is_asked_for() -> None:
    p, radius = np.array([10.0, 0.0]), np.array(2.0)
    ahead = float(starboard_turn(p, radius, np.array(NORTH), 2.795))
    expected = math.asin(0.3) + math.atan2(2.795, math.sqrt(91.0))
    assert ahead == pytest.approx(expected)
    assert starboard_turn(p, radius, np.array(EAST), 2.795) == 0.0  # has turned enough


def test_the_zones_are_settings() -> None:
    wide = ColregsSettings(head_on_half_width_m=10.0)
    p, other, ego = np.array([10.0, 8.0]), np.array(SOUTH), np.array(NORTH)
    assert situation(p, other, ego, wide) == Situation.HEAD_ON


@pytest.mark.parametrize(
    ("corners", "inside"), [(HEAD_ON_ZONE, in_head_on_zone), (CROSSING_ZONE, in_crossing_zone)]
)
def test_the_corners_that_are_drawn_enclose_the_zones_that_are_tested(corners, inside) -> None:
    points = np.random.default_rng(0).uniform(-25.0, 25.0, (4000, 2))
    edges = np.roll(corners, -1, axis=0) - corners
    towards = points[:, None, :] - corners
    sides = edges[:, 0] * towards[..., 1] - edges[:, 1] * towards[..., 0]
    enclosed = (sides > 0).all(axis=1) | (sides < 0).all(axis=1)  # the zones are convex
    assert 200 < enclosed.sum() < 2000
    np.testing.assert_array_equal(enclosed, inside(points[:, 0], points[:, 1]))
