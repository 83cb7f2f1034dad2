"""Scans as public data sets give them: cars and poles are found, points are not thrown away."""

from __future__ import annotations

import math

import numpy as np
import pytest
from tests.harness import street
from tests.harness.street import CARS, POLES, StreetScan

from twinscrew.hil_sim.perceive.foreign import (
    HERE,
    LEVEL,
    Chosen,
    choose,
    find_surface,
    fitted,
    ground_below,
    objects_S,
)
from twinscrew.runtime.geometry import quaternion_from_euler
from twinscrew.runtime.geometry import rotation_from_quaternion as rotation
from twinscrew.runtime.messages.types import PointCloud
from twinscrew.runtime.perception.segmentation import Perception, PerceptionSettings, WaterSettings
from twinscrew.runtime.perception.sensor import Mount, load_sensor

FIRST_BODY = 2
"""The carrier and the ground come before the cars."""


def cloud_of(points: np.ndarray) -> PointCloud:
    points_S = points.astype(np.float32) * np.array([1, -1, -1], np.float32)
    return PointCloud(stamp_ns=0, frame_id="", points_S=points_S)


def perceived(scan: StreetScan, sensor: str, height: float, rings: bool = False) -> Chosen:
    water = WaterSettings(surface_m=-height, clearance_m=0.3)
    settings = PerceptionSettings(hull=None, water=water)
    ring = scan.ring if rings else None
    chosen = choose(cloud_of(scan.points), ring, load_sensor(sensor), settings)
    chosen.perception.step(cloud_of(scan.points), LEVEL)
    return chosen


def found(chosen: Chosen, scan: StreetScan) -> int:
    """Count cars and poles with an object that is theirs alone and has most of their echoes."""
    points, objects = chosen.perception.point_image(), chosen.perception.object_image()
    body, number = scan.body[points[points >= 0]], objects[points >= 0]
    count = 0
    for own in range(FIRST_BODY, FIRST_BODY + len(CARS) + len(POLES)):
        numbers = number[(body == own) & (number >= 0)]
        best = np.bincount(numbers).argmax() if len(numbers) else -1
        mine = (number == best) & (body == own)
        count += (
            mine.sum() > 0.9 * (body == own).sum() and mine.sum() > 0.9 * (number == best).sum()
        )
    return count


@pytest.mark.parametrize("rings", [True, False])
@pytest.mark.parametrize("sensor", ["os1_64", "hdl32e", "vlp16"])
def test_a_scan_like_kittis_is_not_thrown_away_by_another_sensors_description(
    sensor: str, rings: bool
) -> None:
    scan = street.like_kitti()
    chosen = perceived(scan, sensor, 1.73, rings)
    report = chosen.perception.report
    assert not chosen.fits
    assert report.used > 0.75 * (report.used + report.hidden + report.no_beam)
    assert found(chosen, scan) == len(CARS) + len(POLES)


@pytest.mark.parametrize(
    ("make", "sensor", "height"),
    [(street.like_nuscenes, "hdl32e", 1.84), (street.like_vlp16, "vlp16", 1.5)],
)
def test_a_described_sensors_scan_is_taken_as_described(make, sensor: str, height: float) -> None:
    scan = make()
    chosen = perceived(scan, sensor, height)
    assert chosen.fits
    assert chosen.perception.report.no_beam == 0
    assert found(chosen, scan) == len(CARS) + len(POLES)


def test_the_ground_is_found_where_there_is_one() -> None:
    points_S = street.like_nuscenes().points * np.array([1, -1, -1], np.float32)
    assert ground_below(points_S) == pytest.approx(1.84, abs=0.05)
    assert ground_below(np.empty((0, 3), np.float32)) is None
    spread = np.random.default_rng(0).uniform(-10, 10, (1000, 3)).astype(np.float32)
    assert ground_below(spread) is None


def test_a_million_points_are_perceived() -> None:
    points = np.random.default_rng(0).normal(0, 8, (1_000_000, 3))
    points[::1000] = np.nan
    chosen = choose(cloud_of(points), None, load_sensor("vlp16"), PerceptionSettings(hull=None))
    report = chosen.perception.report
    assert report.points == 1_000_000
    assert report.empty == 1000
    assert report.used > 0
    chosen.perception.segment()
    assert 0 < chosen.perception.objects().points.sum() <= report.used


# -- Images derived from points: the beams of data sets' sensors are found in their scans.

FRD = np.array([1, -1, -1], np.float32)


@pytest.mark.parametrize("rings", [True, False])
def test_the_beams_of_a_clean_scan_are_found(rings: bool) -> None:
    scan = street.like_nuscenes()
    first = fitted(scan.points * FRD, scan.ring if rings else None, load_sensor("vlp16"))[0]
    truth = load_sensor("hdl32e").elevations
    assert first.elevations == pytest.approx(truth, abs=np.radians(0.05))
    assert first.columns.count == pytest.approx(1084, rel=0.02)


def test_smeared_beams_become_even_rows_as_many_as_the_beams() -> None:
    scan = street.like_kitti()
    even = fitted(scan.points * FRD, None, load_sensor("os1_64"))[-1]
    assert len(even.elevations) == pytest.approx(64, abs=10)
    assert np.ptp(np.diff(even.elevations)) < 1e-9


def test_points_without_a_pattern_give_no_sensor() -> None:
    nothing = np.full((500, 3), np.nan, np.float32)
    nothing[:50] = 0.0
    assert fitted(nothing, None, load_sensor("vlp16")) == []
    straight_up = np.tile(np.float32([0, 0, -3]), (500, 1))
    assert fitted(straight_up, np.zeros(500, np.uint16), load_sensor("vlp16")) == []


# -- The ground or the water under a sensor that is not level.


