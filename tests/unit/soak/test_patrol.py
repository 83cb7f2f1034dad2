import numpy as np

from twinscrew.hil_sim.faults.timeline import Span
from twinscrew.hil_sim.faults.waters import lanes
from twinscrew.hil_sim.soak.vessels import AGAIN_S, TURN_M, Patrol
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


def test_a_vessel_whose_fault_gives_the_goal_itself_is_given_none_meanwhile() -> None:
    world = make_world(lanes(2, 60.0))
    patrol = Patrol(world, [[Span(AGAIN_S - 1.0, AGAIN_S + 1.0)], []])
    assert patrol.goal_of(0) is None
    world.advance(AGAIN_S + 0.5, np.zeros((2, 2)))
    assert patrol.goal_of(0) is None
    assert patrol.goal_of(1) is not None
    world.advance(1.0, np.zeros((2, 2)))
    assert patrol.goal_of(0) is not None
