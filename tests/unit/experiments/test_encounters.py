"""Encounters of two vessels on tracks that are drawn by hand."""

import math
from dataclasses import replace

import numpy as np
import pytest

from twinscrew.hil_sim.experiments.encounters import Course, find_encounters

TIMES = np.arange(0.0, 16.0, 0.1)
RADIUS = 2.8


def course(*tracks, buoys=(), ended_s=None, gone_s=None) -> Course:
    """Vessels on smooth tracks, (T, 2) each; headings and velocities follow."""
    p_N = np.stack(tracks, axis=1)
    v_N = np.gradient(p_N, TIMES, axis=0)
    count = p_N.shape[1]
    return Course(
        times=TIMES,
        p_N=p_N,
        v_N=v_N,
        heading=np.arctan2(v_N[..., 1], v_N[..., 0]),
        ended_s=np.full(count, np.inf) if ended_s is None else np.array(ended_s),
        gone_s=np.full(count, np.inf) if gone_s is None else np.array(gone_s),
        buoys=np.array(buoys, dtype=float).reshape(-1, 3),
        radius=RADIUS,
    )


def head_on(to_starboard_m: float):
    """Two on opposite courses, 2 m/s each; half-way both have stepped aside so far."""
    north = 2.0 * TIMES
    aside = to_starboard_m * np.exp(-(((TIMES - 7.5) / 2.8) ** 2))
    first = np.column_stack([north, aside])
    return first, np.column_stack([30.0 - north, -aside])


def crossing(offset_m: float, ego_mps: float = 2.0, other_mps: float = 2.0):
    """The ego eastward, the other northward with the ego on its port side.

    When they would meet (7.5 s) the ego is so far ahead of the other, along the other's track.
    """
    ego = np.column_stack([np.full(TIMES.size, offset_m), ego_mps * (TIMES - 7.5)])
    other = np.column_stack([other_mps * (TIMES - 7.5), np.zeros(TIMES.size)])
    return ego, other


def test_two_that_meet_head_on_and_both_turn_to_starboard_act_as_asked() -> None:
    found = find_encounters(course(*head_on(3.5)))
    assert [(e.kind, e.ego, e.other) for e in found] == [("head_on", 0, 1), ("head_on", 1, 0)]
    assert all(e.acted and not e.touched for e in found)
    assert [e.end_s for e in found] == pytest.approx([7.5, 7.5], abs=0.11)


def test_their_gap_is_what_is_left_between_their_circles() -> None:
    found = find_encounters(course(*head_on(3.5)))
    assert [e.gap_m for e in found] == pytest.approx([7.0 - 2 * RADIUS] * 2, abs=0.01)


def test_two_that_both_turn_to_port_deviate() -> None:
    found = find_encounters(course(*head_on(-3.5)))
    assert len(found) == 2
    assert not any(e.acted for e in found)


def test_by_the_rules_two_that_meet_head_on_pass_clear() -> None:
    (first, second) = find_encounters(course(*head_on(-2.9)))
    assert first.rule_gap_m > 0.5
    assert first.rule_gap_m == pytest.approx(second.rule_gap_m, abs=0.3)
    assert not first.safer  # 0.2 m are left between them


def test_a_buoy_to_starboard_makes_the_deviation_safer() -> None:
    tracks = head_on(-3.5)
    (free, _) = find_encounters(course(*tracks))
    in_the_way = (17.0, 5.0, 0.75)
    (blocked, _) = find_encounters(course(*tracks, buoys=[in_the_way]))
    assert not blocked.acted
    assert blocked.rule_gap_m < free.rule_gap_m
    assert blocked.safer


def test_a_give_way_vessel_that_passes_astern_acts_as_asked() -> None:
    found = find_encounters(course(*crossing(-8.5)))
    give_way = [e for e in found if e.kind == "give_way"]
    assert [(e.ego, e.other, e.acted) for e in give_way] == [(0, 1, True)]


def test_a_give_way_vessel_that_crosses_ahead_does_not() -> None:
    (found,) = find_encounters(course(*crossing(8.0, ego_mps=3.0, other_mps=1.0)))
    assert (found.kind, found.ego, found.acted) == ("give_way", 0, False)
    # Seen from the other it passes on a line through (8, 0) along (-1, 3).
    assert found.gap_m == pytest.approx(8.0 * 3.0 / math.sqrt(10) - 2 * RADIUS, abs=0.02)


def test_the_stand_on_vessel_has_no_part_to_act() -> None:
    found = find_encounters(course(*crossing(-8.5)))
    assert all(e.ego == 0 for e in found if e.kind == "give_way")


def test_who_touches_has_not_acted_as_asked_on_whichever_side() -> None:
    tracks = head_on(2.0)  # 4 m apart: circles overlap from about 7 s on
    together = next(
        t for t, d in zip(TIMES, np.hypot(*(tracks[0] - tracks[1]).T), strict=True) if d <= 5.6
    )
    hit = course(*tracks, ended_s=[together] * 2, gone_s=[together] * 2)
    found = find_encounters(hit)
    assert len(found) == 2
    assert all(e.touched and not e.acted for e in found)


def test_vessels_that_have_ended_meet_nobody() -> None:
    assert find_encounters(course(*head_on(3.5), ended_s=[1.0, 20.0])) == ()


def test_a_third_vessel_counts_for_the_gap_until_it_is_gone() -> None:
    beside = np.column_stack([np.full(TIMES.size, 15.0), np.full(TIMES.size, 10.0)])
    there = course(*head_on(3.5), beside, ended_s=[20.0, 20.0, 0.5])
    near = find_encounters(there)[0]
    assert near.gap_m == pytest.approx(6.5 - 2 * RADIUS, abs=0.02)
    gone = find_encounters(replace(there, gone_s=np.array([np.inf, np.inf, 0.5])))[0]
    assert gone.gap_m == pytest.approx(7.0 - 2 * RADIUS, abs=0.02)


def test_parallel_courses_are_no_encounter() -> None:
    north = np.column_stack([2.0 * TIMES, np.zeros(TIMES.size)])
    assert find_encounters(course(north, north + np.array([0.0, 8.0]))) == ()
