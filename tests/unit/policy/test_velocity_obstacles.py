"""Velocity obstacles with rule sides: the velocity they allow, and what the boat does with it."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.harness.encounter import observation

from twinscrew.runtime.messages.types import Observation
from twinscrew.runtime.policy.load import load_policy
from twinscrew.runtime.policy.velocity_obstacles import (
    OrcaPolicy,
    OrcaSettings,
    half_planes,
    nearest_allowed,
    role_of,
    safe_velocity,
    time_to,
)
from twinscrew.runtime.vessel_description import load_vessel

SETTINGS = OrcaSettings()
AHEAD = np.array([2.0, 0.0])


def seen(*objects, goal=(50.0, 0.0), surge=2.0) -> Observation:
    return observation((*goal, surge, 0, 0, 200, 200), objects, room=8)


angles = st.floats(-math.pi, math.pi)
planes = st.lists(st.tuples(angles, st.floats(-3.0, 1.5)), min_size=1, max_size=6)


@given(planes, st.floats(-2, 2), st.floats(-2, 2))
def test_no_allowed_velocity_is_nearer_to_the_wanted_one(rows, x, y) -> None:
    """Against a fine grid of the disc of the top speed; where nothing is allowed, the least bad."""
    normals = np.array([[math.cos(a), math.sin(a)] for a, _ in rows])
    offsets = np.array([offset for _, offset in rows])
    wanted, top = np.array([x, y]), 3.0
    v = nearest_allowed(wanted, normals, offsets, top)
    assert math.hypot(*v) <= top + 1e-6
    side = np.linspace(-top, top, 61)
    grid = np.array([(a, b) for a in side for b in side if math.hypot(a, b) <= top])
    violation = np.maximum((offsets - grid @ normals.T).max(axis=1), 0.0)
    own = max(float((offsets - normals @ v).max()), 0.0)
    assert own <= violation.min() + 1e-6
    allowed = violation == 0.0
    if allowed.any():
        nearest = np.hypot(*(grid[allowed] - wanted).T).min()
        assert math.hypot(*(v - wanted)) <= nearest + 1e-6


def test_with_nothing_around_it_wants_the_goal() -> None:
    v = safe_velocity(seen(goal=(0.0, 40.0)), SETTINGS)
    assert math.atan2(v[1], v[0]) == pytest.approx(math.pi / 2)
    near = safe_velocity(seen(goal=(1.0, 0.0)), SETTINGS)
    assert math.hypot(*near) == pytest.approx(1.0 / SETTINGS.arrival_s)


@given(st.floats(15, 40), angles, st.floats(0.6, 3.0), angles, st.floats(0.5, 6.0))
def test_a_velocity_that_is_kept_touches_nothing_within_the_horizon(d, at, v, course, r) -> None:
    other = (d * math.cos(at), d * math.sin(at), v * math.cos(course), v * math.sin(course), r)
    observation = seen(other)
    allowed = safe_velocity(observation, SETTINGS)
    normals, offsets = half_planes(observation, AHEAD, SETTINGS)
    if len(normals) and (normals @ allowed < offsets - 1e-6).any():
        return  # nothing was allowed: the least bad
    reach = r * SETTINGS.radius_factor + SETTINGS.own_radius_m
    p, v_other = np.array(other[:2]), np.array(other[2:4])
    assert time_to(p, allowed - v_other, reach) > SETTINGS.stand_on_s - 1e-6


@pytest.mark.parametrize(
    ("p", "v_other", "role"),
    [
        ((30, 1), (-2, 0), "give_way"),
        ((30, 30), (0, -2), "give_way"),
        ((30, -30), (0, 2), "stand_on"),
        ((20, 0), (1, 0), "overtaking"),
        ((-20, 0), (3, 0), "stand_on"),
        ((-20, 2), (1, 0), "stand_on"),
    ],
)
def test_the_rules_say_what_the_boat_is_to_do(p, v_other, role) -> None:
    assert role_of(np.array(p, float), np.array(v_other, float), AHEAD, SETTINGS) == role


@pytest.mark.parametrize("other", [(30, 1, -2, 0, 2.8), (25, 25, 0, -2, 2.8), (30, -1, -2, 0, 2.8)])
def test_who_gives_way_turns_to_starboard(other) -> None:
    v = safe_velocity(seen(other), SETTINGS)
    assert v[1] > 0.3
    action = OrcaPolicy().act(seen(other))
    assert action[0] > action[1]  # more thrust to port turns it to starboard


def test_who_is_to_stand_on_does_so_until_there_is_little_time() -> None:
    far, near = (25, -25, 0, 2, 2.8), (12, -12, 0, 2, 2.8)
    np.testing.assert_array_equal(
        safe_velocity(seen(far), SETTINGS), safe_velocity(seen(), SETTINGS)
    )
    assert safe_velocity(seen(near), SETTINGS)[1] > 0.3


def test_it_is_loaded_by_name_for_any_hull() -> None:
    assert load_policy("orca").name == "orca"
    policy = load_policy("orca", vessel=load_vessel("heron"))
    assert np.isfinite(policy.act(seen((30, 1, -2, 0, 2.8)))).all()
