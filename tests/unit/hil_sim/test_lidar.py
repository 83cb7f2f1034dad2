from __future__ import annotations

import msgspec
import numpy as np
import pytest

from twinscrew.hil_sim.bodies import Bodies
from twinscrew.hil_sim.lidar import NOTHING, WATER, Lidar, LidarSettings, Scan
from twinscrew.hil_sim.shapes import boxes_shape, load_shape, vessel_shape
from twinscrew.runtime.perception.sensor import Sensor, load_sensor
from twinscrew.runtime.vessel_description import load_vessel

SHAPES = (
    vessel_shape(load_vessel()),
    load_shape("light_buoy"),
    boxes_shape(np.array([[30.0, 0.0, 0.0]]), np.array([[2.0, 200.0, 40.0]]), np.zeros(1)),
)
OTHER, BUOY, QUAY = 1, 2, 3


def bodies(own_p_N: tuple[float, float, float] = (0.0, 0.0, 0.1)) -> Bodies:
    """The own vessel heading north, another 12 m ahead, a buoy 9 m to starboard, a wall."""
    return Bodies(
        shape=np.array([0, 0, 1, 2], dtype=np.int32),
        position_N=np.array([own_p_N, [12.0, 1.0, 0.1], [1.0, 9.0, 0.0], [0.0, 0.0, 0.0]]),
        R_NB=np.array([np.eye(3)] * 4),
        water_z=np.zeros(4),
    )


def without_wall(scene: Bodies) -> Bodies:
    return Bodies(
        shape=scene.shape[:3],
        position_N=scene.position_N[:3],
        R_NB=scene.R_NB[:3],
        water_z=scene.water_z[:3],
    )


def scan(
    settings: LidarSettings | None = None,
    scene: Bodies | None = None,
    sensor: str = "vrx32",
    seed: int = 0,
) -> Scan:
    lidar = Lidar(load_sensor(sensor), settings or LidarSettings(), SHAPES)
    return lidar.scan(scene or bodies(), 0, 5, np.random.default_rng(seed))


def silent(sensor: Sensor) -> Sensor:
    return msgspec.structs.replace(sensor, noise_sigma_m=0.0)


def test_a_cloud_holds_only_echoes_with_their_ring_and_object() -> None:
    found = scan()
    cloud = found.cloud
    count = len(cloud.points_S)
    assert cloud.points_S.shape == (count, 3)
    assert cloud.points_S.dtype == np.float32
    assert cloud.points_S.flags.c_contiguous
    assert cloud.stamp_ns == 5
    assert cloud.intensity is not None
    assert cloud.ring is not None
    assert cloud.intensity.shape == cloud.ring.shape == found.object_ids.shape == (count,)
    assert cloud.ring.dtype == np.uint16
    assert set(found.object_ids.tolist()) == {OTHER, BUOY, QUAY}
    assert np.isfinite(cloud.points_S).all()
    rise = -cloud.points_S[:, 2] / np.linalg.norm(cloud.points_S, axis=1)
    np.testing.assert_allclose(
        np.arcsin(rise), load_sensor("vrx32").elevations[cloud.ring], atol=1e-5
    )


def test_points_are_where_the_objects_are() -> None:
    found = scan()
    mount = load_sensor("vrx32").mount_position_B
    points_N = found.cloud.points_S + mount + [0.0, 0.0, 0.1]
    other, buoy = points_N[found.object_ids == OTHER], points_N[found.object_ids == BUOY]
    wall = points_N[found.object_ids == QUAY]
    assert len(other) > 100
    assert (np.abs(other[:, 0] - 12) < 2.75).all()
    assert (np.abs(other[:, 1] - 1) < 1.4).all()
    assert (np.hypot(buoy[:, 0] - 1, buoy[:, 1] - 9) < 0.75 * 2**0.5 + 0.05).all()
    np.testing.assert_allclose(wall[:, 0], 29.0, atol=0.08)


