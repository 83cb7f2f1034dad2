import math

import numpy as np
import pytest

from twinscrew.hil_sim.experiments.encounters import (
    crossed_ahead,
    passed_to_port,
    rule_tracks,
    runs,
)

NORTH, EAST = np.array([1.0, 0.0]), np.array([0.0, 1.0])


@pytest.mark.parametrize(
    ("place", "heading_deg", "port"),
    [
        (EAST, 0, False),
        (-EAST, 0, True),
        (NORTH, 90, True),
        (-NORTH, 90, False),
        (EAST, 180, True),
    ],
)
def test_port_is_to_the_left_of_the_bow(place, heading_deg: float, port: bool) -> None:
    assert passed_to_port(5.0 * place, math.radians(heading_deg)) is port


def meeting(offset: float, ego_speed: float = 2.0):
    """The other goes north through the origin at 2 m/s; the ego comes from its port, eastward.

    At time 0 the other is at the origin and the ego `offset` metres ahead of it, on its track.
    """
    times = np.linspace(-4, 4, 81)[:, None]
    other = 2.0 * times * NORTH
    ego = offset * NORTH + ego_speed * times * EAST
    return ego, other, np.tile(2.0 * NORTH, (81, 1))


@pytest.mark.parametrize(
    ("offset", "ahead"), [(4.0, True), (0.5, True), (-0.5, False), (-4, False)]
)
def test_crossing_is_ahead_if_it_is_before_the_others_bow(offset: float, ahead: bool) -> None:
    assert crossed_ahead(*meeting(offset)) is ahead


def test_crossing_from_starboard_is_another_vessels_affair() -> None:
    ego, other, velocity = meeting(4.0)
    assert not crossed_ahead(ego * [1, -1], other, velocity)


def test_who_stays_on_its_side_does_not_cross() -> None:
    ego, other, velocity = meeting(4.0)
    assert not crossed_ahead(ego[:35], other[:35], velocity[:35])


def test_a_vessel_that_has_stopped_keeps_its_course() -> None:
    ego, other, velocity = meeting(4.0)
    wobbling = velocity.copy()
    wobbling[30:] = [0.0, 0.2]  # pushed about: no course to go by
    assert crossed_ahead(ego, other, wobbling)


TIMES = np.arange(0.0, 10.0, 0.02)


def opposite(gap_m: float):
    """Two on one line towards each other, 2 m/s each."""
    return np.array([[0.0, 0.0], [gap_m, 0.0]]), np.array([2.0 * NORTH, -2.0 * NORTH])


def test_who_stands_on_keeps_course_and_speed() -> None:
    tracks = rule_tracks(*opposite(20.0), (False, False), 2.8, 0.5, TIMES)
    assert tracks[:, 0] == pytest.approx(2.0 * TIMES[:, None] * NORTH)
    assert tracks[:, 1] == pytest.approx(20.0 * NORTH - 2.0 * TIMES[:, None] * NORTH)


def test_two_that_both_act_pass_clear_of_each_other_port_to_port() -> None:
    tracks = rule_tracks(*opposite(20.0), (True, True), 2.8, 0.5, TIMES)
    distance = np.hypot(*(tracks[:, 0] - tracks[:, 1]).T)
    assert distance.min() > 2 * 2.8 + 0.5
    nearest = int(distance.argmin())
    assert passed_to_port(tracks[nearest, 1] - tracks[nearest, 0], 0.0)
    assert tracks[:, 0] == pytest.approx(20.0 * NORTH - tracks[:, 1])  # each as the other


def test_a_vessel_that_acts_turns_at_its_rate_on_a_circle_and_keeps_its_speed() -> None:
    p_N, v_N = opposite(6.0)
    v_N[1] = 0.0
    tracks = rule_tracks(p_N, v_N, (True, False), 2.8, 0.5, TIMES[:100])
    steps = np.diff(tracks[:, 0], axis=0)
    assert np.hypot(*steps.T) == pytest.approx(0.04)
    turned = np.arctan2(steps[-1, 1], steps[-1, 0]) - np.arctan2(steps[0, 1], steps[0, 0])
    assert turned == pytest.approx(0.5 * TIMES[98])
    # On a circle of radius v / omega = 4 m the chord is 2 r sin(angle / 2).
    chord = np.hypot(*(tracks[99, 0] - tracks[0, 0]))
    assert chord == pytest.approx(8.0 * math.sin(0.25 * TIMES[99]), abs=0.01)


def test_a_course_that_is_clear_already_is_kept() -> None:
    p_N = np.array([[0.0, 0.0], [20.0, -10.0]])  # the other far to port
    v_N = np.array([2.0 * NORTH, -2.0 * NORTH])
    tracks = rule_tracks(p_N, v_N, (True, True), 2.8, 0.5, TIMES)
    assert tracks[:, 0] == pytest.approx(2.0 * TIMES[:, None] * NORTH)


def test_runs_are_stretches_of_one_value_that_last() -> None:
    kinds = np.array([0, 1, 1, 1, 2, 2, 2, 0, 1, 0, 2, 2, 2, 2], dtype=np.int8)
    assert runs(kinds, 3) == [(1, 4), (4, 7), (10, 14)]
    assert (8, 9) in runs(kinds, 1)
    assert runs(np.zeros(5, dtype=np.int8), 1) == []
