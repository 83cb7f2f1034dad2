from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from twinscrew.hil_sim.scenario import Scenario, load_scenario
from twinscrew.hil_sim.supervisor import Outcome, Supervisor, SupervisorSettings
from twinscrew.hil_sim.world import make_world

AHEAD = np.full((2, 2), 1000.0)
OFF = np.zeros((2, 2))
APART = np.array([[8.0, 10.0, 0.0], [8.0, 40.0, 0.0]])


def scenario(**changes: object) -> Scenario:
    """Two vessels side by side in a calm, heading north, their goals 20 m ahead."""
    defaults = {"sea": "calm", "starts": APART, "goals": APART[:, :2] + [20.0, 0.0]}
    return dataclasses.replace(load_scenario("head_on"), **(defaults | changes))


def watch(given: Scenario, **settings: str) -> Supervisor:
    return Supervisor(make_world(given), SupervisorSettings(**settings))  # type: ignore[arg-type]


def test_a_vessel_within_the_goal_radius_has_arrived() -> None:
    supervisor = watch(scenario())
    supervisor.advance(30.0, AHEAD)
    assert supervisor.over
    assert supervisor.success
    first, _ = supervisor.results()
    assert (first.name, first.outcome) == ("wamv1", Outcome.GOAL)
    # 18 m from rest to the circle, at 3.3 m/s at most.
    assert 18 / 3.4 < first.travel_time_s < 12.0
    assert first.travel_time_s == pytest.approx(supervisor.world.time_s)
    assert first.closest_approach_m == pytest.approx(30 - 5.6, abs=0.1)


def test_an_arrived_vessel_is_held_at_its_goal_while_others_go_on() -> None:
    goals = np.array([[16.0, 10.0], [500.0, 40.0]])  # near, so that the wind cannot blow it past
    supervisor = watch(scenario(goals=goals, sea="paper"))
    supervisor.advance(60.0, AHEAD)
    assert supervisor.outcomes == [Outcome.GOAL, None]
    assert np.linalg.norm(supervisor.world.state.position_N[0, :2] - goals[0]) < 1.0
    assert supervisor.world.present[0]


def test_an_arrived_vessel_can_vanish_as_in_training() -> None:
    goals = np.array([[28.0, 10.0], [500.0, 40.0]])
    supervisor = watch(scenario(goals=goals), after_goal="vanish")
    supervisor.advance(15.0, AHEAD)
    assert supervisor.outcomes[0] is Outcome.GOAL
    assert not supervisor.world.present[0]


def test_two_vessels_that_touch_both_have_a_collision() -> None:
    starts = np.array([[8.0, 20.0, 0.0], [30.0, 20.0, math.pi]])
    supervisor = watch(scenario(starts=starts, goals=starts[::-1, :2].copy()))
    supervisor.advance(30.0, AHEAD)
    assert supervisor.outcomes == [Outcome.COLLISION] * 2
    assert not supervisor.success
    first, second = supervisor.results()
    assert first.travel_time_s == second.travel_time_s < 10.0
    assert -0.1 < first.closest_approach_m <= 0.0
    assert not supervisor.world.present.any()


def test_a_wreck_can_be_left_in_the_way() -> None:
    starts = np.array([[8.0, 20.0, 0.0], [30.0, 20.0, math.pi]])
    supervisor = watch(
        scenario(starts=starts, goals=starts[::-1, :2].copy()), after_collision="stop"
    )
    supervisor.advance(30.0, AHEAD)
    assert supervisor.world.present.all()
    assert supervisor.world.moored.all()


def test_a_touch_between_two_decisions_is_not_missed() -> None:
    """A buoy's edge is grazed for less than a 0.5 s decision period."""
    graze = np.array([[20.0, 10.0 + 2.8 + 0.75 - 0.02, 0.75]])
    supervisor = watch(scenario(buoys=graze, goals=APART[:, :2] + [60.0, 0.0]))
    supervisor.advance(15.0, AHEAD)
    assert supervisor.outcomes[0] is Outcome.COLLISION
    assert -0.02 <= supervisor.world.closest_approach[0] <= 0.0


def test_who_hits_an_arrived_vessel_has_the_collision_alone() -> None:
    starts = np.array([[8.0, 20.0, 0.0], [60.0, 20.0, math.pi]])
    goals = np.array([[15.0, 20.0], [0.0, 20.0]])
    supervisor = watch(scenario(starts=starts, goals=goals))
    supervisor.advance(40.0, AHEAD)
    assert supervisor.outcomes == [Outcome.GOAL, Outcome.COLLISION]
    assert not supervisor.success


def test_a_vessel_that_takes_too_long_has_a_time_out() -> None:
    supervisor = watch(scenario(time_limit_s=5.0))
    supervisor.advance(4.99, OFF)
    assert supervisor.outcomes == [None, None]
    assert [r.travel_time_s for r in supervisor.results()] == [pytest.approx(4.99)] * 2
    supervisor.advance(1.0, OFF)
    assert supervisor.outcomes == [Outcome.TIMEOUT] * 2
    assert supervisor.over
    assert supervisor.world.time_s == pytest.approx(5.0)


def test_time_before_the_voyage_does_not_count() -> None:
    world = make_world(scenario(time_limit_s=5.0))
    world.advance(3.0, OFF)
    supervisor = Supervisor(world)
    supervisor.advance(4.0, OFF)
    assert supervisor.outcomes == [None, None]
    assert supervisor.elapsed_s == pytest.approx(4.0)


def test_an_outcome_is_final() -> None:
    supervisor = watch(scenario(time_limit_s=20.0, goals=np.array([[28.0, 10.0], [500.0, 40.0]])))
    supervisor.advance(25.0, AHEAD)
    assert supervisor.outcomes == [Outcome.GOAL, Outcome.TIMEOUT]


def test_a_lone_vessel_has_no_closest_approach() -> None:
    one = scenario(
        names=("wamv1",),
        types=("wam_v",),
        starts=APART[:1],
        goals=APART[:1, :2],
        thrust_limits=np.array([np.inf]),
    )
    supervisor = watch(one)
    supervisor.advance(0.1, OFF[:1])
    assert supervisor.results()[0].closest_approach_m == math.inf