def test_range_noise_has_the_sensors_deviation_along_the_ray() -> None:
    lidar = Lidar(silent(load_sensor("vrx32")), LidarSettings(), SHAPES)
    truth = lidar.scan(bodies(), 0, 0, np.random.default_rng(0)).cloud.points_S.astype(float)
    noisy = scan(seed=3).cloud.points_S.astype(float)
    assert len(truth) > 10_000
    error = np.linalg.norm(noisy, axis=1) - np.linalg.norm(truth, axis=1)
    assert error.std() == pytest.approx(0.01, rel=0.05)
    assert abs(error.mean()) < 5 * 0.01 / len(error) ** 0.5
    across = np.linalg.norm(np.cross(noisy, truth), axis=1) / np.linalg.norm(truth, axis=1)
    assert across.max() < 1e-4


def test_the_same_generator_state_gives_the_same_scan_and_another_gives_another() -> None:
    settings = LidarSettings(dropout=0.1, water_echoes=0.3)
    first, again, other = scan(settings), scan(settings), scan(settings, seed=1)
    np.testing.assert_array_equal(first.cloud.points_S, again.cloud.points_S)
    np.testing.assert_array_equal(first.object_ids, again.object_ids)
    assert not np.array_equal(first.cloud.points_S[:50], other.cloud.points_S[:50])


def test_dropout_loses_its_share() -> None:
    every, some = scan(), scan(LidarSettings(dropout=0.25))
    share = len(some.object_ids) / len(every.object_ids)
    assert share == pytest.approx(0.75, abs=0.02)
    assert len(scan(LidarSettings(dropout=1.0)).object_ids) == 0


def test_an_organised_cloud_has_every_ray_and_the_same_echoes() -> None:
    dense, full = scan(), scan(LidarSettings(organised=True))
    echo = np.isfinite(full.cloud.points_S).all(axis=1)
    assert len(full.cloud.points_S) == 32 * 2187
    np.testing.assert_array_equal(full.cloud.points_S[echo], dense.cloud.points_S)
    np.testing.assert_array_equal(full.object_ids[echo], dense.object_ids)
    assert (full.object_ids[~echo] == NOTHING).all()
    assert np.isinf(full.cloud.points_S[~echo]).all()
    assert full.cloud.ring is not None
    np.testing.assert_array_equal(full.cloud.ring, np.repeat(np.arange(32), 2187))


def test_water_echoes_lie_on_the_water_and_are_faint() -> None:
    settings = LidarSettings(water_echoes=1.0)
    found = scan(settings, without_wall(bodies()))
    water = found.object_ids == WATER
    assert water.sum() > 200
    z_N = found.cloud.points_S[water, 2] - 1.93 + 0.1
    np.testing.assert_allclose(z_N, 0.0, atol=0.02)
    assert found.cloud.intensity is not None
    assert found.cloud.intensity[water].max() < found.cloud.intensity[~water].min()
    dry = scan(scene=without_wall(bodies()))
    assert (~water).sum() == len(dry.object_ids)


def test_water_echoes_fade_with_distance_as_said() -> None:
    sensor = silent(load_sensor("vrx16"))
    lidar = Lidar(sensor, LidarSettings(water_echoes=0.8, water_range_m=12.0), SHAPES)
    alone = Bodies(
        shape=np.zeros(1, dtype=np.int32),
        position_N=np.zeros((1, 3)),
        R_NB=np.eye(3)[None],
        water_z=np.zeros(1),
    )
    found = lidar.scan(alone, 0, 0, np.random.default_rng(0))
    assert found.cloud.ring is not None
    for ring in (3, 5):
        distance = 1.93 / -np.sin(sensor.elevations[ring])
        echoes = ((found.cloud.ring == ring) & (found.object_ids == WATER)).sum()
        expected = 0.8 * np.exp(-distance / 12.0)
        assert echoes / 1875 == pytest.approx(expected, abs=5 * (0.25 / 1875) ** 0.5)


def test_open_water_gives_an_empty_cloud() -> None:
    scene = without_wall(bodies(own_p_N=(0.0, 500.0, 0.1)))
    found = scan(scene=scene)
    assert found.cloud.points_S.shape == (0, 3)


def test_the_sixteen_beam_sensor_sees_its_own_vessel() -> None:
    own = scan(sensor="vrx16").object_ids == 0
    assert own.sum() > 100
