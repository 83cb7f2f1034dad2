"""Attitudes of many vessels agree with those of one."""

import numpy as np
from tests.reference.sailing import euler

from twinscrew.hil_sim.vessel.state import VesselState, level_quaternion, rotation
from twinscrew.runtime.geometry.frames import quaternion_from_euler, rotation_from_quaternion


def test_rotations_of_a_batch_are_those_of_each():
    q = np.array([quaternion_from_euler(0.1, -0.2, 2.5), quaternion_from_euler(-0.4, 0.3, -1.0)])
    for R, each in zip(rotation(q), q, strict=True):
        np.testing.assert_allclose(R, rotation_from_quaternion(each), atol=1e-15)


def test_level_quaternions_have_heading_and_pitch_but_no_roll():
    q = level_quaternion(np.array([0.5, -3.0]), 0.1)
    zero = np.zeros((2, 3))
    state = VesselState(
        position_N=zero, q_NB=q, velocity_B=zero, rates_B=zero, thrust=np.zeros((2, 2))
    )
    np.testing.assert_allclose(euler(state), [[0, 0.1, 0.5], [0, 0.1, -3.0]], atol=1e-15)
    np.testing.assert_allclose(state.heading, [0.5, -3.0])
    assert state.count == 2
