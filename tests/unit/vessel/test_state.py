"""Attitudes of many vessels agree with those of one."""

import numpy as np
from tests.reference.sailing import euler

from twinscrew.hil_sim.vessel.state import VesselState, level_quaternion
from twinscrew.runtime.geometry import quaternion_from_euler


def test_level_quaternions_have_heading_and_pitch_but_no_roll():
    q = level_quaternion(np.array([0.5, -3.0]), 0.1)
    zero = np.zeros((2, 3))
    state = VesselState(
        position_N=zero, q_NB=q, velocity_B=zero, rates_B=zero, thrust=np.zeros((2, 2))
    )
    np.testing.assert_allclose(euler(state), [[0, 0.1, 0.5], [0, 0.1, -3.0]], atol=1e-15)
    np.testing.assert_allclose(state.heading, [0.5, -3.0])
    assert state.count == 2


def test_a_level_quaternion_is_that_of_the_frames_module():
    q = level_quaternion(np.array([2.2]), -0.3)[0]
    np.testing.assert_allclose(q, quaternion_from_euler(0.0, -0.3, 2.2), atol=1e-15)
