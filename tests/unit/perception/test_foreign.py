"""Scans as public data sets give them: cars and poles are found, points are not thrown away."""

import numpy as np
import pytest
from tests.harness import street
from tests.harness.street import CARS, POLES, StreetScan

from twinscrew.runtime.messages.types import PointCloud
from twinscrew.runtime.perception.foreign import LEVEL, Chosen, choose, ground_below
from twinscrew.runtime.perception.sensor import load_sensor
from twinscrew.runtime.perception.settings import PerceptionSettings, WaterSettings

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
