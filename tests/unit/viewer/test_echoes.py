"""Scans seen from above."""

import numpy as np
import pytest

from twinscrew.hil_sim.viewer.vessel import echoes_from_above
from twinscrew.runtime.geometry import quaternion_from_euler
from twinscrew.runtime.messages.types import Odometry, PointCloud
from twinscrew.runtime.perception.sensor import Mount, load_sensor

LEVEL_SENSOR = load_sensor("vrx32").mounted(Mount(x_m=1.0, y_m=0.0, z_m=2.0))


def cloud(points):
    return PointCloud(stamp_ns=0, frame_id="lidar", points_S=np.array(points, np.float32))


def odometry(roll=0.0, pitch=0.0, heading=0.0):
    return Odometry(
        stamp_ns=0,
        position_N=np.array([100.0, -50.0, 0.0]),
        q_NB=quaternion_from_euler(roll, pitch, heading),
        velocity_B=np.zeros(3),
        rates_B=np.zeros(3),
    )


def test_an_echo_ahead_of_a_vessel_that_heads_east_lies_east_of_it():
    p_cm = echoes_from_above(cloud([[4, 0, 0]]), odometry(heading=np.pi / 2), LEVEL_SENSOR)
    np.testing.assert_array_equal(p_cm, [[0, 500]])  # 4 m, and the sensor 1 m ahead


def test_an_echo_to_starboard_of_a_vessel_that_heads_north_lies_east_of_it():
    p_cm = echoes_from_above(cloud([[0, 3, 0]]), odometry(), LEVEL_SENSOR)
    np.testing.assert_array_equal(p_cm, [[100, 300]])


def test_a_rolling_vessel_does_not_shift_what_it_sees():
    roll = 0.3
    beside = np.array([0.0, 10.0 * np.cos(roll), -10.0 * np.sin(roll)])
    sensor = LEVEL_SENSOR.mounted(Mount(x_m=0.0, y_m=0.0, z_m=0.0))
    p_cm = echoes_from_above(cloud([beside]), odometry(roll=roll), sensor)
    np.testing.assert_array_equal(p_cm, [[0, 1000]])


def test_rays_without_an_echo_and_far_ones_are_left_out():
    points = [[np.inf, 0, 0], [np.nan, 0, 0], [1e5, 0, 0], [4, 0, 0]]
    p_cm = echoes_from_above(cloud(points), odometry(), LEVEL_SENSOR)
    np.testing.assert_array_equal(p_cm, [[500, 0]])


@pytest.mark.parametrize("count", [0, 1, 99, 100, 101, 1000, 12_345])
def test_a_large_scan_is_thinned_out_evenly(count):
    points = np.column_stack([np.linspace(1, 100, count), np.zeros(count), np.zeros(count)])
    p_cm = echoes_from_above(cloud(points.reshape(-1, 3)), odometry(), LEVEL_SENSOR, most=100)
    assert len(p_cm) <= 100
    assert len(p_cm) >= min(count, 51)
    if count > 100:
        assert p_cm[-1, 0] > 9_000, "the far end is seen too"
