"""Scenario-based predictive control: what it chooses in encounters, and what its costs mean."""

import math

import numpy as np
import pytest
from tests.harness.encounter import observation

from twinscrew.runtime.messages.types import Observation
from twinscrew.runtime.policy.load import load_policy
from twinscrew.runtime.policy.scenario_mpc import (
    ScenarioMpcPolicy,
    ScenarioMpcSettings,
    candidate_costs,
    candidates,
    paths,
)
from twinscrew.runtime.vessel_description import load_vessel

SETTINGS = ScenarioMpcSettings()
POLICY = ScenarioMpcPolicy(SETTINGS)
AHEAD = np.array([2.0, 0.0])


def seen(*objects, goal=(60.0, 0.0), surge=2.0) -> Observation:
    return observation((*goal, surge, 0, 0, 200, 200), objects, room=8)


def course_deg(*objects) -> float:
    velocity = POLICY.velocity(seen(*objects))
    return math.degrees(math.atan2(velocity[1], velocity[0]))


def test_with_nothing_around_it_goes_to_the_goal() -> None:
    assert course_deg() == pytest.approx(0.0)


@pytest.mark.parametrize("other", [(40, 0, -2, 0, 2.8), (30, 30, 0, -2, 2.8)])
def test_who_gives_way_alters_to_starboard_early_and_readably(other) -> None:
    assert course_deg(other) >= 15.0


def test_who_is_to_stand_on_does_so_until_there_is_little_time() -> None:
    assert course_deg((26, -26, 0, 2, 2.8)) == pytest.approx(0.0)
    assert course_deg((11, -11, 0, 2, 2.8)) > 0.0 or np.hypot(
        *POLICY.velocity(seen((11, -11, 0, 2, 2.8)))
    ) < np.hypot(*POLICY.velocity(seen()))


def test_a_candidate_that_leads_into_something_costs_more_than_any_that_does_not() -> None:
    buoy = (25.0, 0.0, 0.0, 0.0, 1.0)
    costs = candidate_costs(seen(buoy), AHEAD, SETTINGS)
    way = paths(seen(buoy), AHEAD, SETTINGS)
    reach = buoy[4] * SETTINGS.radius_factor + SETTINGS.own_radius_m
    touches = (np.hypot(way[..., 0] - 25.0, way[..., 1]) <= reach).any(axis=0)
    assert touches.any()
    assert costs[touches].min() > costs[~touches].min()


def test_the_hull_reaches_a_candidates_course_no_faster_than_it_can() -> None:
    way = paths(seen(), AHEAD, SETTINGS)
    velocity = np.diff(way, axis=0) / SETTINGS.step_s
    course = np.unwrap(np.arctan2(velocity[..., 1], velocity[..., 0]), axis=0)
    turn, share = candidates(SETTINGS)
    rate = np.abs(np.diff(course, axis=0))[:, share == 1.0] / SETTINGS.step_s
    assert rate.max() <= SETTINGS.turn_rate_radps + 1e-9
    np.testing.assert_allclose(course[-1][share == 1.0], turn[share == 1.0], atol=1e-9)


def test_it_is_loaded_by_name_for_any_hull() -> None:
    assert load_policy("sbmpc").name == "sbmpc"
    rates = load_policy("sbmpc", vessel=load_vessel("heron")).act(seen((30, 1, -2, 0, 2.8)))
    assert np.isfinite(rates).all()
