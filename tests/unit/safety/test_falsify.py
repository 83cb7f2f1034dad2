"""The search for counter-examples: what a try is, and that a search is one of many tries."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from twinscrew.hil_sim.falsify import DIMENSIONS, Bounds, Motion, attempt, motion_of, search
from twinscrew.runtime.safety.assurance import AssuranceSettings

BOUNDS = Bounds()
AHEAD = Motion(
    surge_mps=2.0,
    command_n=(300.0, 300.0),
    place_m=(40.0, 0.0),
    course=math.pi,
    speed_mps=1.0,
    radius_m=1.0,
    wander=0.0,
    change_mps=0.0,
)


@given(st.lists(st.floats(0, 1), min_size=DIMENSIONS, max_size=DIMENSIONS))
def test_every_try_is_within_the_stated_bounds(unit) -> None:
    motion = motion_of(np.array(unit), BOUNDS)
    assert BOUNDS.speed_mps[0] <= motion.speed_mps <= BOUNDS.speed_mps[1]
    assert BOUNDS.radius_m[0] <= motion.radius_m <= BOUNDS.radius_m[1]
    assert abs(math.degrees(motion.wander)) <= BOUNDS.wander_deg + 1e-9
    assert abs(motion.change_mps) <= BOUNDS.wander_speed * motion.speed_mps + 1e-9


def test_a_contact_without_the_assurance_is_found_and_is_avoidable() -> None:
    off = AssuranceSettings(enabled=False)
    tried = attempt(AHEAD, BOUNDS, off)
    assert tried.gap_m < 0.0
    assert tried.avoidable


def test_what_the_assurance_stops_for_is_no_contact() -> None:
    standing = replace(AHEAD, speed_mps=0.0, place_m=(25.0, 0.0))
    tried = attempt(standing, BOUNDS)
    assert tried.gap_m > 0.0
    assert not tried.avoidable


def test_nobody_can_avoid_who_is_faster_and_aims_from_close_by() -> None:
    rammed = replace(AHEAD, place_m=(-15.0, 0.0), course=0.0, speed_mps=20.0, radius_m=9.0)
    tried = attempt(rammed, BOUNDS, AssuranceSettings(enabled=False))
    assert tried.gap_m <= 0.0
    assert not tried.avoidable


def test_a_try_that_begins_in_contact_is_none() -> None:
    tried = attempt(replace(AHEAD, place_m=(3.0, 0.0)), BOUNDS)
    assert tried.gap_m > 0.0
    assert not tried.avoidable


def test_the_same_seed_tries_the_same() -> None:
    pytest.importorskip("cma")
    off = AssuranceSettings(enabled=False)
    first, second = (search(24, seed=3, bounds=BOUNDS, settings=off) for _ in range(2))
    assert first.tries == 24
    assert first.contacts == second.contacts > 0
    assert first.avoidable == second.avoidable
    assert first.record(BOUNDS)["worst"] == second.record(BOUNDS)["worst"]
