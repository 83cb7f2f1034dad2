import math

import numpy as np
import pytest
from tests.unit.perception.echoes import LEVEL, cloud, post, sensor, wall

from twinscrew.runtime.errors import ConfigError, MessageError
from twinscrew.runtime.geometry import quaternion_from_euler
from twinscrew.runtime.perception.segmentation import Perception, PerceptionSettings, WaterSettings
from twinscrew.runtime.perception.sensor import load_sensor
from twinscrew.runtime.settings import convert


def test_an_empty_cloud_has_no_objects() -> None:
    objects = Perception(sensor()).step(cloud(np.empty((0, 3))), LEVEL)
    assert objects.stamp_ns == 7
    assert objects.p_L.shape == (0, 2)
    assert objects.radius.shape == objects.points.shape == (0,)


@pytest.mark.parametrize("name", ["vrx16", "vrx32", "vlp16", "hdl32e", "os1_64"])
def test_a_post_is_found_where_it_stands(name: str) -> None:
    objects = Perception(sensor(name)).step(cloud(post(sensor(name), 8.0, -3.0)), LEVEL)
    assert len(objects.radius) == 1
    # The visible side of a cylinder is nearer than its axis, by less than its radius.
    assert math.hypot(*(objects.p_L[0] - [8.0, -3.0])) < 0.4
    assert 0.2 < objects.radius[0] < 0.8


def test_centroid_and_radius_are_the_papers() -> None:
    points_S = post(sensor(), 8.0, -3.0)
    objects = Perception(sensor()).step(cloud(points_S), LEVEL)
    p_L = points_S[:, :2] + sensor().mount_position_B[:2]
    # Rays that coincide share a cell; none do straight ahead.
    assert objects.points[0] == len(points_S)
    assert objects.p_L[0] == pytest.approx(p_L.mean(axis=0), abs=1e-5)
    assert objects.radius[0] == pytest.approx(np.hypot(*(p_L - p_L.mean(axis=0)).T).max(), abs=1e-5)


def test_a_tilted_vessel_sees_the_post_at_the_same_place() -> None:
    q_NB = quaternion_from_euler(0.12, -0.08, 0.0)
    objects = Perception(sensor()).step(cloud(post(sensor(), 8.0, -3.0, q_NB=q_NB)), q_NB)
    assert len(objects.radius) == 1
    assert math.hypot(*(objects.p_L[0] - [8.0, -3.0])) < 0.4


def test_the_heading_does_not_matter() -> None:
    points_S = post(sensor(), 8.0, -3.0)
    perception = Perception(sensor())
    north = perception.step(cloud(points_S), LEVEL)
    west = perception.step(cloud(points_S), quaternion_from_euler(0.0, 0.0, -math.pi / 2))
    assert west.p_L == pytest.approx(north.p_L, abs=1e-5)


def test_two_posts_two_metres_apart_are_two() -> None:
    s = sensor()
    both = np.concatenate([post(s, 10.0, -1.0), post(s, 10.0, 1.0)])
    assert len(Perception(s).step(cloud(both), LEVEL).radius) == 2


def test_fewer_than_twenty_echoes_are_no_object() -> None:
    points_S = post(sensor(), 8.0, -3.0)
    perception = Perception(sensor())
    assert len(perception.step(cloud(points_S[:19]), LEVEL).radius) == 0
    assert (perception.object_image() == -1).all()
    assert len(perception.step(cloud(points_S[:20]), LEVEL).radius) == 1


@pytest.mark.parametrize(
    ("away_m", "echoes", "seen"),
    [
        (20.0, 19, False),
        (20.0, 20, True),
        (35.0, 7, False),
        (35.0, 9, True),
        (58.0, 5, False),
        (58.0, 6, True),
    ],
)
def test_far_objects_need_as_many_fewer_echoes_as_their_angle_is_smaller(
    away_m: float, echoes: int, seen: bool
) -> None:
    """20 echoes up to 22 m; then 20 (22 m / distance)^2, but never fewer than 6."""
    s = sensor()
    points_S = post(s, 0.43 + away_m, 0.0, radius=1.2)
    rows = np.round(np.arcsin(points_S[:, 2] / np.linalg.norm(points_S, axis=1)) / 0.005)
    row = points_S[rows == np.unique(rows)[0]]
    middle = row[np.argsort(abs(row[:, 1]))]
    kept = [middle[k] for k in range(len(middle)) if k < echoes]
    if len(kept) < echoes:  # the rows above see the same columns
        others = points_S[rows != np.unique(rows)[0]]
        near = others[np.argsort(abs(others[:, 1]))]
        kept += list(near[: echoes - len(kept)])
    objects = Perception(s).step(cloud(np.array(kept)), LEVEL)
    assert (len(objects.radius) == 1) is seen
    assert not seen or objects.points[0] == echoes


