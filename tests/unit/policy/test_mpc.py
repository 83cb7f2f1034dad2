"""Predictive control: its cost terms by hand, and encounters."""

import math

import numpy as np
import pytest
from tests.harness import encounter

from twinscrew.runtime.errors import PolicyError
from twinscrew.runtime.policy.load import Policy
from twinscrew.runtime.policy.planners import (
    MpcPolicy,
    MpcSettings,
    collision_cost,
    colregs_cost,
    effort_cost,
    goal_cost,
)
from twinscrew.runtime.policy.vessel_model import Rollout
from twinscrew.runtime.settings import load, shipped

SETTINGS = MpcSettings()


def future(speed=0.0, heading=0.0, thrust=0.0):
    """One action under which the vessel keeps its speed and heading."""
    time = SETTINGS.step_s * np.arange(1, SETTINGS.steps + 1)
    pose = np.zeros((SETTINGS.steps, 1, 3))
    pose[:, 0, 0], pose[:, 0, 1] = (
        speed * time * math.cos(heading),
        speed * time * math.sin(heading),
    )
    pose[:, 0, 2] = heading
    nu = np.zeros((SETTINGS.steps, 1, 3))
    nu[..., 0] = speed
    return Rollout(pose=pose, nu=nu, thrust=np.full((SETTINGS.steps, 1, 2), thrust))


def test_the_goal_cost_is_the_angle_less_a_share_of_the_speed():
    cost = goal_cost(future(speed=2.0, heading=0.3), np.array([1e6, 0.0]), SETTINGS)
    assert cost == pytest.approx([20 * (0.3 - 0.7 * 2.0 * math.cos(0.3))], abs=1e-3)


def test_effort_costs_the_impulse():
    assert effort_cost(future(thrust=-400.0), SETTINGS) == pytest.approx([0.0005 * 800 * 4.0])


def test_an_object_whose_surface_stays_4_m_off_costs_nothing():
    objects = np.array([[5.0 + SETTINGS.own_radius_m, 0.0, 0.0, 0.0, 1.0]])
    assert collision_cost(future(), objects, SETTINGS) == pytest.approx(np.array([[0.0]]))


def test_a_near_object_costs_what_it_lacks_in_distance_times_the_risk():
    objects = np.array([[0.0, 3.0 + 1.0 + SETTINGS.own_radius_m, 0.0, 0.0, 1.0]])
    expected = 1.0 * (4 / 3) ** 4
    assert collision_cost(future(), objects, SETTINGS) == pytest.approx(np.array([[expected]]))


def test_a_contact_later_costs_less_than_one_now():
    approaching = np.array([[9.0, 0.0, -4.0, 0.0, 1.0], [3.0, 0.0, 0.0, 0.0, 1.0]])
    later, now = collision_cost(future(), approaching, SETTINGS)[0]
    assert 10.0 < later < now


def test_head_on_a_course_to_starboard_costs_less_than_one_to_port():
    other = np.array([[22.0, 0.0, -2.0, 0.0, 2.8]])
    costs = [float(colregs_cost(future(2.0, h), other, SETTINGS)[0, 0]) for h in (-0.3, 0.0, 0.3)]
    assert costs[0] > costs[1] > costs[2]


def test_stopping_is_no_way_out_of_the_rules():
    other = np.array([[16.0, 0.0, -2.0, 0.0, 2.8]])
    assert colregs_cost(future(0.0), other, SETTINGS)[0, 0] > 1.0


def test_it_turns_for_a_buoy_in_its_way_and_does_not_touch_it():
    buoy = (24.0, 0.5, 1.0)
    path = encounter.sail(MpcPolicy(), [(0, 0, 0)], [(50, 0)], 25.0, buoys=[buoy])
    assert path[-1, 0, 0] > 40.0
    apart = np.hypot(*(path[:, 0, :2] - buoy[:2]).T)
    assert apart.min() > encounter.RADIUS + buoy[2]


def test_the_stand_on_vessel_is_not_charged():
    from_port = np.array([[10.0, -10.0, 0.0, 2.0, 2.8]])
    assert colregs_cost(future(2.0), from_port, SETTINGS)[0, 0] == 0.0


def test_bringing_a_vessel_from_port_to_starboard_costs():
    other = np.array([[6.0, -1.0, 0.6, 0.0, 2.8]])
    ahead, to_port = (colregs_cost(future(0.0, h), other, SETTINGS)[0, 0] for h in (0.0, -0.5))
    assert ahead == 0.0
    assert to_port == pytest.approx(SETTINGS.transition_cost)


def test_a_buoy_is_under_no_rules():
    buoy = np.array([[6.0, -1.0, 0.1, 0.0, 0.8]])
    assert colregs_cost(future(2.0, -0.5), buoy, SETTINGS)[0, 0] == 0.0


def test_what_counts_is_the_worst_object():
    policy, near, far = MpcPolicy(), (7, 2, 0, 0, 0.8), (-9, 2, 0, 0, 0.8)
    both = policy.costs(encounter.observation(objects=[near, far]))
    one = policy.costs(encounter.observation(objects=[near]))
    assert (both >= one - 1e-9).all()
    assert both[0] == pytest.approx(one[0])


def test_an_observation_that_is_not_finite_is_an_error():
    with pytest.raises(PolicyError, match="not finite"):
        MpcPolicy().act(encounter.observation((math.nan, 0, 0, 0, 0, 0, 0)))


def test_open_water_is_crossed_at_full_speed():
    path = encounter.sail(MpcPolicy(), [(0, 0, 0)], [(60, 0)], 15.0)
    assert path[-1, 0, 0] > 38.0
    assert abs(path[-1, 0, 1]) < 0.5


@pytest.mark.parametrize("offset", [0.0, -1.0, 1.0])
def test_head_on_both_vessels_turn_to_starboard(offset):
    starts = [(8, 0, 0), (47, offset, math.pi)]
    path = encounter.sail(MpcPolicy(), starts, [(60.0, 0.0), (-5.0, offset)], 13.0)
    assert path[:, 0, 1].max() > 1.0
    assert path[:, 0, 1].min() > -0.5
    assert path[:, 1, 1].min() < offset - 1.0
    assert path[:, 1, 1].max() < offset + 0.5
    assert encounter.gap(path) > 0.0


def test_the_give_way_vessel_passes_astern():
    starts = [(5, 27.5, 0), (27.5, 50, -math.pi / 2)]
    path = encounter.sail(MpcPolicy(), starts, [(50.0, 27.5), (27.5, -5.0)], 16.0)
    crossed = np.argmax(path[:, 1, 1] < path[:, 0, 1])  # the stand-on vessel goes west past it
    assert path[crossed, 0, 0] < path[crossed, 1, 0]
    assert encounter.gap(path) > 0.0


def test_the_shipped_settings_are_the_defaults():
    assert load(shipped("policies", "mpc"), MpcSettings) == SETTINGS


def test_it_is_a_policy():
    assert isinstance(MpcPolicy(), Policy)
