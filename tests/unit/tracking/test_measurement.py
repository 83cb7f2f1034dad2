"""What a scan says of the objects' centres."""

import importlib.util
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from tests.reference.measurement import bias_variance, depth, observation_matrix
from tests.reference.measurement import measure as plain_measure

from twinscrew.runtime.errors import ConfigError
from twinscrew.runtime.settings import convert
from twinscrew.runtime.tracking.lidar import Centroids, MeasurementSettings, SensorView, Viewpoint

_spec = importlib.util.spec_from_file_location("scene", Path(__file__).with_name("scene.py"))
scene = importlib.util.module_from_spec(_spec)
_spec.loader.exec_module(scene)

SETTINGS, VIEW = MeasurementSettings(), SensorView()


def seen(p_N, **kwargs):
    ego = scene.odometry(north=3.0, east=-2.0, yaw=0.8)
    return Centroids(SETTINGS, VIEW).measure(scene.objects(p_N, ego, **kwargs), Viewpoint.of(ego))


def test_centres_lie_behind_centroids_on_the_line_of_sight():
    centroid = np.array([15.0, -2.0])  # 12 m north of the own vessel
    measured = seen([centroid], radius=0.5)
    assert measured.z_N[0] == pytest.approx([15.0 + SETTINGS.small_depth_m, -2.0])


def test_a_half_lit_cylinder_has_the_depth_of_a_buoy():
    # Points of a tower of radius 0.4 m, evenly spread across the line of sight.
    across = np.linspace(-0.4, 0.4, 2001)
    before_axis = np.sqrt(0.4**2 - across**2).mean()
    assert before_axis == pytest.approx(0.4 * math.pi / 4, rel=1e-3)
    assert SETTINGS.small_depth_m == pytest.approx(before_axis, abs=0.01)


def test_a_hulls_depth_follows_the_table_and_a_buoys_does_not():
    far, near = (
        float(depth(np.array([d]), np.array([2.8]), SETTINGS, VIEW)[0]) for d in (19.5, 7.0)
    )
    assert (far, near) == pytest.approx((1.0, 0.02))
    buoys = depth(np.array([7.0, 19.5]), np.array([0.5, 0.5]), SETTINGS, VIEW)
    assert buoys == pytest.approx([SETTINGS.small_depth_m] * 2)


def test_between_buoy_and_hull_the_depth_has_no_step():
    radius = np.linspace(0.5, 2.0, 1000)
    assert np.abs(np.diff(depth(np.full(1000, 19.0), radius, SETTINGS, VIEW))).max() < 0.002


def test_more_points_say_more():
    few, many = (seen([[15.0, 0.0]], points=n).R[0, 0, 0] for n in (20, 2000))
    assert few > 2 * many


def test_what_may_be_cut_off_by_the_range_says_less():
    whole, part = (seen([[3.0 + d, -2.0]], radius=2.0).R[0, 0, 0] for d in (57.0, 58.0))
    assert part > 4 * whole


def test_a_bias_along_the_line_of_sight_brings_the_centroid_nearer():
    (H,) = observation_matrix(np.array([[0.6, 0.8]]))
    assert H @ np.array([10.0, 20.0, 1.0, 1.0, 0.5, 0.0]) == pytest.approx([9.7, 19.6])


def test_the_biases_axes_are_perpendicular_units():
    (H,) = observation_matrix(np.array([[0.6, 0.8]]))
    assert H[:, 4:].T @ H[:, 4:] == pytest.approx(np.eye(2))


def test_an_object_on_the_sensor_has_a_finite_measurement():
    measured = seen([[3.0, -2.0]])
    assert np.isfinite(measured.z_N).all()
    assert np.isfinite(measured.H).all()


VIEWS = (SensorView(), SensorView(1.2, 0.4, 0.01), SensorView(3.0, 0.05, 0.04))


@pytest.mark.parametrize("view", VIEWS)
def test_the_native_model_is_the_plain_one(view):
    rng = np.random.default_rng(0)
    ego = scene.odometry(north=300.0, east=-2.0, yaw=2.8)
    p_N = ego.position_N[:2] + rng.uniform(-20.0, 20.0, (200, 2))
    objects = scene.objects(p_N, ego, radius=rng.uniform(0.2, 4.0, 200))
    objects.points[:] = rng.integers(0, 300, 200)
    objects.p_L[7], objects.radius[11] = np.nan, np.inf
    found = Centroids(SETTINGS, view).measure(objects, Viewpoint.of(ego))
    plain = plain_measure(objects, ego, SETTINGS, view)
    for name in ("z_N", "H", "R", "radius", "gate"):
        assert getattr(found, name) == pytest.approx(getattr(plain, name), abs=1e-12)


@pytest.mark.parametrize("view", VIEWS)
def test_the_native_spread_is_the_plain_one(view):
    rng, ego = np.random.default_rng(1), scene.odometry(north=3.0)
    p_N, radius = rng.uniform(-20.0, 20.0, (200, 2)), rng.uniform(0.2, 4.0, 200)
    distance = np.hypot(*(p_N - ego.position_N[:2]).T)
    found = Centroids(SETTINGS, view).bias_variance(p_N, radius, ego.position_N[:2])
    assert found == pytest.approx(bias_variance(distance, radius, SETTINGS, view), rel=1e-12)


def test_a_hull_between_wider_rows_is_less_sure_and_a_buoy_is_not():
    ego = scene.odometry()
    p_N, radius = np.array([[15.0, 0.0], [15.0, 0.0]]), np.array([2.8, 0.5])
    fine, coarse = (
        Centroids(SETTINGS, SensorView(row_rad=row)).bias_variance(p_N, radius, ego.position_N[:2])
        for row in (0.0125, 0.035)
    )
    assert (coarse[0] > 1.5 * fine[0]).all()
    assert np.array_equal(coarse[1], fine[1])


def test_a_sensor_that_looks_down_further_sees_the_near_side_from_nearer():
    hull, near = np.array([2.8]), np.array([7.2])
    steep = SensorView(lowest_rad=math.radians(22.5))
    assert float(depth(near, hull, SETTINGS, steep)[0]) == pytest.approx(0.47, abs=0.02)
    assert float(depth(near, hull, SETTINGS, VIEW)[0]) == pytest.approx(0.02)
    far = np.array([19.5])
    assert depth(far, hull, SETTINGS, steep) == depth(far, hull, SETTINGS, VIEW)


def test_arrays_that_disagree_are_refused():
    ego = scene.odometry()
    objects = scene.objects([[5.0, 0.0], [9.0, 1.0]], ego)
    with pytest.raises(ValueError, match="of each object"):
        Centroids(SETTINGS, VIEW).measure(
            replace(objects, radius=objects.radius[:1]), Viewpoint.of(ego)
        )


@pytest.mark.parametrize(
    "values",
    [
        {"range_m": [5.0, 6.0], "depth_m": [0.1]},
        {"range_m": [], "depth_m": []},
        {"range_m": [6.0, 5.0], "depth_m": [0.1, 0.2]},
        {"buoy_hull_m": [1.5, 0.7]},
    ],
)
def test_a_table_that_is_none_is_refused(values):
    with pytest.raises(ConfigError):
        convert(values, MeasurementSettings)
