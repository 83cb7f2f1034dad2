"""Low quays, over which most beams of a boat in waves pass, stand; low ships under way move."""

import math
from collections import Counter
from dataclasses import replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.harness.work import examples
from tests.reference.flat_world import scans, stand
from tests.unit.perception import echoes

from twinscrew.runtime.geometry import quaternion_from_euler
from twinscrew.runtime.perception.segmentation import Perception
from twinscrew.runtime.tracking.lidar_motion import LongObjects, LongObjectSettings

SENSORS = ["vrx16", "vrx32", "vlp16", "hdl32e", "os1_64"]
WATER_M = 0.11
"""[m] Height of the water over the vessel's origin."""


def said_of(
    name: str,
    away_m: float,
    high_m: float,
    tilt_rad: float,
    *,
    ends_m: tuple[float, float] = (-60.0, 60.0),
    speed: float = 0.0,
    own_speed: float = 1.0,
    seconds: float = 6.0,
) -> Counter[bool | None]:
    """Count what is said of pieces of a thing that goes along north, or lies there."""
    sensor = echoes.sensor(name)
    perception, standing = Perception(sensor), LongObjects(LongObjectSettings())
    said: Counter[bool | None] = Counter()
    for t in scans(seconds):
        q_NB = quaternion_from_euler(
            tilt_rad * math.sin(2.0 * t), tilt_rad * math.cos(1.5 * t), 0.0
        )
        aft, ahead = (end_m + (speed - own_speed) * t for end_m in ends_m)
        points_S = echoes.wall(sensor, away_m, q_NB, low=WATER_M, high=high_m, aft=aft, ahead=ahead)
        seen = replace(perception.step(echoes.cloud(points_S), q_NB), stamp_ns=round(1e9 * t))
        said.update(standing.at_rest(seen, stand((own_speed * t, 0.0, 0.0))))
    return said


@pytest.mark.slow
@settings(max_examples=examples(15))
@given(
    name=st.sampled_from(SENSORS),
    away_m=st.floats(5.0, 14.0),
    high_m=st.floats(0.3, 0.81),
    tilt_rad=st.floats(0.0, 0.15),
)
def test_a_low_quay_never_moves(name: str, away_m: float, high_m: float, tilt_rad: float) -> None:
    """It goes 0.2 to 0.7 m out of the water: in one scan beams meet it, in the next none does."""
    assert said_of(name, away_m, high_m, tilt_rad)[False] == 0


@pytest.mark.parametrize("name", SENSORS)
@pytest.mark.parametrize("tilt_rad", [0.03, 0.08])
def test_a_quay_that_is_not_so_low_is_told_to_stand(name: str, tilt_rad: float) -> None:
    said = said_of(name, 6.0, 0.81, tilt_rad)
    assert said[True] > said[None]
    assert said[False] == 0


@pytest.mark.parametrize("name", SENSORS)
@pytest.mark.parametrize("tilt_rad", [0.0, 0.08])
def test_a_ship_under_way_moves_though_the_boat_rolls(name: str, tilt_rad: float) -> None:
    said = said_of(
        name, 7.0, 1.5, tilt_rad, ends_m=(-10.0, 4.0), speed=2.0, own_speed=0.0, seconds=4.0
    )
    assert said[True] == 0
    assert said[False] > said[None]
