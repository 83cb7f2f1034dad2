"""What both baselines share: 25 actions, the cheapest wins, and radii as they count."""

import numpy as np
import pytest
from tests.harness import encounter

from twinscrew.runtime.errors import PolicyError
from twinscrew.runtime.policy.planners import Planner, PlannerSettings, seen_objects
from twinscrew.runtime.policy.vessel_model import action_set


class Turning(Planner):
    """Wants to look 0.2 rad to starboard; nothing else costs anything."""

    name = "turning"

    def costs(self, observation):
        return np.abs(self._simulate(observation, 2, 0.5).pose[-1, :, 2] - 0.2)


class Indifferent(Planner):
    """Everything costs the same."""

    name = "indifferent"

    def costs(self, observation):
        return np.zeros(25)


def test_the_cheapest_action_is_taken():
    still = encounter.observation((30, 0, 0, 0, 0, 0, 0))
    turning = encounter.observation((30, 0, 0, 0, 1.0, 0, 0))
    left, right = Turning(PlannerSettings()).act(still)
    assert left > right
    left, right = Turning(PlannerSettings()).act(turning)
    assert left < right


def test_where_all_cost_the_same_nothing_is_done():
    assert Indifferent(PlannerSettings()).act(encounter.observation()).tolist() == [0.0, 0.0]


def test_the_answer_is_the_callers_own():
    policy = Indifferent(PlannerSettings())
    policy.act(encounter.observation())[:] = 7.0
    assert policy.act(encounter.observation()).tolist() == action_set()[0].tolist()


def test_an_observation_that_is_not_finite_is_an_error():
    with pytest.raises(PolicyError, match="not finite"):
        Indifferent(PlannerSettings()).act(encounter.observation((np.nan, 0, 0, 0, 0, 0, 0)))


def test_objects_count_with_the_radius_that_they_are_taken_for():
    seen = encounter.observation(objects=[(5, 0, 0, 0, 0.8), (9, 0, 0, 0, 2.24)])
    rows = seen_objects(seen, PlannerSettings(radius_factor=1.25))
    assert rows[:, 4] == pytest.approx([1.0, 2.8])
    assert seen.objects[0, 4] == np.float32(0.8)
