"""The ground or the water under a sensor that is not level."""

import math

import numpy as np
import pytest

from twinscrew.runtime.geometry.frames import quaternion_from_euler
from twinscrew.runtime.geometry.frames import rotation_from_quaternion as rotation
from twinscrew.runtime.perception.surface import find_surface


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
