"""What the tracker must not depend on, and that it knows how far it can be trusted."""

import importlib.util
import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.harness.work import examples
from tests.reference.measurement import depth

from twinscrew.runtime.geometry import rotation_2d
from twinscrew.runtime.messages.types import Objects
from twinscrew.runtime.tracking.lidar import MeasurementSettings, SensorView
from twinscrew.runtime.tracking.tracker import Tracker, TrackerSettings

_path = Path(__file__).parents[1] / "unit" / "tracking" / "scene.py"
_spec = importlib.util.spec_from_file_location("scene", _path)
scene = importlib.util.module_from_spec(_spec)
_spec.loader.exec_module(scene)

PATHS = np.array([[12.0, 3.0, -2.0, 0.5], [-8.0, 6.0, 0.0, 0.0], [6.0, -14.0, 1.0, 2.0]])
"""Three things: north, east [m], their rates [m/s]."""


def track(turn=0.0, shift=(0.0, 0.0), order=slice(None)):
    """Track the three in a world that is turned and shifted as a whole."""
    rng, tracker, R = np.random.default_rng(5), Tracker(), rotation_2d(turn)
    for k in range(25):
        places = PATHS[:, :2] + 0.1 * k * PATHS[:, 2:] + 0.02 * rng.standard_normal((3, 2))
        here = scene.odometry(k * scene.SCAN, shift[0], shift[1], yaw=turn)
        seen = scene.objects(places @ R.T + shift, here, radius=[2.5, 0.5, 2.5])
        answer = tracker.step(
            Objects(
                stamp_ns=seen.stamp_ns,
                p_L=seen.p_L[order],
                radius=seen.radius[order],
                points=seen.points[order],
            ),
            here,
        )
    return answer


@settings(max_examples=examples(15), deadline=None)
@given(
    turn=st.floats(-math.pi, math.pi),
    shift=st.tuples(st.floats(-1e4, 1e4), st.floats(-1e4, 1e4)),
)
def test_a_turned_and_shifted_world_turns_and_shifts_the_tracks(turn, shift):
    here, there, R = track(), track(turn, shift), rotation_2d(turn)
    assert there.p_N == pytest.approx(here.p_N @ R.T + shift, abs=1e-6)
    assert there.v_N == pytest.approx(here.v_N @ R.T, abs=1e-6)
    R_4 = np.kron(np.eye(2), R)
    assert there.covariance == pytest.approx(R_4 @ here.covariance @ R_4.T, abs=1e-6)


@given(order=st.permutations(range(3)))
@settings(max_examples=examples(6), deadline=None)
def test_the_order_of_the_objects_does_not_matter(order):
    def rows(answer):
        table = np.column_stack([answer.p_N, answer.v_N, answer.radius])
        return table[np.lexsort(table.T)]

    assert rows(track(order=list(order))) == pytest.approx(rows(track()), abs=1e-9)


@settings(max_examples=examples(25), deadline=None)
@given(
    places=st.lists(
        st.tuples(st.floats(-20, 20), st.floats(-20, 20), st.floats(0, 5)), min_size=0, max_size=12
    ),
    stamps=st.lists(st.integers(-10, 30), min_size=1, max_size=8),
)
def test_no_scene_and_no_clock_makes_the_tracks_wrong_in_kind(places, stamps):
    tracker, table = Tracker(), np.array(places, dtype=float).reshape(-1, 3)
    for stamp in stamps:
        here = scene.odometry(stamp * scene.SCAN)
        answer = tracker.step(scene.objects(table[:, :2], here, radius=table[:, 2]), here)
        assert len(set(answer.id.tolist())) == len(answer.id)
        for values in (answer.p_N, answer.v_N, answer.covariance, answer.radius):
            assert np.isfinite(values).all()
        for P in answer.covariance:
            assert np.linalg.eigvalsh(P).min() > 0.0


@pytest.mark.slow
def test_the_tracker_knows_its_errors_where_its_model_is_true():
    """The normalised errors squared of 150 runs drawn from the model: mean 4, within its band.

    Chi-squared with 4 x 150 degrees of freedom over 150 has its 95 % band at 4 +- 0.46. The gate,
    the fragments and the jumps are opened so far that they do not act: they are not in the model.
    """
    bias = MeasurementSettings(jump_sigma=1e6, jump=50.0, row_spread_per_m=0.0)
    tracker_settings = TrackerSettings(measurement=bias, rest_psd=1.0, acceleration_psd=1.0)
    errors = [_error_squared(np.random.default_rng(seed), tracker_settings) for seed in range(150)]
    assert 4 - 0.46 < np.mean(errors) < 4 + 0.46


def _error_squared(rng, tracker_settings):
    """Draw one object's motion, bias and noise from the model; give the last scan's NEES."""
    model, radius, points, dt = tracker_settings.measurement, 2.0, 100, 0.1
    p, v = np.array([12.0, 0.0]), rng.normal(0.0, tracker_settings.first_speed_mps, 2)
    v = np.clip(v, -3.0, 3.0)
    spread = radius * np.array([model.bias_along, model.bias_across])
    bias, keep = spread * rng.standard_normal(2), math.exp(-dt / model.bias_time_s)
    white = math.hypot(model.sigma_m, model.scatter * radius / math.sqrt(points))
    tracker = Tracker(tracker_settings)
    for k in range(20):
        if k:
            L = np.linalg.cholesky([[dt**3 / 3, dt**2 / 2], [dt**2 / 2, dt]])
            push = L @ rng.standard_normal((2, 2))
            p, v = p + dt * v + push[0], v + push[1]
            bias = keep * bias + spread * math.sqrt(1 - keep**2) * rng.standard_normal(2)
        here = scene.odometry(k * scene.SCAN, *(p - [12.0, 0.0]))  # so that it stays in sight
        along = (p - here.position_N[:2]) / 12.0
        across = np.array([-along[1], along[0]])
        expected = depth(np.array([11.5]), np.array([radius]), model, SensorView())[0]
        centroid = p - (expected + bias[0]) * along - bias[1] * across
        centroid = centroid + white * rng.standard_normal(2)
        answer = tracker.step(scene.objects([centroid], here, radius, points), here)
    error = np.concatenate([answer.p_N[0] - p, answer.v_N[0] - v])
    return float(error @ np.linalg.solve(answer.covariance[0], error))
