from __future__ import annotations

import numpy as np

from twinscrew.hil_sim.buoys import floating
from twinscrew.hil_sim.sea.sea import Sea, SeaSettings


def test_buoys_stay_in_place_and_follow_the_surface() -> None:
    sea = Sea(SeaSettings(), np.random.default_rng(0))
    places = np.array([[3.0, 4.0], [20.0, 30.0]])
    at_once, later = floating(places, sea, 8.0), floating(places, sea, 10.0)
    np.testing.assert_array_equal(at_once[:, :2], places)
    np.testing.assert_allclose(at_once[:, 2], [-sea.elevation(p, 8.0) for p in places])
    assert (np.abs(later[:, 2] - at_once[:, 2]) > 1e-3).all()
