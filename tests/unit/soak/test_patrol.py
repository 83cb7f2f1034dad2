import numpy as np

from twinscrew.hil_sim.faults.waters import lanes
from twinscrew.hil_sim.soak.patrol import AGAIN_S, TURN_M, Patrol
from twinscrew.hil_sim.world import make_world


def test_a_vessel_is_sent_back_at_each_end_of_its_lane() -> None:
    scenario = lanes(2, 60.0)
    world = make_world(scenario)
    patrol = Patrol(world)
    assert patrol.goal_of(1) is None
    world.state.position_N[1, :2] = scenario.goals[1] - (TURN_M - 1.0, 0.0)
    assert np.array_equal(patrol.goal_of(1), scenario.starts[1, :2])
    assert patrol.goal_of(1) is None
    world.state.position_N[1, :2] = scenario.starts[1, :2] + (TURN_M - 1.0, 0.0)
    assert np.array_equal(patrol.goal_of(1), scenario.goals[1])
    assert patrol.turns == [0, 2]


def test_a_goal_is_given_again_because_a_fault_may_have_swallowed_it() -> None:
    scenario = lanes(1, 60.0)
    world = make_world(scenario)
    patrol = Patrol(world)
    world.advance(AGAIN_S + 0.1, np.zeros((1, 2)))
    assert np.array_equal(patrol.goal_of(0), scenario.goals[0])
    assert patrol.goal_of(0) is None
    assert patrol.turns == [0]
