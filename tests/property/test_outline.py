"""The outline, and the free water it shows, are those of the plain references, in any scene."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.harness.work import examples
from tests.reference import free_water as water_reference
from tests.reference import outline as outline_reference

from twinscrew.runtime._native import FreeWater
from twinscrew.runtime.geometry import quaternion_from_euler, rotation_from_quaternion
from twinscrew.runtime.messages.types import PointCloud
from twinscrew.runtime.perception.segmentation import SECTOR_RAD, Perception, PerceptionSettings
from twinscrew.runtime.perception.sensor import Beams, Columns, Mount, Sensor

OPEN = PerceptionSettings(max_range_m=20.0, hull=None, water=None, min_points=2)
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
    points_S: np.ndarray = (s.directions_S()[seen] * ranges[seen][:, None]).astype(np.float32)
    return points_S


@pytest.mark.slow
@given(
    seed=st.integers(0, 10**6),
    columns=st.sampled_from(COLUMNS),
    wraps=st.booleans(),
    mount=st.sampled_from(MOUNTS),
    roll=st.floats(-0.4, 0.4),
    pitch=st.floats(-0.4, 0.4),
    yaw=st.floats(-3.0, 3.0),
)
@settings(max_examples=examples(80), deadline=None)
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
    ends, heights, seen = outline_reference.outline(
        perception.range_image().astype(float),
        perception.object_image(),
        ((places @ s.R_BS.T + s.mount_position_B) @ R_LB.T),
        found.cut_from,
        s,
        R_LB,
        sector,
        OPEN.max_range_m,
    )
    assert found.boundary_L == pytest.approx(ends, abs=1e-4)
    assert found.seen.tolist() == seen.tolist()
    assert found.sensor_L == pytest.approx(R_LB @ s.mount_position_B, abs=1e-6)
    assert found.down_L == pytest.approx((R_LB @ s.R_BS)[:, 2], abs=1e-6)
    assert found.elevation_rad.tolist() == s.elevations.tolist()
    # A height is told as of the middle of the sector.
    away_m = np.linalg.norm(found.boundary_L - found.sensor_L[:2], axis=1)
    half_m = 0.6 * away_m * (sector - 1) * s.azimuth_step
    assert np.isnan(found.height_m).tolist() == np.isnan(heights).tolist()
    off_m = np.nan_to_num(abs(found.height_m - heights))
    assert (off_m <= half_m * math.hypot(*found.down_L[:2]) + 1e-4).all()
    assert found.sector_rad == pytest.approx(sector * s.azimuth_step)
    assert found.is_closed is wraps
    assert len(found.cut_from) == len(objects.radius)


def water_of(sights: np.ndarray, **other: object) -> FreeWater:
    """Give what a scan shows of which nothing but the sights is told."""
    told = {
        "heights": np.zeros(len(sights)),
        "seen": np.zeros(len(sights), dtype=np.int64),
        "begin": [0.0, 0.0, 0.0],
        "sector": 2 * math.pi / max(len(sights), 1),
        "guard": 0.0,
        "is_closed": True,
        "elevations": np.empty(0),
        "down": [0.0, 0.0, 1.0],
        "least": -math.inf,
    }
    return FreeWater(boundary=sights, **{**told, **other})  # type: ignore[arg-type]


@given(
    seed=st.integers(0, 10**6),
    sectors=st.sampled_from([2, 3, 5, 60, 721]),
    share=st.floats(0.1, 1.0),
    guard=st.floats(0.0, 0.3),
    margin=st.floats(0.01, 2.0),
)
@settings(max_examples=examples(80), deadline=None)
def test_the_free_water_is_that_of_the_plain_reference(
    seed: int, sectors: int, share: float, guard: float, margin: float
) -> None:
    rng, begin = np.random.default_rng(seed), np.array([0.4, -0.2])
    is_closed, sector = share > 0.9, (1.0 if share > 0.9 else share) * 2 * math.pi / sectors
    azimuth = rng.uniform(-3.0, 3.0) + sector * (np.arange(sectors) + rng.normal(0, 0.3, sectors))
    ray = np.column_stack([np.cos(azimuth), np.sin(azimuth)])
    sights = begin + rng.uniform(0.5, 20.0, (sectors, 1)) * ray
    is_echo, whose = rng.random(sectors) < 0.7, rng.integers(-1, 4, sectors)
    places = begin + rng.normal(0.0, 8.0, (300, 2))
    places[:100] = sights[rng.integers(sectors, size=100)] + rng.normal(0.0, margin, (100, 2))
    shown = water_reference.seen(sights, is_echo, whose, begin, sector, guard, is_closed)
    expected = [water_reference.ask(shown, begin, place, margin) for place in places]
    water = water_of(
        sights,
        heights=np.where(is_echo, 0.0, np.nan),
        seen=whose,
        begin=[*begin, -2.0],
        sector=sector,
        guard=guard,
        is_closed=is_closed,
    )
    answers, takers = water.ask(places, rng.normal(size=len(places)), margin)
    assert list(zip(answers, takers, strict=True)) == expected


def ring(away_m: float, sectors: int = 720) -> np.ndarray:
    """Give sights that end so far away, all around."""
    azimuth = 2 * math.pi * (np.arange(sectors) + 0.5) / sectors
    return away_m * np.column_stack([np.cos(azimuth), np.sin(azimuth)])


@given(
    seed=st.integers(0, 10**6),
    beams=st.integers(1, 40),
    roll=st.floats(-0.3, 0.3),
    pitch=st.floats(-0.3, 0.3),
    height_m=st.floats(0.5, 4.0),
    least_m=st.sampled_from([-math.inf, -0.2, 0.11]),
)
@settings(max_examples=examples(60), deadline=None)
def test_a_place_is_free_where_a_beam_passes_over_it_low_enough_and_not_too_low(
    seed: int, beams: int, roll: float, pitch: float, height_m: float, least_m: float
) -> None:
    rng = np.random.default_rng(seed)
    elevations = np.sort(rng.uniform(-0.45, 0.25, beams))
    down = rotation_from_quaternion(quaternion_from_euler(roll, pitch, 0.0))[:, 2]
    begin = np.array([0.4, -0.2])
    places = begin + rng.uniform(1.0, 24.0, (40, 1)) * ring(1.0, 40)
    tops = rng.uniform(-0.5, height_m + 1.0, len(places))
    water = water_of(
        begin + ring(25.0),
        begin=[*begin, -height_m],
        elevations=elevations,
        down=down.tolist(),
        least=least_m,
    )
    answers, takers = water.ask(places, tops, 0.5)
    assert takers.tolist() == [-1] * len(places)
    for away, top, answer in zip(places - begin, tops, answers, strict=True):
        slope = np.array([water_reference.passes(e, away, down) for e in elevations])
        over_m = height_m + math.hypot(*away) * np.tan(slope)
        if ((over_m >= least_m + 1e-9) & (over_m <= top - 1e-9)).any():
            assert answer == water_reference.FREE
        elif not ((over_m >= least_m - 1e-9) & (over_m <= top + 1e-9)).any():
            assert answer == water_reference.UNKNOWN


def test_a_sensor_that_leans_to_starboard_sees_what_is_low_there_and_not_to_port() -> None:
    """It stands 2 m high, its one beam goes level: 10 m to starboard it passes 1.5 m lower."""
    lean = math.atan(0.15)
    down = [0.0, -math.sin(lean), math.cos(lean)]
    water = water_of(ring(20.0), begin=[0.0, 0.0, -2.0], elevations=np.zeros(1), down=down)
    starboard, port, ahead = [0.0, 10.0], [0.0, -10.0], [10.0, 0.0]
    places = np.array([starboard, starboard, port, port, ahead, ahead])
    tops = np.array([0.49, 0.51, 3.49, 3.51, 1.99, 2.01])
    assert water.ask(places, tops, 0.5)[0].tolist() == [0, 1, 0, 1, 0, 1]


def test_a_beam_so_low_that_its_echoes_are_left_out_tells_of_nothing() -> None:
    """The beam passes 1 m over the origin, 10 m ahead."""
    beam = np.array([-math.atan(0.1)])
    place, top = np.array([[10.0, 0.0]]), np.array([3.0])
    for least, answer in [(-math.inf, 1), (0.99, 1), (1.01, 0), (math.inf, 0)]:
        water = water_of(ring(20.0), begin=[0.0, 0.0, -2.0], elevations=beam, least=least)
        assert water.ask(place, top, 0.5)[0].tolist() == [answer]


@pytest.mark.parametrize("elevations", [np.empty(0), np.array([-0.3, -0.2, 0.1])])
def test_of_places_that_are_no_numbers_nothing_is_known(elevations: np.ndarray) -> None:
    water = water_of(ring(20.0), begin=[0.0, 0.0, -2.0], elevations=elevations)
    bad = [[math.nan, 0.0], [0.0, math.nan], [math.inf, 0.0], [-math.inf, math.inf]]
    answers, takers = water.ask(np.array([*bad, [8.0, 0.0]]), np.full(5, 1.0), 0.5)
    assert answers.tolist() == [0, 0, 0, 0, 1]
    assert takers.tolist() == [-1] * 5


def test_where_the_sensor_is_nothing_is_known_if_there_are_beams() -> None:
    water = water_of(ring(20.0), begin=[0.0, 0.0, -2.0], elevations=np.array([-0.3, 0.3]))
    assert water.ask(np.zeros((1, 2)), np.ones(1), 0.5)[0].tolist() == [0]


def test_without_sights_or_places_there_is_nothing_to_tell() -> None:
    nowhere = water_of(np.empty((0, 2)))
    assert nowhere.ask(np.array([[1.0, 0.0]]), np.zeros(1), 0.0)[0].tolist() == [0]
    answers, takers = nowhere.ask(np.empty((0, 2)), np.empty(0), 0.0)
    assert (answers.shape, takers.shape) == ((0,), (0,))


@pytest.mark.parametrize(
    ("told", "words"),
    [
        ({"sector": 0.0}, "sector's width"),
        ({"sector": math.nan}, "sector's width"),
        ({"guard": -0.1}, "negative guard"),
        ({"guard": math.nan}, "negative guard"),
        ({"begin": [math.nan, 0.0, 0.0]}, "begins somewhere"),
        ({"begin": [0.0, math.inf, 0.0]}, "begins somewhere"),
        ({"heights": np.zeros(3)}, "a height and a number for each sight"),
        ({"seen": np.zeros(5, dtype=np.int64)}, "a height and a number for each sight"),
        ({"down": [0.0, 0.0, -1.0]}, "points down"),
        ({"down": [1.0, 0.0, 0.0]}, "points down"),
        ({"down": [0.0, 0.0, math.nan]}, "points down"),
    ],
)
def test_free_water_that_cannot_be_is_refused(told: dict[str, object], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        water_of(np.ones((4, 2)), **told)


@pytest.mark.parametrize("count", [0, 1, 3])
def test_every_place_that_is_asked_for_needs_a_height(count: int) -> None:
    with pytest.raises(ValueError, match="a height for each place"):
        water_of(ring(20.0)).ask(np.zeros((2, 2)), np.zeros(count), 0.5)


@pytest.mark.slow
def test_sectors_may_be_finer_than_any_sensors() -> None:
    water = water_of(ring(10.0, 8), sector=1e-9, guard=0.5)
    answers, _ = water.ask(np.array([[9.0, 0.0], [11.0, 0.0]]), np.zeros(2), 0.5)
    assert answers.tolist() == [water_reference.FREE, water_reference.UNKNOWN]
