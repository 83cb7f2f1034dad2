from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from twinscrew.hil_sim.bodies import Bodies, turns
from twinscrew.runtime.geometry import quaternion_from_euler, rotation_from_quaternion

angles = st.floats(-3.0, 3.0)


@pytest.mark.parametrize("axis", range(3))
def test_a_turn_about_an_axis_is_the_euler_turn(axis: int) -> None:
    for angle in (0.0, 1e-9, 0.3, -2.0):
        vector = np.zeros(3)
        vector[axis] = angle
        expected = rotation_from_quaternion(quaternion_from_euler(*vector))
        np.testing.assert_allclose(turns(vector[None])[0], expected, atol=1e-12)


@given(x=angles, y=angles, z=angles)
def test_turns_are_rotations_that_keep_their_axis(x: float, y: float, z: float) -> None:
    vector = np.array([x, y, z])
    R = turns(vector[None])[0]
    np.testing.assert_allclose(R @ R.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(R) == pytest.approx(1.0)
    np.testing.assert_allclose(R @ vector, vector, atol=1e-12)
    assert np.trace(R) == pytest.approx(1 + 2 * math.cos(np.linalg.norm(vector)), abs=1e-9)


def test_bodies_carry_on_with_their_velocity_and_rates() -> None:
    bodies = Bodies(
        shape=np.zeros(2, dtype=np.int32),
        position_N=np.array([[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]),
        R_NB=np.array([np.eye(3)] * 2),
        water_z=np.zeros(2),
        velocity_N=np.array([[10.0, 0.0, 0.0], [0.0, 0.0, 0.0]]),
        rates_B=np.array([[0.0, 0.0, 0.5], [0.0, 0.0, 0.0]]),
    )
    later = bodies.moved(-0.2)
    np.testing.assert_allclose(later.position_N, [[-1.0, 2.0, 3.0], [4.0, 5.0, 6.0]])
    bow = later.R_NB[:, :, 0]
    np.testing.assert_allclose(bow, [[math.cos(0.1), -math.sin(0.1), 0], [1, 0, 0]], atol=1e-15)
