"""The native ray casting against closed forms and the plain reference."""

from __future__ import annotations

import importlib.util
import math
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from twinscrew.hil_sim._native import Caster
from twinscrew.hil_sim.bodies import ABSENT, Bodies
from twinscrew.hil_sim.shapes import BOX, CYLINDER, Shape, boxes_shape, load_shape, vessel_shape
from twinscrew.runtime.geometry import quaternion_from_euler, rotation_from_quaternion
from twinscrew.runtime.perception.sensor import Sensor, load_sensor
from twinscrew.runtime.settings import convert
from twinscrew.runtime.vessel_description import load_vessel

_file = Path(__file__).parents[2] / "reference" / "raycast.py"
_spec = importlib.util.spec_from_file_location("reference_raycast", _file)
assert _spec is not None
assert _spec.loader is not None
reference = importlib.util.module_from_spec(_spec)
_spec.loader.exec_module(reference)

FAR = 1e3
"""[m] Water level deep enough to hide nothing."""


def turn(roll: float, pitch: float, yaw: float) -> np.ndarray:
    return rotation_from_quaternion(quaternion_from_euler(roll, pitch, yaw))


def coarse_sensor(**changes: object) -> Sensor:
    values = {
        "name": "coarse",
        "beams": {"count": 24, "lowest_rad": -0.4, "highest_rad": 0.5},
        "columns": {"count": 180, "first_rad": -3.0, "span_rad": 6.2, "endpoint": True},
        "rate_hz": 10.0,
        "scan_duration_s": 0.0,
        "range_min_m": 0.1,
        "range_max_m": 60.0,
        "noise_sigma_m": 0.0,
        "mount": {"x_m": 0.43, "y_m": 0.1, "z_m": 1.93, "pitch_rad": 0.05, "yaw_rad": 0.4},
    }
    return convert(values | changes, Sensor)