def plane(
    roll: float,
    pitch: float,
    height: float = 1.9,
    count: int = 3000,
    seed: int = 0,
    rough: float = 0.03,
):
    """Points of a level plane as a tilted sensor sees them, (N, 3), frame S (FRD)."""
    rng = np.random.default_rng(seed)
    reach, bearing = rng.uniform(4.0, 19.0, count), rng.uniform(-math.pi, math.pi, count)
    down = height + rough * rng.standard_normal(count)
    p_N = np.column_stack([reach * np.cos(bearing), reach * np.sin(bearing), down])
    R_NS = rotation(quaternion_from_euler(roll, pitch, 0.0))
    return (p_N @ R_NS).astype(np.float32)


@pytest.mark.parametrize(("roll", "pitch"), [(0.0, 0.0), (0.08, -0.05), (-0.1, 0.1), (0.0, 0.15)])
@pytest.mark.parametrize("told", [1.7, 1.9, 2.2])
def test_attitude_and_height_are_found(roll: float, pitch: float, told: float) -> None:
    found = find_surface(plane(roll, pitch), told)
    R_NS, expected = rotation(found.q_NS), rotation(quaternion_from_euler(roll, pitch, 0.0))
    assert R_NS[2] == pytest.approx(expected[2], abs=0.003)  # down, seen from S
    assert found.height_m == pytest.approx(1.9, abs=0.02)
    assert found.tilt_rad == pytest.approx(math.acos(math.cos(roll) * math.cos(pitch)), abs=0.003)


def test_what_stands_on_it_does_not_lift_it() -> None:
    wall = plane(0.05, 0.0, count=2000, seed=1)
    wall[:, 2] -= np.random.default_rng(2).uniform(0.0, 3.0, len(wall)).astype(np.float32)
    found = find_surface(np.concatenate([plane(0.05, 0.0), wall]), 1.9)
    assert found.tilt_rad == pytest.approx(0.05, abs=0.01)


@pytest.mark.parametrize(
    "points",
    [
        np.empty((0, 3)),
        np.full((500, 3), np.nan),
        np.tile([3.0, 4.0, 1.9], (500, 1)),
        np.column_stack([np.linspace(3, 19, 500), np.zeros(500), np.full(500, 1.9)]),
        np.random.default_rng(0).uniform(-15, 0, (500, 3)),
    ],
    ids=["nothing", "no numbers", "one place", "one line", "all above"],
)
def test_where_there_is_no_surface_none_is_found(points: np.ndarray) -> None:
    assert find_surface(points.astype(np.float32), 1.9) is None


def test_a_rough_surface_is_one_too() -> None:
    found = find_surface(plane(0.05, 0.0, rough=0.1), 1.9)
    assert found.tilt_rad == pytest.approx(0.05, abs=0.005)


@pytest.mark.parametrize("seed", range(5))
def test_hulls_and_walls_without_a_surface_are_none(seed: int) -> None:
    rng = np.random.default_rng(seed)
    centre = rng.uniform(-13.0, 13.0, (12, 2)).repeat(300, axis=0)
    side = centre + rng.uniform(-1.0, 1.0, centre.shape)
    points = np.column_stack([side, rng.uniform(-0.5, 1.9, len(side))])
    assert find_surface(points.astype(np.float32), 1.9) is None


def test_a_height_that_is_far_off_is_not_believed() -> None:
    assert find_surface(plane(0.0, 0.0, height=3.5), 1.9) is None


@pytest.mark.parametrize("seed", range(10))
def test_clouds_without_any_pattern_are_perceived(seed: int) -> None:
    rng = np.random.default_rng(seed)
    points = rng.normal(0.0, 5.0, (int(rng.integers(300, 2000)), 3))
    for name in ("vlp16", "os1_64"):
        chosen = choose(cloud_of(points), None, load_sensor(name), PerceptionSettings(hull=None))
        assert chosen.perception.report.points == len(points)


def test_objects_stay_in_the_files_axes_wherever_the_sensor_sits() -> None:
    scan = street.like_vlp16()
    cloud, q_NS = cloud_of(scan.points), quaternion_from_euler(0.02, -0.03, 0.0)
    sensor = load_sensor("vlp16")
    alone = Perception(sensor.mounted(HERE), settings_over(1.5))
    mount = Mount(x_m=1.0, y_m=-0.5, z_m=2.0, roll_rad=0.05, pitch_rad=-0.1, yaw_rad=2.0)
    aboard = Perception(sensor.mounted(mount), settings_over(1.5 - 2.0))
    first, second = objects_S(alone, cloud, q_NS), objects_S(aboard, cloud, q_NS)
    for p in np.array([*CARS, *POLES]) * [1, -1]:
        distances = [np.hypot(*(found.p_L - p).T).min() for found in (first, second)]
        assert distances[0] == pytest.approx(distances[1], abs=0.3)


def settings_over(height_m: float) -> PerceptionSettings:
    water = WaterSettings(surface_m=-height_m, clearance_m=0.3)
    return PerceptionSettings(hull=None, water=water)


@pytest.mark.parametrize("sensor", ["vlp16", "os1_64"])
@pytest.mark.parametrize("rings", [True, False])
def test_points_at_random_that_no_sensor_takes_are_perceived_all_the_same(
    sensor: str, rings: bool
) -> None:
    rng = np.random.default_rng(0)
    for count in (100, 300, 700, 2000):
        for points in (rng.uniform(-20, 20, (count, 3)), rng.normal(0.0, 5.0, (count, 3))):
            ring = rng.integers(0, 65_535, count).astype(np.uint16) if rings else None
            chosen = choose(
                cloud_of(points), ring, load_sensor(sensor), PerceptionSettings(hull=None)
            )
            chosen.perception.step(cloud_of(points), LEVEL)
            assert chosen.perception.report.points == count
