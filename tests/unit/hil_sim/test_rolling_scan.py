"""Scans of sensors that take their time, while the vessel turns and moves."""

from __future__ import annotations

import dataclasses

import msgspec
import numpy as np

from twinscrew.hil_sim.bodies import Bodies
from twinscrew.hil_sim.lidar import Lidar, LidarSettings, Scan
from twinscrew.hil_sim.shapes import Shape, load_shape, vessel_shape
from twinscrew.runtime.messages.types import Float64
from twinscrew.runtime.perception.segmentation import Perception
from twinscrew.runtime.perception.sensor import Mount, Sensor, load_sensor
from twinscrew.runtime.vessel_description import load_vessel

NOW = 1_000_000_000
PLACE = np.array([12.0, -5.0])
RADIUS = 0.4
YAW_RATE = 0.8
SPEED = 3.0
LEVEL = np.array([1.0, 0.0, 0.0, 0.0])


def turning_sensor() -> Sensor:
    sensor = load_sensor("vlp16").mounted(Mount(x_m=0.43, y_m=0.0, z_m=1.93))
    return msgspec.structs.replace(sensor, noise_sigma_m=0.0)


def pillar() -> Shape:
    return dataclasses.replace(
        load_shape("light_buoy"),
        kinds=np.array([1], dtype=np.int32),
        centres=np.zeros((1, 3)),
        rotations=np.array([[[0.0, 0, 1], [0, 1, 0], [-1, 0, 0]]]),
        halves=np.array([[4.0, RADIUS, RADIUS]]),
    )


def scan(yaw_rate: float = YAW_RATE, speed: float = SPEED) -> Scan:
    """A vessel at the origin, heading north, and a pillar."""
    bodies = Bodies(
        shape=np.array([0, 1], dtype=np.int32),
        position_N=np.array([[0.0, 0.0, 0.0], [*PLACE, 0.0]]),
        R_NB=np.array([np.eye(3)] * 2),
        water_z=np.full(2, 10.0),
        velocity_N=np.array([[speed, 0.0, 0.0], [0.0, 0.0, 0.0]]),
        rates_B=np.array([[0.0, 0.0, yaw_rate], [0.0, 0.0, 0.0]]),
    )
    lidar = Lidar(turning_sensor(), LidarSettings(), [vessel_shape(load_vessel()), pillar()])
    return lidar.scan(bodies, 0, NOW, np.random.default_rng(0))


def distance_to_pillar(found: Scan, time_s: Float64) -> Float64:
    """Horizontal distance of each pillar point from the axis, seen from the pose at each time."""
    seen = found.object_ids == 1
    p_B = found.cloud.points_S[seen, :2] + [0.43, 0.0]
    yaw, north = YAW_RATE * time_s[seen], SPEED * time_s[seen]
    p_N = np.column_stack(
        [
            north + np.cos(yaw) * p_B[:, 0] - np.sin(yaw) * p_B[:, 1],
            np.sin(yaw) * p_B[:, 0] + np.cos(yaw) * p_B[:, 1],
        ]
    )
    distance: Float64 = np.hypot(*(p_N - PLACE).T)
    return distance


def after_now(found: Scan) -> Float64:
    """When each point was taken, in seconds after the scan's end."""
    assert found.cloud.time_offset_s is not None
    return found.cloud.time_offset_s + (found.cloud.stamp_ns - NOW) * 1e-9


def test_each_point_lies_on_the_object_as_seen_when_it_was_fired() -> None:
    found = scan()
    distance = distance_to_pillar(found, after_now(found))
    assert len(distance) > 50
    # A slice is 3 ms long: half of it is 1.3 mrad of the yaw at 13 m, and 5 mm of way.
    np.testing.assert_allclose(distance, RADIUS, atol=0.025)
    at_once = distance_to_pillar(found, np.zeros(len(found.object_ids)))
    assert np.abs(at_once - RADIUS).max() > 0.2


def test_the_scan_ends_now_and_its_stamp_is_the_sensors() -> None:
    found = scan()
    time_s = after_now(found)
    assert time_s.max() <= 1e-9
    assert time_s.min() >= -0.1
    # vlp16 stamps the first firing of a turn of 0.1 s.
    assert found.cloud.stamp_ns == NOW - 100_000_000


def test_perception_takes_the_motion_out_again() -> None:
    found, still = scan(), scan(yaw_rate=0.0, speed=0.0)
    perception = Perception(turning_sensor())
    rates, velocity = np.array([0.0, 0.0, YAW_RATE]), np.array([SPEED, 0.0, 0.0])
    truth = perception.step(still.cloud, LEVEL).p_L[0]
    undone = perception.step(found.cloud, LEVEL, rates, velocity).p_L[0]
    # At the stamp the vessel was 0.1 s short of the present pose.
    c, s = np.cos(-0.1 * YAW_RATE), np.sin(-0.1 * YAW_RATE)
    undone_N = np.array([-0.1 * SPEED, 0.0]) + np.array([[c, -s], [s, c]]) @ undone
    np.testing.assert_allclose(undone_N, truth, atol=0.05)
    naive = perception.step(found.cloud, LEVEL).p_L[0]
    assert np.linalg.norm(naive - undone) > 0.3


def test_without_motion_a_slow_scan_is_the_same_as_one_taken_at_once() -> None:
    slow = scan(yaw_rate=0.0, speed=0.0)
    sensor = msgspec.structs.replace(turning_sensor(), scan_duration_s=0.0)
    lidar = Lidar(sensor, LidarSettings(), [vessel_shape(load_vessel()), pillar()])
    bodies = Bodies(
        shape=np.array([0, 1], dtype=np.int32),
        position_N=np.array([[0.0, 0.0, 0.0], [*PLACE, 0.0]]),
        R_NB=np.array([np.eye(3)] * 2),
        water_z=np.full(2, 10.0),
    )
    at_once = lidar.scan(bodies, 0, NOW, np.random.default_rng(0))
    np.testing.assert_array_equal(slow.cloud.points_S, at_once.cloud.points_S)
    assert at_once.cloud.time_offset_s is None
    assert at_once.cloud.stamp_ns == NOW