def prepared(
    sensor: Sensor, shapes: list[Shape], bodies: Bodies, own: int = 0
) -> Callable[[], tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """A scan by the kernel, ready to run: beams, distances, bodies."""
    caster = Caster(sensor.elevations, sensor.azimuths, sensor.range_min_m, sensor.range_max_m)
    for shape in shapes:
        caster.add_shape(shape.kinds, shape.centres, shape.rotations, shape.halves)
    caster.mount(0, sensor.mount_position_B, sensor.R_BS)
    rays = len(sensor.elevations) * len(sensor.azimuths)
    beam, body = np.empty(rays, dtype=np.int32), np.empty(rays, dtype=np.int32)
    distance = np.empty(rays)
    R_NS = bodies.R_NB[own] @ sensor.R_BS
    p_NS = bodies.position_N[own] + bodies.R_NB[own] @ sensor.mount_position_B
    args = (p_NS, R_NS, bodies.shape, bodies.position_N, bodies.R_NB, bodies.water_z, own)

    def run() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        count = caster.cast(*args, beam, distance, body)
        return beam[:count].copy(), distance[:count].copy(), body[:count].copy()

    return run


def cast(
    sensor: Sensor, shapes: list[Shape], bodies: Bodies, own: int
) -> tuple[np.ndarray, np.ndarray]:
    """Every ray's distance and body, by the kernel."""
    run = prepared(sensor, shapes, bodies, own)
    (beam, distance, body), again = run(), run()
    np.testing.assert_array_equal(again[1], distance)  # the workspace was left clean
    assert (np.diff(beam) > 0).all()
    rays = len(sensor.elevations) * len(sensor.azimuths)
    all_distance, all_body = np.full(rays, np.inf), np.full(rays, -2)
    all_distance[beam], all_body[beam] = distance, body
    return all_distance, all_body


def random_solids(rng: np.random.Generator, count: int) -> Shape:
    return Shape(
        kinds=rng.choice([BOX, CYLINDER], count).astype(np.int32),
        centres=rng.uniform(-2, 2, (count, 3)),
        rotations=np.array([turn(*rng.uniform(-3, 3, 3)) for _ in range(count)]),
        halves=rng.uniform(0.02, 1.5, (count, 1)) * rng.uniform(0.05, 1, (count, 3)),
    )


def with_round_cylinders(shape: Shape) -> Shape:
    halves = shape.halves.copy()
    halves[:, 2] = np.where(shape.kinds == CYLINDER, halves[:, 1], halves[:, 2])
    return Shape(kinds=shape.kinds, centres=shape.centres, rotations=shape.rotations, halves=halves)


def random_bodies(rng: np.random.Generator, shapes: list[int], spread: float) -> Bodies:
    count = len(shapes)
    return Bodies(
        shape=np.array(shapes, dtype=np.int32),
        position_N=rng.uniform(-spread, spread, (count, 3)) * [1, 1, 0.02],
        R_NB=np.array([turn(*rng.normal(0, 0.1, 2), rng.uniform(-3, 3)) for _ in shapes]),
        water_z=rng.uniform(-0.5, 1.0, count),
    )


def assert_same(sensor: Sensor, shapes: list[Shape], bodies: Bodies, own: int) -> int:
    distance, body = cast(sensor, shapes, bodies, own)
    expected_distance, expected_body = reference.cast(sensor, shapes, bodies, own)
    np.testing.assert_array_equal(np.isfinite(distance), np.isfinite(expected_distance))
    np.testing.assert_allclose(distance, expected_distance, rtol=0, atol=1e-9)
    np.testing.assert_array_equal(body, expected_body)
    return int(np.isfinite(distance).sum())


@pytest.mark.parametrize("seed", range(12))
def test_every_ray_agrees_with_the_reference_among_random_solids(seed: int) -> None:
    rng = np.random.default_rng(seed)
    shapes = [with_round_cylinders(random_solids(rng, 6)) for _ in range(3)]
    bodies = random_bodies(rng, [0, 1, 2, ABSENT, 1, 2, 0], spread=(3.0, 12.0, 40.0)[seed % 3])
    assert assert_same(coarse_sensor(), shapes, bodies, own=seed % 2) > 50


@pytest.mark.parametrize("name", ["vrx32", "vrx16"])
def test_every_ray_of_the_real_sensors_agrees_with_the_reference(name: str) -> None:
    rng = np.random.default_rng(3)
    quays = boxes_shape(np.array([[30.0, 0.0, 0.5]]), np.array([[40.0, 3.0, 5.0]]), np.array([0.3]))
    shapes = [vessel_shape(load_vessel()), load_shape("light_buoy"), quays]
    bodies = random_bodies(rng, [0, 0, 1, 2], spread=15.0)
    assert assert_same(load_sensor(name), shapes, bodies, own=0) > 500


def test_windows_make_the_kernel_at_least_fifty_times_faster_than_testing_everything() -> None:
    sensor, rng = load_sensor("vrx16"), np.random.default_rng(3)
    shapes = [vessel_shape(load_vessel()), load_shape("light_buoy")]
    bodies = random_bodies(rng, [0, 0, 1], spread=15.0)
    took = []
    for run in (
        lambda: reference.cast(sensor, shapes, bodies, 0),
        prepared(sensor, shapes, bodies),
    ):
        times = []
        for _ in range(3):
            begin = time.perf_counter()
            run()
            times.append(time.perf_counter() - begin)
        took.append(min(times))
    assert took[0] > 50 * took[1]


def scene(*shapes: Shape, p_N: tuple[float, float, float], water_z: float = FAR) -> Bodies:
    """The first shape carries the sensor at the origin; the second lies at p_N."""
    return Bodies(
        shape=np.arange(len(shapes), dtype=np.int32),
        position_N=np.array([[0.0, 0.0, 0.0], p_N]),
        R_NB=np.array([np.eye(3)] * 2),
        water_z=np.array([FAR, water_z]),
    )


def one_solid(kind: int, half: tuple[float, float, float]) -> Shape:
    return Shape(
        kinds=np.array([kind], dtype=np.int32),
        centres=np.zeros((1, 3)),
        rotations=np.eye(3)[None],
        halves=np.array([half]),
    )


SPECK = one_solid(BOX, (1e-6, 1e-6, 1e-6))
LEVEL = {"x_m": 0.0, "y_m": 0.0, "z_m": 0.0}


def level_sensor() -> Sensor:
    beams = {"count": 3, "lowest_rad": -0.2, "highest_rad": 0.2}
    columns = {"count": 360, "first_rad": 0.0, "span_rad": 2 * math.pi, "endpoint": False}
    return coarse_sensor(beams=beams, columns=columns, mount=LEVEL)


def test_a_wall_ahead_is_seen_at_its_distance_over_the_cosines() -> None:
    sensor = level_sensor()
    wall = one_solid(BOX, (0.5, 100.0, 100.0))
    distance, _ = cast(sensor, [SPECK, wall], scene(SPECK, wall, p_N=(10.5, 0, 0)), 0)
    e, a = np.meshgrid(sensor.elevations, sensor.azimuths, indexing="ij")
    expected = 10.0 / (np.cos(e) * np.cos(a)).ravel()
    hit = (expected > 0) & (expected <= sensor.range_max_m)
    np.testing.assert_allclose(distance[hit], expected[hit], rtol=1e-12)
    assert np.isinf(distance[~hit]).all()


def test_an_upright_cylinder_to_starboard_subtends_twice_the_arcsine_of_its_radius() -> None:
    sensor = level_sensor()
    upright = Shape(
        kinds=np.array([CYLINDER], dtype=np.int32),
        centres=np.zeros((1, 3)),
        rotations=turn(0, math.pi / 2, 0)[None],
        halves=np.array([[50.0, 2.0, 2.0]]),
    )
    distance, _ = cast(sensor, [SPECK, upright], scene(SPECK, upright, p_N=(0, 10, 0)), 0)
    row = distance.reshape(3, 360)[1]
    seen = np.abs(sensor.azimuths + 1.5 * math.pi) < math.asin(0.2)  # starboard is -3/2 pi too
    np.testing.assert_array_equal(np.isfinite(row), seen)
    assert row.min() == pytest.approx(8.0, abs=1e-12)


def test_the_water_hides_what_is_under_it() -> None:
    sensor, wall = level_sensor(), one_solid(BOX, (0.5, 5.0, 5.0))
    bodies = scene(SPECK, wall, p_N=(10.5, 0, 0), water_z=1.0)  # the lowest row meets it at z = 2
    distance, _ = cast(sensor, [SPECK, wall], bodies, 0)
    assert np.isinf(distance.reshape(3, 360)[0]).all()
    assert np.isfinite(distance.reshape(3, 360)[1, 0])


def test_what_is_nearer_than_the_least_range_is_seen_through() -> None:
    sensor, wall = level_sensor(), one_solid(BOX, (0.5, 5.0, 5.0))
    shade = one_solid(BOX, (0.01, 0.01, 0.01))
    bodies = Bodies(
        shape=np.array([0, 1, 2], dtype=np.int32),
        position_N=np.array([[0.0, 0, 0], [10.5, 0, 0], [0.05, 0, 0]]),
        R_NB=np.array([np.eye(3)] * 3),
        water_z=np.full(3, FAR),
    )
    distance, body = cast(sensor, [SPECK, wall, shade], bodies, 0)
    assert distance.reshape(3, 360)[1, 0] == pytest.approx(10.0)
    assert body.reshape(3, 360)[1, 0] == 1


def test_what_is_beyond_the_greatest_range_is_not_seen() -> None:
    sensor, wall = level_sensor(), one_solid(BOX, (0.5, 5.0, 5.0))
    near, _ = cast(sensor, [SPECK, wall], scene(SPECK, wall, p_N=(60.4, 0, 0)), 0)
    far, _ = cast(sensor, [SPECK, wall], scene(SPECK, wall, p_N=(60.6, 0, 0)), 0)
    assert np.isfinite(near).sum() > 0
    assert np.isfinite(far).sum() == 0


def test_own_parts_are_seen_wherever_the_vessel_is() -> None:
    sensor = coarse_sensor(mount={"x_m": 0.43, "y_m": 0.0, "z_m": 1.93})
    own, rng = vessel_shape(load_vessel()), np.random.default_rng(0)
    first, _ = cast(sensor, [own], random_bodies(rng, [0], 20.0), 0)
    second, _ = cast(sensor, [own], random_bodies(rng, [0], 20.0), 0)
    assert np.isfinite(first).sum() > 50
    np.testing.assert_array_equal(first, second)


@pytest.mark.parametrize(
    ("elevations", "azimuths", "least", "greatest", "words"),
    [
        ([], [0.0], 0.1, 10.0, "at least one beam"),
        ([0.0], [np.nan], 0.1, 10.0, "finite"),
        ([0.0], [0.0], 10.0, 10.0, "range_min_m < range_max_m"),
        ([0.0], [0.0], -1.0, 10.0, "0 <= range_min_m"),
    ],
)
def test_an_impossible_beam_pattern_is_refused(
    elevations: list[float], azimuths: list[float], least: float, greatest: float, words: str
) -> None:
    with pytest.raises(ValueError, match=words):
        Caster(np.array(elevations), np.array(azimuths), least, greatest)


def test_the_kernel_refuses_arrays_that_do_not_fit() -> None:
    caster = Caster(np.zeros(1), np.zeros(2), 0.1, 10.0)
    eye, zero = np.eye(3), np.zeros(3)
    with pytest.raises(ValueError, match="kind"):
        caster.add_shape(np.array([2], dtype=np.int32), zero[None], eye[None], zero[None])
    with pytest.raises(ValueError, match="same length"):
        caster.add_shape(np.array([0], dtype=np.int32), zero[None], eye[None], np.zeros((2, 3)))
    with pytest.raises(ValueError, match="no such shape"):
        caster.mount(0, zero, eye)
    caster.add_shape(np.array([0], dtype=np.int32), zero[None], eye[None], zero[None])
    shapes, out = np.zeros(1, dtype=np.int32), np.empty(2, dtype=np.int32)
    args = (zero, eye, shapes, zero[None], eye[None], np.zeros(1))
    with pytest.raises(ValueError, match="one element a beam"):
        caster.cast(*args, 0, out[:1].copy(), np.empty(2), out.copy())
    with pytest.raises(ValueError, match="own"):
        caster.cast(*args, 1, out, np.empty(2), out.copy())
    with pytest.raises(ValueError, match="finite"):
        caster.cast(zero, eye * np.nan, *args[2:], 0, out, np.empty(2), out.copy())
    with pytest.raises(ValueError, match="no such shape"):
        caster.cast(zero, eye, shapes + 1, *args[3:], 0, out, np.empty(2), out.copy())
