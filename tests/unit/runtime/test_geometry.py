import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from twinscrew.runtime.geometry import (
    attitude_enu_flu_to_ned_frd,
    attitude_ned_frd_to_enu_flu,
    enu_to_ned,
    euler_from_quaternion,
    flu_to_frd,
    interpolate_quaternion,
    quaternion_from_euler,
    quaternion_product,
    rotation_2d,
    rotation_from_quaternion,
    wrap,
)

angles = st.floats(-math.pi, math.pi)
pitches = st.floats(-1.4, 1.4)


@given(st.floats(-1e4, 1e4))
def test_a_wrapped_angle_is_in_range_and_points_the_same_way(angle: float) -> None:
    wrapped = wrap(angle)
    assert -math.pi <= wrapped < math.pi
    assert math.cos(wrapped) == pytest.approx(math.cos(angle), abs=1e-9)
    assert math.sin(wrapped) == pytest.approx(math.sin(angle), abs=1e-9)


@given(angles, pitches, angles)
def test_euler_angles_survive_the_way_through_a_quaternion(
    roll: float, pitch: float, yaw: float
) -> None:
    back = euler_from_quaternion(quaternion_from_euler(roll, pitch, yaw))
    for found, meant in zip(back, (roll, pitch, yaw), strict=True):
        assert math.cos(found - meant) == pytest.approx(1.0, abs=1e-9)


@given(angles, pitches, angles)
def test_a_rotation_keeps_lengths_and_handedness(roll: float, pitch: float, yaw: float) -> None:
    R = rotation_from_quaternion(quaternion_from_euler(roll, pitch, yaw))
    np.testing.assert_allclose(R @ R.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(R) == pytest.approx(1.0)


@given(st.tuples(angles, pitches, angles), st.tuples(angles, pitches, angles))
def test_the_product_of_quaternions_is_the_product_of_rotations(
    first: tuple[float, float, float], second: tuple[float, float, float]
) -> None:
    p, q = quaternion_from_euler(*first), quaternion_from_euler(*second)
    np.testing.assert_allclose(
        rotation_from_quaternion(quaternion_product(p, q)),
        rotation_from_quaternion(p) @ rotation_from_quaternion(q),
        atol=1e-12,
    )


def test_a_vessel_heading_east_has_its_bow_in_the_east() -> None:
    q_NB = quaternion_from_euler(0.0, 0.0, math.pi / 2)
    np.testing.assert_allclose(rotation_from_quaternion(q_NB)[:, 0], [0, 1, 0], atol=1e-12)
    np.testing.assert_allclose(rotation_2d(math.pi / 2) @ [1, 0], [0, 1], atol=1e-12)


def test_ros_facing_east_is_heading_90_degrees() -> None:
    facing_east_in_enu = np.array([1.0, 0.0, 0.0, 0.0])
    q_NB = attitude_enu_flu_to_ned_frd(facing_east_in_enu)
    assert euler_from_quaternion(q_NB)[2] == pytest.approx(math.pi / 2)


@given(angles, pitches, angles)
def test_attitudes_come_back_from_ros_as_they_went(roll: float, pitch: float, yaw: float) -> None:
    q = quaternion_from_euler(roll, pitch, yaw)
    back = attitude_enu_flu_to_ned_frd(attitude_ned_frd_to_enu_flu(q))
    assert abs(float(back @ q)) == pytest.approx(1.0)


@given(angles, pitches, angles)
def test_attitude_and_vector_conversions_agree(roll: float, pitch: float, yaw: float) -> None:
    q_enu_flu = quaternion_from_euler(roll, pitch, yaw)
    v_flu = np.array([1.0, 2.0, 3.0])
    by_enu = enu_to_ned(rotation_from_quaternion(q_enu_flu) @ v_flu)
    by_ned = rotation_from_quaternion(attitude_enu_flu_to_ned_frd(q_enu_flu)) @ flu_to_frd(v_flu)
    np.testing.assert_allclose(by_ned, by_enu, atol=1e-12)


def test_interpolation_is_exact_at_both_ends_and_takes_the_short_way() -> None:
    q0, q1 = quaternion_from_euler(0, 0, 0.1), quaternion_from_euler(0, 0, 0.3)
    np.testing.assert_allclose(interpolate_quaternion(q0, q1, 0.0), q0, atol=1e-15)
    np.testing.assert_allclose(interpolate_quaternion(q0, q1, 1.0), q1, atol=1e-15)
    middle = interpolate_quaternion(q0, -q1, 0.5)
    assert euler_from_quaternion(middle)[2] == pytest.approx(0.2)
