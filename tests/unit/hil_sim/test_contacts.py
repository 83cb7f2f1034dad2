from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from twinscrew.hil_sim.contacts import HullCircles, Obstacles, distance_to_box, reaches
from twinscrew.hil_sim.contacts import gaps as gaps_with
from twinscrew.runtime.vessel_description import load_vessel

NOTHING = Obstacles(circles=np.empty((0, 3)), boxes=np.empty((0, 6)))


def gaps(
    position: np.ndarray, radius: float, present: np.ndarray, obstacles: Obstacles
) -> np.ndarray:
    hulls = HullCircles(
        [dataclasses.replace(load_vessel(), circles_m=((0.0, radius),))] * len(position)
    )
    return gaps_with(position, reaches(hulls, present, obstacles), obstacles)


def test_gaps_are_distances_between_surfaces() -> None:
    obstacles = Obstacles(
        circles=np.array([[10.0, 0.0, 0.75]]), boxes=np.array([[0.0, -20.0, 6.0, 4.0, 1.0, 0.0]])
    )
    found = gaps(np.array([[0.0, 0.0], [3.0, 4.0]]), 2.0, np.array([True, True]), obstacles)
    # Rows are vessels; columns are vessel, vessel, buoy, quay (whose side is at east -18).
    np.testing.assert_allclose(found[0], [np.inf, 1.0, 7.25, 16.0])
    np.testing.assert_allclose(found[1], [1.0, np.inf, math.hypot(7, 4) - 2.75, 20.0])


def test_overlap_is_negative() -> None:
    found = gaps(np.array([[0.0, 0.0], [0.0, 3.0]]), 2.0, np.array([True, True]), NOTHING)
    assert found[0, 1] == pytest.approx(-1.0)


def test_who_has_left_the_map_touches_nobody() -> None:
    position = np.array([[0.0, 0.0], [0.0, 1.0], [0.0, 9.0]])
    found = gaps(position, 2.0, np.array([True, False, True]), NOTHING)
    assert np.isinf(found[1]).all()
    assert np.isinf(found[:, 1]).all()
    assert found[0, 2] == pytest.approx(5.0)


@given(
    angle=st.floats(-4, 4), along=st.floats(-9, 9), across=st.floats(-9, 9), turn=st.floats(-4, 4)
)
def test_the_distance_to_a_box_does_not_depend_on_where_it_lies(
    angle: float, along: float, across: float, turn: float
) -> None:
    def place(heading: float, centre: np.ndarray) -> float:
        c, s = math.cos(heading), math.sin(heading)
        point = centre + np.array([[c, -s], [s, c]]) @ [along, across]
        return float(distance_to_box(point[None], np.array([*centre, 6.0, 2.0, 1.0, heading]))[0])

    expected = math.hypot(max(abs(along) - 3, 0), max(abs(across) - 1, 0))
    assert place(0.0, np.zeros(2)) == pytest.approx(expected)
    assert place(turn, np.array([angle, -7.0])) == pytest.approx(expected, abs=1e-9)
