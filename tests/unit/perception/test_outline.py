"""How far is seen all around, and which circles are pieces of one long thing."""

import math

import numpy as np
import pytest
from tests.unit.perception.echoes import LEVEL, cloud, post, sensor, wall

from twinscrew.runtime.geometry import quaternion_from_euler, rotation_from_quaternion
from twinscrew.runtime.messages.types import Objects, Outline
from twinscrew.runtime.perception.segmentation import (
    SECTOR_RAD,
    Perception,
    PerceptionSettings,
    columns_a_sector,
)
from twinscrew.runtime.perception.sensor import Beams, Columns, Sensor

SENSORS = ["vrx16", "vrx32", "vlp16", "hdl32e", "os1_64"]


def seen_of(
    *echoes: np.ndarray,
    s: Sensor | None = None,
    q_NB: np.ndarray = LEVEL,
    settings: PerceptionSettings | None = None,
) -> tuple[Objects, Outline]:
    points_S = np.concatenate([np.empty((0, 3)), *echoes])
    objects = Perception(s or sensor(), settings).step(cloud(points_S), q_NB)
    assert objects.outline is not None
    return objects, objects.outline


def distances(outline: Outline) -> np.ndarray:
    return np.linalg.norm(outline.boundary_L - outline.sensor_L[:2], axis=1)


def test_over_an_empty_sea_every_sight_ends_at_the_range() -> None:
    _, outline = seen_of()
    assert distances(outline) == pytest.approx(60.0)
    assert (outline.seen == -1).all()
    assert outline.cut_from.shape == (0,)


def test_a_sensor_that_sees_less_far_than_is_looked_ends_the_sights() -> None:
    _, outline = seen_of(s=sensor("vlp16"), settings=PerceptionSettings(max_range_m=150.0))
    assert distances(outline) == pytest.approx(sensor("vlp16").range_max_m)


def test_the_sights_go_around_clockwise_once() -> None:
    _, outline = seen_of()
    away = outline.boundary_L - outline.sensor_L[:2]
    turns = np.diff(np.unwrap(np.arctan2(away[:, 1], away[:, 0])))
    assert turns[:-1] == pytest.approx(outline.sector_rad, abs=1e-9)
    assert 0.0 < turns[-1] <= outline.sector_rad
    assert outline.is_closed


def test_a_post_is_no_piece_but_ends_the_sights_to_it() -> None:
    objects, outline = seen_of(post(sensor(), 8.0, -3.0))
    assert outline.cut_from.tolist() == [-1]
    assert (outline.seen == -1).all()
    short = outline.boundary_L[distances(outline) < 19.0]
    assert 5 < len(short) < 20
    apart = np.linalg.norm(short - objects.p_L[0], axis=1)
    assert apart.max() <= objects.radius[0] + 1e-5


@pytest.mark.parametrize("name", SENSORS)
def test_the_pieces_of_a_quay_are_numbered_alike_and_a_post_is_none(name: str) -> None:
    s = sensor(name)
    objects, outline = seen_of(wall(s, 5.0), post(s, 8.0, -3.0), s=s)
    is_post = objects.p_L[:, 1] < 0.0
    assert is_post.sum() == 1
    assert set(outline.cut_from[is_post]) == {-1}
    numbers = set(outline.cut_from[~is_post].tolist())
    assert len(numbers) == 1
    assert min(numbers) >= 0
    assert set(outline.seen.tolist()) == {-1, *numbers}
    on_quay = outline.boundary_L[outline.seen >= 0]
    assert on_quay[:, 1] == pytest.approx(5.0, abs=1e-3)
    assert np.ptp(on_quay[:, 0]) > 25.0


def test_two_quays_have_two_numbers() -> None:
    objects, outline = seen_of(wall(sensor(), 6.0), wall(sensor(), -7.0))
    to_port = objects.p_L[:, 1] < 0.0
    (port,), (starboard,) = (set(outline.cut_from[side].tolist()) for side in (to_port, ~to_port))
    assert -1 < min(port, starboard) < max(port, starboard)
    for number, east in ((port, -7.0), (starboard, 6.0)):
        assert outline.boundary_L[outline.seen == number, 1] == pytest.approx(east, abs=1e-3)


def test_what_lies_before_a_quay_ends_the_sights_to_it() -> None:
    s = sensor()
    _, alone = seen_of(wall(s, 8.0))
    _, hidden = seen_of(wall(s, 8.0), post(s, 0.4, 3.0))
    behind = np.flatnonzero(hidden.seen != alone.seen)
    assert 5 < len(behind) < 50
    assert (alone.seen[behind] >= 0).all()
    assert (hidden.seen[behind] == -1).all()
    assert (np.linalg.norm(hidden.boundary_L[behind] - [0.4, 3.0], axis=1) < 0.45).all()


def test_echoes_too_few_for_an_object_end_a_sight_all_the_same() -> None:
    objects, outline = seen_of(post(sensor(), 8.0, -3.0)[:5])
    assert len(objects.radius) == 0
    assert distances(outline).min() == pytest.approx(8.1, abs=0.4)
    assert (outline.seen == -1).all()


@pytest.mark.parametrize(("roll", "pitch"), [(0.12, 0.0), (0.0, -0.1), (-0.08, 0.07)])
def test_the_outline_of_a_tilted_vessel_is_level(roll: float, pitch: float) -> None:
    q_NB = quaternion_from_euler(roll, pitch, 0.0)
    _, outline = seen_of(wall(sensor(), 6.0, q_NB), q_NB=q_NB)
    assert outline.boundary_L[outline.seen >= 0, 1] == pytest.approx(6.0, abs=1e-3)
    mast_N = rotation_from_quaternion(q_NB) @ sensor().mount_position_B
    assert outline.sensor_L == pytest.approx(mast_N)
    assert distances(outline)[outline.seen < 0] == pytest.approx(60.0)


def test_the_heading_turns_nothing() -> None:
    _, north = seen_of(wall(sensor(), 6.0))
    _, west = seen_of(wall(sensor(), 6.0), q_NB=quaternion_from_euler(0.0, 0.0, -math.pi / 2))
    assert west.boundary_L == pytest.approx(north.boundary_L, abs=1e-5)


@pytest.mark.parametrize("name", SENSORS)
def test_a_sector_is_as_many_columns_as_half_a_degree_holds(name: str) -> None:
    s = sensor(name)
    count = columns_a_sector(s)
    assert abs(count * s.azimuth_step - SECTOR_RAD) <= s.azimuth_step / 2
    _, outline = seen_of(s=s)
    assert len(outline.boundary_L) == math.ceil(s.image_shape[1] / count)
    assert outline.sector_rad == pytest.approx(count * s.azimuth_step)


@pytest.mark.parametrize(
    ("columns", "span_rad", "expected"),
    [(2, 0.01, 1), (3, 0.01, 1), (9, 0.01, 4), (2, 6.0, 1), (100, 6.0, 1)],
)
def test_there_are_two_sectors_at_least(columns: int, span_rad: float, expected: int) -> None:
    s = Sensor(
        name="narrow",
        beams=Beams(count=2, lowest_rad=-0.1, highest_rad=0.1),
        columns=Columns(count=columns, first_rad=0.0, span_rad=-span_rad, endpoint=True),
        rate_hz=10.0,
        scan_duration_s=0.0,
        range_min_m=0.5,
        range_max_m=50.0,
        noise_sigma_m=0.01,
        mount=sensor().mount,
    )
    assert columns_a_sector(s) == expected
    _, outline = seen_of(s=s)
    assert len(outline.boundary_L) == math.ceil(columns / expected) >= 2
    assert not outline.is_closed
