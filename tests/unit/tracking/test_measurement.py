"""What a scan says of the objects' centres."""

import importlib.util
import math
from pathlib import Path

import numpy as np
import pytest

from twinscrew.runtime.errors import ConfigError
from twinscrew.runtime.settings import convert
from twinscrew.runtime.tracking.measurement import (
    MeasurementSettings,
    depth,
    measure,
    observation_matrix,
)

_spec = importlib.util.spec_from_file_location("scene", Path(__file__).with_name("scene.py"))
scene = importlib.util.module_from_spec(_spec)
_spec.loader.exec_module(scene)

SETTINGS = MeasurementSettings()


def seen(p_N, **kwargs):
    ego = scene.odometry(north=3.0, east=-2.0, yaw=0.8)
    return measure(scene.objects(p_N, ego, **kwargs), ego, SETTINGS)


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
    far, near = (float(depth(np.array([d]), np.array([2.8]), SETTINGS)[0]) for d in (19.5, 7.0))
    assert (far, near) == pytest.approx((1.0, 0.02))
    buoys = depth(np.array([7.0, 19.5]), np.array([0.5, 0.5]), SETTINGS)
    assert buoys == pytest.approx([SETTINGS.small_depth_m] * 2)


def test_between_buoy_and_hull_the_depth_has_no_step():
    radius = np.linspace(0.5, 2.0, 1000)
    assert np.abs(np.diff(depth(np.full(1000, 19.0), radius, SETTINGS))).max() < 0.002


def test_more_points_say_more():
    few, many = (seen([[15.0, 0.0]], points=n).R[0, 0, 0] for n in (20, 2000))
    assert few > 2 * many


def test_what_may_be_cut_off_by_the_range_says_less():
    whole, part = (seen([[3.0 + d, -2.0]], radius=2.0).R[0, 0, 0] for d in (17.0, 18.0))
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
