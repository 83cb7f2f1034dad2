"""The potential field: its force against the potential's numerical gradient, and encounters."""

import math

import numpy as np
import pytest
from tests.harness import encounter

from twinscrew.runtime.errors import PolicyError
from twinscrew.runtime.policy.load import Policy
from twinscrew.runtime.policy.planners import (
    ApfPolicy,
    ApfSettings,
    attractive_force,
    repulsive_forces,
    total_force,
    virtual_obstacles,
)
from twinscrew.runtime.settings import load, shipped

SETTINGS = ApfSettings()


def potential(position, obstacle, radius, goal):
    """The paper's U_att + U_rep, with the distance between surfaces."""
    s = SETTINGS
    to_goal = np.hypot(*(goal - position))
    d = np.hypot(*(obstacle - position)) - radius
    rep = 0.5 * s.repulsion * (1 / d - 1 / s.reach_m) ** 2 * to_goal**2 if d <= s.reach_m else 0.0
    return 0.5 * s.attraction * to_goal**2 + rep


@pytest.mark.parametrize("seed", range(20))
def test_the_force_is_minus_the_gradient_of_the_potential(seed):
    rng = np.random.default_rng(seed)
    goal, obstacle = rng.uniform(-40, 40, 2), rng.uniform(-15, 15, 2)
    radius = float(np.hypot(*obstacle) - rng.uniform(1.0, 20.0))
    step = 1e-5
    gradient = [
        (potential(e, obstacle, radius, goal) - potential(-e, obstacle, radius, goal)) / (2 * step)
        for e in step * np.eye(2)
    ]
    force = attractive_force(goal, SETTINGS)
    force = force + repulsive_forces(obstacle[None], np.array([radius]), goal, SETTINGS)[0]
    assert force == pytest.approx(-np.array(gradient), rel=1e-4, abs=1e-3)


def test_the_goal_attracts_in_proportion_to_its_distance():
    assert attractive_force(np.array([3.0, -4.0]), SETTINGS).tolist() == [150.0, -200.0]


def test_a_moving_object_repels_only_while_it_is_approached():
    ego = (30, 0, 2, 0, 0, 0, 0)
    ahead = encounter.observation(ego, [(12, 0, 1, 0, 0.8)])
    faster = encounter.observation(ego, [(12, 0, 3, 0, 0.8)])
    assert total_force(ahead, SETTINGS)[0] < 1500.0
    assert total_force(faster, SETTINGS) == pytest.approx([1500.0, 0.0])


def test_what_stands_still_repels_wherever_the_vessel_goes():
    astern = encounter.observation((30, 0, 2, 0, 0, 0, 0), [(-12, 0, 0, 0, 0.8)])
    assert total_force(astern, SETTINGS)[0] > 1500.0


def test_padding_does_not_repel():
    assert total_force(encounter.observation(), SETTINGS) == pytest.approx([1500.0, 0.0])


def test_head_on_closes_the_other_vessels_starboard_side():
    seen = encounter.observation((30, 0, 2, 0, 0, 0, 0), [(15, 0, -2, 0, 2.8)])
    expected = [[15, -5], [15, -10], [15, -15], [15, -20]]
    assert virtual_obstacles(seen, SETTINGS)[:, :2] == pytest.approx(np.array(expected))


def test_crossing_closes_the_way_ahead_of_the_stand_on_vessel():
    seen = encounter.observation((30, 0, 2, 0, 0, 0, 0), [(10, 10, 0, -2, 2.8)])
    expected = [[10, 5], [10, 0], [10, -5], [10, -10]]
    assert virtual_obstacles(seen, SETTINGS)[:, :2] == pytest.approx(np.array(expected))


def test_a_buoy_has_no_virtual_obstacles():
    seen = encounter.observation((30, 0, 2, 0, 0, 0, 0), [(10, 0, 0, 0, 0.8)])
    assert len(virtual_obstacles(seen, SETTINGS)) == 0


def test_the_own_centre_on_an_obstacle_still_gives_a_finite_answer():
    seen = encounter.observation((30, 0, 2, 0, 0, 0, 0), [(0, 0, -1, 0, 2.8)])
    assert np.isfinite(ApfPolicy().act(seen)).all()


def test_an_observation_that_is_not_finite_is_an_error():
    with pytest.raises(PolicyError, match="not finite"):
        ApfPolicy().act(encounter.observation((math.nan, 0, 0, 0, 0, 0, 0)))


def test_open_water_is_crossed_at_full_speed():
    path = encounter.sail(ApfPolicy(), [(0, 0, 0)], [(60, 0)], 15.0)
    assert path[-1, 0, 0] > 38.0
    assert abs(path[-1, 0, 1]) < 0.5


def test_a_goal_abeam_within_the_turning_circle_is_reached():
    path = encounter.sail(ApfPolicy(), [(0, 0, 0)], [(20, 6)], 20.0)
    left = np.hypot(*(path[:, 0, :2] - (20, 6)).T)
    assert left.min() < 2.0


def test_near_the_goal_the_force_asks_for_less_speed():
    fast = encounter.observation((3, 0, 3, 0, 0, 1000, 1000))
    assert (ApfPolicy().act(fast) == [-1000.0, -1000.0]).all()


def test_it_passes_a_buoy_in_its_way_without_touching_it():
    buoy = (24.0, 1.0, 1.0)
    path = encounter.sail(ApfPolicy(), [(0, 0, 0)], [(50, 0)], 40.0, buoys=[buoy])
    assert path[-1, 0, 0] > 40.0
    apart = np.hypot(*(path[:, 0, :2] - buoy[:2]).T)
    assert apart.min() > encounter.RADIUS + buoy[2]


def test_two_vessels_that_meet_port_to_port_both_turn_to_starboard():
    goals = [(51.0, 0.0), (4.0, -3.0)]
    path = encounter.sail(ApfPolicy(), [(8, 0, 0), (47, -3, math.pi)], goals, 14.0)
    assert path[:, 0, 1].max() > 1.0
    assert path[:, 0, 1].min() > -0.5
    assert path[:, 1, 1].min() < -4.0
    assert path[:, 1, 1].max() < -2.5


def test_head_on_the_virtual_obstacles_push_to_starboard():
    seen = encounter.observation((30, 0, 2, 0, 0, 0, 0), [(14, 0, -2, 0, 2.8)])
    assert total_force(seen, SETTINGS)[1] > 50.0
    assert total_force(seen, ApfSettings(virtual_obstacles=0))[1] == pytest.approx(0.0, abs=1e-6)


def test_the_give_way_vessel_passes_astern():
    goals = [(50.0, 27.5), (27.5, 5.0)]
    starts = [(5, 27.5, 0), (27.5, 50, -math.pi / 2)]
    path = encounter.sail(ApfPolicy(), starts, goals, 20.0)
    crossed = np.argmax(path[:, 1, 1] < path[:, 0, 1])  # the stand-on vessel goes west past it
    assert path[crossed, 0, 0] < path[crossed, 1, 0]
    assert encounter.gap(path) > 0.5


def test_the_shipped_settings_are_the_defaults():
    assert load(shipped("policies", "apf"), ApfSettings) == SETTINGS


def test_it_is_a_policy():
    assert isinstance(ApfPolicy(), Policy)
