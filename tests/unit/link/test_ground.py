"""What ground stations are shown: distances around the boat, and values."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from tests.harness.work import examples

from twinscrew.runtime.ground.report import (
    SECTOR_RAD,
    SECTORS,
    named_value,
    obstacle_distance,
    sector_distances_cm,
)
from twinscrew.runtime.mavlink import Wire

FREE = 10_001


def around(*circles: tuple[float, float, float], range_m: float = 100.0) -> list[int]:
    """Distances for circles (forward, starboard, radius)."""
    values = np.array(circles, dtype=float).reshape(-1, 3)
    return sector_distances_cm(values[:, :2], values[:, 2], range_m).tolist()


def test_where_nothing_is_it_says_one_more_than_its_range() -> None:
    assert around() == [FREE] * SECTORS
    assert around(range_m=20.0) == [2001] * SECTORS


def test_ahead_is_the_first_sector_and_starboard_a_quarter_of_them_on() -> None:
    assert around((10.0, 0.0, 0.1))[0] == 990
    assert around((0.0, 10.0, 0.1))[SECTORS // 4] == 990
    assert around((-10.0, 0.0, 0.1))[SECTORS // 2] == 990
    assert around((0.0, -10.0, 0.1))[3 * SECTORS // 4] == 990


def test_a_small_object_in_the_middle_of_a_sector_is_in_no_other() -> None:
    assert around((20.0, 0.0, 0.1))[1:] == [FREE] * (SECTORS - 1)


def test_a_wide_object_covers_the_sectors_that_it_covers() -> None:
    covered = [k for k, cm in enumerate(around((10.0, 0.0, 5.0))) if cm != FREE]
    assert covered == [*range(7), *range(SECTORS - 6, SECTORS)]  # asin(5 / 10) is 30 degrees


def test_of_two_in_one_direction_the_nearer_counts() -> None:
    assert around((10.0, 0.0, 1.0), (30.0, 0.0, 1.0))[0] == 900


def test_what_is_beyond_the_range_is_not_told() -> None:
    assert around((150.0, 0.0, 1.0)) == [FREE] * SECTORS


def test_inside_an_object_it_is_as_near_as_can_be_said_all_around() -> None:
    assert around((0.5, 0.0, 2.0)) == [1] * SECTORS


circle = st.tuples(st.floats(-60, 60), st.floats(-60, 60), st.floats(0.05, 8.0))


@settings(deadline=None, max_examples=examples(60))
@given(st.lists(circle, min_size=1, max_size=4))
def test_no_sector_says_more_than_a_ray_in_it_would(circles) -> None:
    """Against rays, a hundred a sector: what is told is the least of them, and never more."""
    told = np.array(around(*circles))
    angles = (np.arange(SECTORS)[:, None] + np.linspace(-0.5, 0.5, 101)) * SECTOR_RAD
    rays_cm = np.min([100.0 * ray_m(angles, *one) for one in circles], axis=0).min(axis=1)
    assert np.all(told <= np.maximum(1, np.minimum(rays_cm, FREE)) + 1e-6)
    surely = rays_cm < FREE - 1
    beside = np.roll(surely, 1) & np.roll(surely, -1)  # a ray may miss what touches an edge only
    near = told[surely & beside] >= np.floor(0.9 * rays_cm[surely & beside]) - 1
    assert near.all()


def ray_m(angles, forward, starboard, radius):
    """Distance along rays to a circle; infinite if they miss."""
    along = forward * np.cos(angles) + starboard * np.sin(angles)
    across = -forward * np.sin(angles) + starboard * np.cos(angles)
    chord = radius**2 - across**2
    meets = along - np.sqrt(np.maximum(chord, 0.0))
    if math.hypot(forward, starboard) <= radius:
        return np.zeros_like(angles)
    return np.where((chord >= 0.0) & (along > 0.0), meets, np.inf)


def test_the_message_is_what_ground_stations_read() -> None:
    wire = Wire(1, 191)
    distances = around((10.0, 0.0, 0.1))
    (message,) = Wire(2, 1).decode(wire.encode(obstacle_distance(distances, 100.0, 12.5)))
    assert list(message.distances) == distances
    assert (message.min_distance, message.max_distance) == (1, 10_000)
    assert (message.increment, message.increment_f, message.angle_offset) == (5, 5.0, 0.0)
    assert message.frame == mavlink.MAV_FRAME_BODY_FRD
    assert message.time_usec == 12_500_000


def test_a_value_has_its_name_and_its_time() -> None:
    (message,) = Wire(2, 1).decode(Wire(1, 191).encode(named_value("latency_ms", 1.5, 12.5)))
    assert (message.name, message.value, message.time_boot_ms) == ("latency_ms", 1.5, 12_500)


@pytest.mark.parametrize("range_m", [655.0, 1000.0, 1e9])
def test_no_range_is_more_than_sixteen_bits(range_m: float) -> None:
    assert max(around(range_m=range_m)) == 65_501
    assert obstacle_distance(around(), range_m, 0.0).max_distance == 65_500