def test_a_quay_becomes_circles_that_cover_its_face_and_hold_no_own_hull() -> None:
    points_S = wall(sensor(), 3.0)
    objects = Perception(sensor()).step(cloud(points_S), LEVEL)
    assert len(objects.radius) > 5
    assert objects.radius.max() < 4.0
    p_L = points_S[:, :2] + sensor().mount_position_B[:2]
    apart = np.hypot(*(p_L[:, None] - objects.p_L[None]).transpose(2, 0, 1))
    near = np.hypot(*points_S.T) <= 20.0
    assert (apart[near] <= objects.radius + 1e-4).any(axis=1).all()
    keel = np.stack([np.linspace(-2.9, 2.7, 50), np.zeros(50)], axis=1)
    from_keel = np.hypot(*(keel[:, None] - objects.p_L[None]).transpose(2, 0, 1))
    assert (from_keel > objects.radius).all()


def test_echoes_from_the_own_hull_are_masked() -> None:
    perception = Perception(sensor("hdl32e"))
    points_S = post(sensor("hdl32e"), -2.0, 1.0, radius=0.1)
    assert len(points_S) > 0
    perception.project(cloud(points_S), LEVEL)
    assert perception.report.hull == len(points_S)
    assert perception.report.used == 0


def test_water_is_dropped_by_height_and_weak_echoes_higher_up_too() -> None:
    s = sensor()
    p_L = np.array([[10.0, 0.0, -0.15], [10.0, 0.3, -0.5], [10.0, 0.6, -0.5], [10.0, 1.0, -1.5]])
    settings = PerceptionSettings(water=WaterSettings(surface_m=0.1, clearance_m=0.1))
    perception = Perception(s, settings)
    points_S = p_L - s.mount_position_B
    perception.project(cloud(points_S), LEVEL)
    assert perception.report.water == 1
    strength = np.array([100.0, 100.0, 1.0, 1.0], np.float32)
    perception.project(cloud(points_S, intensity=strength), LEVEL)
    assert perception.report.water == 2
    assert sorted(perception.point_image()[perception.point_image() >= 0]) == [1, 3]


def test_the_surface_tilts_with_the_vessel() -> None:
    s = sensor()
    point_S = np.array([[15.0, 0.0, 0.2]]) - s.mount_position_B  # 0.2 m under the origin's level
    perception = Perception(s)
    assert perception.project(cloud(point_S), LEVEL).water == 1
    bow_up = quaternion_from_euler(0.0, 0.1, 0.0)
    assert perception.project(cloud(point_S), bow_up).water == 0


def test_coinciding_rays_keep_the_nearer_echo() -> None:
    astern = np.array(
        [[-8.0, 0.0, -0.5], [-7.0, 1e-7, -0.5 * 7 / 8], [np.nan, 0.0, 0.0], [0, 0, 0]]
    )
    perception = Perception(sensor())
    report = perception.project(cloud(astern), LEVEL)
    assert (report.points, report.used, report.hidden, report.empty) == (4, 1, 1, 2)
    assert perception.range_image().max() == pytest.approx(np.hypot(7.0, 0.5 * 7 / 8))


@pytest.mark.parametrize("tells_time", [True, False])
def test_a_scan_that_takes_time_is_put_as_seen_at_its_stamp(tells_time: bool) -> None:
    s = sensor("vlp16")
    rate, velocity = np.array([0.0, 0.0, 0.6]), np.array([2.0, 0.5, 0.0])
    still = post(s, 9.0, 4.0)
    column = np.round((np.arctan2(still[:, 1], still[:, 0]) - s.first_azimuth) / s.azimuth_step)
    time = column / s.columns.count * 0.1
    # Where the turning, moving sensor sees the same places at that time.
    p_L = still + s.mount_position_B - velocity * time[:, None]
    c, sn = np.cos(-rate[2] * time), np.sin(-rate[2] * time)
    moved = np.stack([c * p_L[:, 0] - sn * p_L[:, 1], sn * p_L[:, 0] + c * p_L[:, 1], p_L[:, 2]], 1)
    more = {"time_offset_s": time.astype(np.float32)} if tells_time else {}
    scan = cloud(moved - s.mount_position_B, **more)
    skewed = Perception(s).step(scan, LEVEL)
    straight = Perception(s).step(scan, LEVEL, rate, velocity)
    truth = (still + s.mount_position_B)[:, :2].mean(axis=0)
    assert math.hypot(*(skewed.p_L[0] - truth)) > 0.15
    assert math.hypot(*(straight.p_L[0] - truth)) < 0.02


def test_an_attitude_that_is_no_number_is_refused() -> None:
    with pytest.raises(MessageError, match="attitude is not finite"):
        Perception(sensor()).step(cloud(np.ones((1, 3))), np.array([np.nan, 0, 0, 0]))


def test_a_sensor_without_a_mount_is_refused_at_once() -> None:
    with pytest.raises(ConfigError, match="no mount"):
        Perception(load_sensor("os1_64"))


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ({"theta_rad": 0.0}, "theta_rad"),
        ({"piece_m": 9.0}, "piece_m"),
        ({"water": {"clearance": 1.0}}, "unknown key"),
        ({"hull": {"aft_m": 2.9, "fore_m": -2.7}}, "aft_m must be less than fore_m"),
    ],
)
def test_settings_that_cannot_be_are_refused(values: dict[str, object], words: str) -> None:
    with pytest.raises(ConfigError, match=words):
        convert(values, PerceptionSettings)
