from __future__ import annotations

import numpy as np
import pytest

from twinscrew.hil_sim.mooring import moor
from twinscrew.hil_sim.scene import rotations
from twinscrew.hil_sim.vessel.state import VesselState, level_quaternion

FREQUENCY = 0.5


def drift(state: VesselState, dt: float) -> VesselState:
    """Carry on without any force but the mooring's."""
    R = rotations(state.q_NB)
    return VesselState(
        position_N=state.position_N + dt * np.einsum("vij,vj->vi", R, state.velocity_B),
        q_NB=level_quaternion(state.heading + dt * state.rates_B[:, 2]),
        velocity_B=np.einsum(
            "vji,vj->vi", rotations(level_quaternion(dt * state.rates_B[:, 2])), state.velocity_B
        ),
        rates_B=state.rates_B,
        thrust=state.thrust,
    )


def arriving(speed: float, heading: float) -> VesselState:
    """Two vessels two metres short of (10, 20), moving ahead, heaving, turning."""
    ahead = np.array([np.cos(heading), np.sin(heading), 0.0])
    return VesselState(
        position_N=np.tile(np.array([10.0, 20.0, 0.1]) - 2 * ahead, (2, 1)),
        q_NB=level_quaternion(np.full(2, heading)),
        velocity_B=np.tile([speed, 0.0, 0.2], (2, 1)),
        rates_B=np.tile([0.1, -0.1, 0.4], (2, 1)),
        thrust=np.zeros((2, 2)),
    )


MOORED = np.array([True, False])
PLACE = np.array([[10.0, 20.0, 0.7], [0.0, 0.0, 0.0]])


@pytest.mark.slow
def test_a_moored_vessel_moves_as_a_critically_damped_oscillator() -> None:
    dt, heading, speed = 0.001, 0.7, 3.3
    state, along, turned = arriving(speed, heading), [], []
    ahead = np.array([np.cos(heading), np.sin(heading)])
    for _ in range(10_000):
        state = moor(drift(state, dt), rotations(state.q_NB), MOORED, PLACE, FREQUENCY, dt)
        along.append((state.position_N[0, :2] - PLACE[0, :2]) @ ahead)
        turned.append(state.heading[0] - heading)
    t = dt * np.arange(1, 10_001)
    expected = (-2.0 + (speed - 2.0 * FREQUENCY) * t) * np.exp(-FREQUENCY * t)
    np.testing.assert_allclose(along, expected, atol=0.005)
    np.testing.assert_allclose(turned, 0.4 * t * np.exp(-FREQUENCY * t), atol=0.001)


def test_it_still_heaves_rolls_and_pitches_but_turns_no_more() -> None:
    state = arriving(0.0, 0.7)
    held = moor(state, rotations(state.q_NB), MOORED, PLACE, FREQUENCY, 0.1)
    assert held.velocity_B[0, 2] == 0.2
    np.testing.assert_array_equal(held.rates_B[0, :2], [0.1, -0.1])
    assert held.rates_B[0, 2] == pytest.approx(0.4 / 1.1)


def test_the_others_are_left_alone() -> None:
    state = arriving(3.3, 1.0)
    held = moor(state, rotations(state.q_NB), MOORED, PLACE, FREQUENCY, 0.1)
    np.testing.assert_array_equal(held.velocity_B[1], state.velocity_B[1])
    np.testing.assert_array_equal(held.rates_B[1], state.rates_B[1])
    assert not np.array_equal(held.velocity_B[0], state.velocity_B[0])
