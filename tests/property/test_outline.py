"""The outline, and the free water it shows, are those of the plain references, in any scene."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.reference import free_water as water_reference
from tests.reference import outline as outline_reference

from twinscrew.runtime._native import FreeWater, nearest_circles
from twinscrew.runtime.geometry.frames import quaternion_from_euler, rotation_from_quaternion
from twinscrew.runtime.messages.types import PointCloud
from twinscrew.runtime.perception.kernel import SECTOR_RAD
from twinscrew.runtime.perception.sensor import Beams, Columns, Mount, Sensor
from twinscrew.runtime.perception.settings import PerceptionSettings
from twinscrew.runtime.perception.stage import Perception

OPEN = PerceptionSettings(hull=None, water=None, min_points=2)
MOUNTS = [
    Mount(x_m=0.4, y_m=0.0, z_m=2.0),
    Mount(x_m=-1.0, y_m=0.3, z_m=1.5, roll_rad=0.1, pitch_rad=-0.15, yaw_rad=2.0),
]
COLUMNS = [2, 3, 7, 240, 721, 1000]
"""1000 do not come in whole sectors, of 1 or of 2 columns; 2, 3 and 7 are wider than sectors."""


def sensor(columns: int, wraps: bool, mount: Mount) -> Sensor:
    span = 2 * math.pi if wraps else 2.4
    return Sensor(
        name="test",
        beams=Beams(count=4, lowest_rad=-0.15, highest_rad=0.1),
        columns=Columns(count=columns, first_rad=-span / 2, span_rad=span, endpoint=not wraps),
        rate_hz=10.0,
        scan_duration_s=0.0,
        range_min_m=0.5,
        range_max_m=50.0,
        noise_sigma_m=0.01,
        mount=mount,
    )


def scene(rng: np.random.Generator, s: Sensor) -> np.ndarray:
    """Give echoes of flat things, short and long, some before others, some beyond the range."""
    columns = s.columns.count
    ranges = np.full((len(s.elevations), columns), np.inf)
    for _ in range(rng.integers(0, 7)):
        count = rng.integers(1, max(columns // 3, 2))
        across = (rng.integers(columns) + np.arange(count)) % columns
        low = rng.integers(len(ranges))
        away = rng.uniform(2.0, 23.0) + rng.uniform(-8.0, 8.0) / columns * np.arange(count)
        ranges[low:, across] = np.minimum(ranges[low:, across], np.maximum(away, 0.8))
    ranges[rng.random(ranges.shape) < rng.choice([0.0, 0.05])] = np.inf
    seen = np.isfinite(ranges)
    return (s.directions_S()[seen] * ranges[seen][:, None]).astype(np.float32)


@given(
    seed=st.integers(0, 10**6),
    columns=st.sampled_from(COLUMNS),
    wraps=st.booleans(),
    mount=st.sampled_from(MOUNTS),
    roll=st.floats(-0.4, 0.4),
    pitch=st.floats(-0.4, 0.4),
    yaw=st.floats(-3.0, 3.0),
)
@settings(max_examples=80, deadline=None)
def test_the_outline_is_that_of_the_plain_reference(
    seed: int, columns: int, wraps: bool, mount: Mount, roll: float, pitch: float, yaw: float
) -> None:
    s = sensor(columns, wraps, mount)
    points_S = scene(np.random.default_rng(seed), s)
    perception = Perception(s, OPEN)
    cloud = PointCloud(stamp_ns=0, frame_id="s", points_S=points_S)
    objects = perception.step(cloud, quaternion_from_euler(roll, pitch, yaw))
    found = objects.outline
    assert found is not None
    R_LB = rotation_from_quaternion(quaternion_from_euler(roll, pitch, 0.0))
    places = np.append(points_S, np.zeros((1, 3)), axis=0)[perception.point_image()]
    sector = max(min(round(SECTOR_RAD / s.azimuth_step), s.image_shape[1] // 2), 1)
    ends, seen = outline_reference.outline(
        perception.range_image().astype(float),
        perception.object_image(),
        ((places @ s.R_BS.T + s.mount_position_B) @ R_LB.T)[..., :2],
        found.cut_from,
        s,
        R_LB,
        sector,
        OPEN.max_range_m,
    )
    assert found.sights_B == pytest.approx(ends, abs=1e-4)
    assert found.seen.tolist() == seen.tolist()
    assert found.sensor_B == pytest.approx((R_LB @ s.mount_position_B)[:2], abs=1e-6)
    assert found.sector_rad == pytest.approx(sector * s.azimuth_step)
    assert found.is_closed is wraps
    assert len(found.cut_from) == len(objects.radius)


@given(
    seed=st.integers(0, 10**6),
    sectors=st.sampled_from([2, 3, 5, 60, 721]),
    share=st.floats(0.1, 1.0),
    guard=st.floats(0.0, 0.3),
    margin=st.floats(0.0, 2.0),
)
@settings(max_examples=80, deadline=None)
def test_the_free_water_is_that_of_the_plain_reference(
    seed: int, sectors: int, share: float, guard: float, margin: float
) -> None:
    rng, begin = np.random.default_rng(seed), np.array([0.4, -0.2])
    is_closed, sector = share > 0.9, (1.0 if share > 0.9 else share) * 2 * math.pi / sectors
    azimuth = rng.uniform(-3.0, 3.0) + sector * (np.arange(sectors) + rng.normal(0, 0.3, sectors))
    ray = np.column_stack([np.cos(azimuth), np.sin(azimuth)])
    sights = begin + rng.uniform(0.5, 20.0, (sectors, 1)) * ray
    places = begin + rng.normal(0.0, 8.0, (300, 2))
    free = water_reference.free(sights, begin, sector, guard, is_closed)
    expected = water_reference.holds(free, begin, places, margin)
    water = FreeWater(
        sights=sights, begin=begin.tolist(), sector=sector, guard=guard, is_closed=is_closed
    )
    assert water.holds(places, margin).tolist() == expected.tolist()


@pytest.mark.parametrize(
    ("sector", "guard", "begin", "words"),
    [
        (0.0, 0.1, [0.0, 0.0], "sector's width"),
        (math.nan, 0.1, [0.0, 0.0], "sector's width"),
        (0.1, -0.1, [0.0, 0.0], "negative guard"),
        (0.1, 0.1, [math.nan, 0.0], "begins somewhere"),
    ],
)
def test_free_water_that_cannot_be_is_refused(
    sector: float, guard: float, begin: list[float], words: str
) -> None:
    with pytest.raises(ValueError, match=words):
        FreeWater(sights=np.ones((4, 2)), begin=begin, sector=sector, guard=guard, is_closed=True)


@given(places=st.integers(0, 6), circles=st.integers(0, 5), seed=st.integers(0, 10**6))
def test_the_nearest_circle_is_that_whose_edge_is(places: int, circles: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    p, centres = rng.normal(0.0, 5.0, (places, 2)), rng.normal(0.0, 5.0, (circles, 2))
    radii = rng.uniform(0.0, 4.0, circles)
    nearest, away = nearest_circles(p, centres, radii)
    edges = np.linalg.norm(p[:, None] - centres, axis=2) - radii
    if circles:
        assert nearest.tolist() == edges.argmin(axis=1).tolist()
        assert away == pytest.approx(edges.min(axis=1))
    else:
        assert nearest.tolist() == [-1] * places
        assert np.isinf(away).all()


def test_places_that_are_no_numbers_are_near_nothing() -> None:
    places = np.array([[math.nan, 0.0], [0.0, math.nan], [1.0, 1.0]])
    nearest, away = nearest_circles(places, np.zeros((1, 2)), np.ones(1))
    assert nearest.tolist() == [-1, -1, 0]
    assert np.isinf(away[:2]).all()


def test_every_circle_needs_a_radius_to_be_nearest() -> None:
    with pytest.raises(ValueError, match="a radius for each centre"):
        nearest_circles(np.zeros((2, 2)), np.zeros((2, 2)), np.zeros(1))
