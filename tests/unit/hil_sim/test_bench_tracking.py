"""The benchmark of the tracker: its comparison and its arithmetic."""

import importlib.util
import math
from itertools import islice
from pathlib import Path

import numpy as np
import pytest

from twinscrew.hil_sim.bench.quotient import DifferenceQuotient
from twinscrew.hil_sim.bench.tracking import looks
from twinscrew.hil_sim.bench.tracking_score import Truth, VelocityScore

_path = Path(__file__).parents[1] / "tracking" / "scene.py"
_spec = importlib.util.spec_from_file_location("scene", _path)
scene = importlib.util.module_from_spec(_spec)
_spec.loader.exec_module(scene)

TRUTH = Truth(
    np.array([[10.0, 0.0], [0.0, 10.0]]),
    np.array([[2.0, 0.0], [0.0, 0.0]]),
    np.array([1.0, 0.0]),
)


def quotient_of(first, second, points=(200, 200)):
    estimator = DifferenceQuotient()
    for k, (places, count) in enumerate(zip((first, second), points, strict=True)):
        here = scene.odometry(k * scene.SCAN, north=0.3 * k, yaw=0.2 * k)
        p_N, v_N = estimator.step(scene.objects(places, here, points=count), here)
    return p_N, v_N


def test_the_quotient_removes_the_own_motion():
    p_N, v_N = quotient_of([[10.0, 0.0], [0.0, 8.0]], [[10.2, 0.0], [0.0, 8.0]])
    assert p_N == pytest.approx(np.array([[10.2, 0.0], [0.0, 8.0]]))
    assert v_N == pytest.approx(np.array([[2.0, 0.0], [0.0, 0.0]]), abs=1e-6)


def test_the_quotient_gives_up_where_the_gate_or_the_points_say_so():
    assert np.isnan(quotient_of([[10.0, 0.0]], [[10.7, 0.0]])[1]).all()
    assert np.isnan(quotient_of([[10.0, 0.0]], [[10.1, 0.0]], (200, 100))[1]).all()


def test_the_first_scan_has_no_velocity():
    here = scene.odometry()
    _, v_N = DifferenceQuotient().step(scene.objects([[5.0, 5.0]], here), here)
    assert np.isnan(v_N).all()


def test_errors_of_speed_and_course_are_those_worked_out_by_hand():
    score = VelocityScore()
    score.add(TRUTH, 0, np.array([0.0, 3.0]))
    score.add(TRUTH, 1, np.array([0.3, 0.0]))
    score.add(TRUTH, 1, np.array([0.6, 0.0]))
    score.add(TRUTH, 1, np.array([math.nan, 0.0]))
    figures = score.figures()
    assert figures["speed_rmse_mps"] == pytest.approx(1.0)
    assert figures["course_rmse_deg"] == pytest.approx(90.0)
    assert figures["buoys_static_share"] == 0.5
    assert figures["unknown_share"] == 0.25


def test_the_normalised_error_is_that_of_the_textbook():
    score = VelocityScore()
    P = np.diag([0.04, 0.04, 0.25, 0.25])
    score.add_nees(TRUTH, 0, np.array([10.2, 0.0]), np.array([2.0, 0.5]), P)
    assert score.figures()["nees_mean"] == pytest.approx(2.0)


def test_what_is_far_from_everything_is_of_nothing():
    assert TRUTH.nearest(np.array([9.0, 0.5])) == 0
    assert TRUTH.nearest(np.array([30.0, 30.0])) is None


def test_a_look_is_the_same_every_time():
    first, second = (list(islice(looks(3), 4)) for _ in range(2))
    for one, two in zip(first, second, strict=True):
        assert one.objects.p_L.tobytes() == two.objects.p_L.tobytes()
        assert one.truth.v_N.tobytes() == two.truth.v_N.tobytes()
