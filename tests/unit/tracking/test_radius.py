"""The radius: a high quantile of what was seen."""

import numpy as np
import pytest

from twinscrew.runtime.tracking.lidar import RadiusSettings, smoothed_radius


def follow(measured, start=1.0, **settings):
    radius = start
    for value in measured:
        radius = smoothed_radius(radius, float(value), RadiusSettings(**settings))
    return radius


def test_a_steady_radius_is_reached_exactly():
    assert follow([2.5] * 100) == 2.5
    assert follow([0.5] * 200) == 0.5


def test_it_grows_faster_than_it_shrinks():
    grown, shrunk = follow([9.0], start=2.0) - 2.0, 2.0 - follow([0.1], start=2.0)
    assert grown == pytest.approx(9 * shrunk)


def test_one_merged_scan_moves_it_by_one_step():
    assert follow([50.0], start=2.0) == pytest.approx(2.0 * 1.09)


def test_it_settles_where_the_quantile_is():
    measured = np.random.default_rng(0).uniform(1.0, 3.0, 20_000)
    assert follow(measured, start=2.0, step=0.002) == pytest.approx(2.8, abs=0.05)


def test_without_steps_it_stays():
    assert follow([5.0, 0.1], start=2.0, step=0.0) == 2.0
