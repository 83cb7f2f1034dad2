"""What an inertial sensor on board feels between two states of the simulator."""

import numpy as np
import pytest

from twinscrew.hil_sim.bridges.inertial import GRAVITY_MPS2, Moment, moment, motion_between
from twinscrew.hil_sim.scenario import load_scenario
from twinscrew.hil_sim.world import make_world
from twinscrew.runtime.geometry import (
    quaternion_from_euler,
    quaternion_product,
    rotation_from_quaternion,
)


def at(
    time_s: float,
    velocity_N=(0.0, 0.0, 0.0),
    euler=(0.0, 0.0, 0.0),
    position_N=(0.0, 0.0, 0.0),
    rates_B=(0.0, 0.0, 0.0),
) -> Moment:
    q_NB = tuple(quaternion_from_euler(*euler).tolist())
    return Moment(time_s, position_N, q_NB, velocity_N, rates_B)


def between(before: Moment, after: Moment, fraction: float):
    time_s = before.time_s + fraction * (after.time_s - before.time_s)
    return motion_between(before, after, time_s, time_s)


def test_at_rest_it_feels_gravity_from_below() -> None:
    motion = between(at(0.0), at(0.01), 0.5)
    assert motion.specific_force_B == pytest.approx((0.0, 0.0, -GRAVITY_MPS2))


def test_falling_freely_it_feels_nothing() -> None:
    motion = between(at(0.0), at(0.01, velocity_N=(0.0, 0.0, 0.01 * GRAVITY_MPS2)), 0.5)
    assert motion.specific_force_B == pytest.approx((0.0, 0.0, 0.0), abs=1e-12)


@pytest.mark.parametrize(
    ("euler", "felt"),
    [
        ((0.0, np.pi / 2, 0.0), (GRAVITY_MPS2, 0.0, 0.0)),  # bow up: pressed forward from astern
        ((np.pi / 2, 0.0, 0.0), (0.0, -GRAVITY_MPS2, 0.0)),  # starboard down
        ((0.0, 0.0, 1.0), (0.0, 0.0, -GRAVITY_MPS2)),  # the heading does not matter
    ],
)
def test_gravity_turns_with_the_boat(euler, felt) -> None:
    motion = between(at(0.0, euler=euler), at(0.01, euler=euler), 1.0)
    assert motion.specific_force_B == pytest.approx(felt, abs=1e-12)


def test_acceleration_to_the_east_is_felt_ahead_when_the_bow_points_east() -> None:
    east = (0.0, 0.0, np.pi / 2)
    motion = between(at(0.0, euler=east), at(0.01, (0.0, 0.02, 0.0), east), 1.0)
    assert motion.specific_force_B == pytest.approx((2.0, 0.0, -GRAVITY_MPS2))


def test_at_the_ends_of_a_step_it_is_the_simulators_state() -> None:
    before = at(0.0, (1.0, 0.0, 0.0), (0.1, 0.0, 3.1), (5.0, 6.0, 7.0), (0.1, 0.2, 0.3))
    after = at(0.01, (2.0, 0.5, 0.0), (0.1, 0.0, -3.1), (5.1, 6.1, 7.1), (0.2, 0.1, 0.4))
    for end, fraction in ((before, 0.0), (after, 1.0)):
        motion = between(before, after, fraction)
        assert motion.velocity_N == pytest.approx(end.velocity_N)
        assert motion.position_N == pytest.approx(end.position_N)
        assert motion.rates_B == pytest.approx(end.rates_B)
        turned = rotation_from_quaternion(np.array(motion.q_NB))
        assert turned == pytest.approx(rotation_from_quaternion(np.array(end.q_NB)))


def test_through_south_it_turns_the_short_way() -> None:
    motion = between(at(0.0, euler=(0, 0, 3.1)), at(0.01, euler=(0, 0, -3.1)), 0.5)
    forward = rotation_from_quaternion(np.array(motion.q_NB))[:, 0]
    assert forward == pytest.approx([-1.0, 0.0, 0.0], abs=1e-9)


def test_two_equal_moments_are_a_boat_that_does_not_accelerate() -> None:
    now = at(3.0, velocity_N=(1.0, 0.0, 0.0))
    motion = motion_between(now, now, 3.0, 0.001)
    assert motion.velocity_N == (1.0, 0.0, 0.0)
    assert motion.specific_force_B == pytest.approx((0.0, 0.0, -GRAVITY_MPS2))
    assert motion.time_s == 0.001


def test_integrating_what_is_felt_gives_the_simulators_course_again() -> None:
    """Dead reckoning, as a strapdown filter does it: 3 s ahead and turning in waves."""
    world = make_world(load_scenario("random", 1, 0, 3), seed=3)
    rate = 10
    before = moment(world.state, 0, world.time_s)
    velocity, position = np.array(before.velocity_N), np.array(before.position_N)
    q_NB = np.array(before.q_NB)
    for _ in range(300):
        world.advance(0.01, np.array([[400.0, 100.0]]))
        after = moment(world.state, 0, world.time_s)
        for k in range(rate):
            motion = between(before, after, (k + 0.5) / rate)
            force_N = rotation_from_quaternion(q_NB) @ motion.specific_force_B
            velocity += (force_N + np.array([0.0, 0.0, GRAVITY_MPS2])) * 0.01 / rate
            position += velocity * 0.01 / rate
            turn = quaternion_from_euler(*(np.array(motion.rates_B) * 0.01 / rate))
            q_NB = quaternion_product(q_NB, turn)
        before = after
    assert world.state.velocity_B[0, 0] > 0.5, "it must have moved"
    assert abs(q_NB @ before.q_NB) == pytest.approx(1.0, abs=1e-5)
    assert velocity == pytest.approx(before.velocity_N, abs=0.01)
    assert position == pytest.approx(before.position_N, abs=0.02)
