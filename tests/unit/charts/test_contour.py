"""The contour against its definition, point by point, and its laws."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from twinscrew.runtime.charts.contour import contour_of, sector_distances, sector_of

PLACES = st.floats(-30.0, 30.0).map(lambda value: round(value, 2))
EDGES = arrays(np.float64, (5, 2, 2), elements=PLACES)
RANGE_M = 25.0


def turned(points: np.ndarray, angle: float) -> np.ndarray:
    """Turn places, (..., 2), clockwise seen from above."""
    cos, sin = np.cos(angle), np.sin(angle)
    return np.asarray(points @ np.array([[cos, sin], [-sin, cos]]))


def is_clear(edges: np.ndarray, place: np.ndarray) -> bool:
    """Tell whether no edge passes the place within 0.2 m: where sectors change all at once."""
    return bool(contour_of(edges, place, 0.0, RANGE_M).min() > 0.2)


def test_it_is_the_least_distance_of_any_edge_s_point_in_each_sector() -> None:
    generator = np.random.default_rng(1)
    for _ in range(40):
        edges = generator.uniform(-30.0, 30.0, (6, 2, 2))
        place, heading = generator.uniform(-5.0, 5.0, 2), generator.uniform(-4.0, 4.0)
        if not is_clear(edges, place):
            continue
        share = np.linspace(0.0, 1.0, 20_001)[:, None, None]
        points = (edges[:, 0] + share * (edges[:, 1] - edges[:, 0])).reshape(-1, 2) - place
        levelled = (points[:, 0] + 1j * points[:, 1]) * np.exp(-1j * heading)
        expected = np.full(32, RANGE_M)
        np.minimum.at(expected, sector_of(levelled, 32), np.abs(levelled))
        assert np.allclose(contour_of(edges, place, heading, RANGE_M), expected, atol=0.08)


def test_sector_0_is_ahead_and_the_numbers_go_clockwise() -> None:
    for sector, (north, east) in {0: (1, 0), 8: (0, 1), 16: (-1, 0), 24: (0, -1)}.items():
        post = 5.0 * np.array([(north, east), (north, east)], np.float64)[None]
        contour = contour_of(post, np.zeros(2), 0.0, RANGE_M)
        assert np.flatnonzero(contour < RANGE_M).tolist() == [sector]
        assert np.isclose(contour[sector], 5.0)
    ahead = contour_of(np.array([[[0.0, 5.0], [0.0, 5.0]]]), np.zeros(2), np.pi / 2, RANGE_M)
    assert np.isclose(ahead[0], 5.0)


@given(EDGES, arrays(np.float64, 2, elements=PLACES), st.floats(-3.0, 3.0), st.floats(-3.0, 3.0))
@settings(max_examples=60, deadline=None)
def test_the_world_may_turn_with_the_vessel(
    edges: np.ndarray, place: np.ndarray, heading: float, turn: float
) -> None:
    if not is_clear(edges, place):
        return
    still = contour_of(edges, place, heading, RANGE_M)
    moved = contour_of(turned(edges, turn), turned(place, turn), heading + turn, RANGE_M)
    # A corner on the ray between two sectors belongs to either: both neighbours' least agree.
    least = [
        np.minimum(np.minimum(one, np.roll(one, 1)), np.roll(one, -1)) for one in (still, moved)
    ]
    assert np.allclose(least[0], least[1], atol=1e-2) or np.allclose(still, moved, atol=1e-2)


@given(EDGES, st.floats(-3.0, 3.0), st.floats(1.0, 40.0), st.floats(1.0, 40.0))
@settings(max_examples=60, deadline=None)
def test_a_greater_range_never_hides_and_never_brings_nearer(
    edges: np.ndarray, heading: float, one: float, other: float
) -> None:
    near, far = sorted((one, other))
    short, long = (contour_of(edges, np.zeros(2), heading, reach) for reach in (near, far))
    assert np.allclose(np.minimum(long, near), short, atol=1e-4)


@given(EDGES, EDGES, st.floats(-3.0, 3.0))
@settings(max_examples=40, deadline=None)
def test_more_edges_are_the_least_of_both(
    one: np.ndarray, other: np.ndarray, heading: float
) -> None:
    both = contour_of(np.concatenate([one, other]), np.zeros(2), heading, RANGE_M)
    each = [contour_of(edges, np.zeros(2), heading, RANGE_M) for edges in (one, other)]
    assert np.array_equal(both, np.minimum(*each))


def test_inside_everything_is_zero_and_nothing_fixed_is_at_range() -> None:
    nothing = np.empty((0, 2, 2))
    assert (contour_of(nothing, np.zeros(2), 0.0, RANGE_M, inside=True) == 0.0).all()
    assert (contour_of(nothing, np.zeros(2), 0.0, RANGE_M) == RANGE_M).all()


def test_single_precision_gives_the_same() -> None:
    generator = np.random.default_rng(2)
    ends = generator.uniform(-30, 30, (2, 400, 2)) @ np.array([1, 1j])
    exact = sector_distances(ends[0], ends[1], RANGE_M, 32)
    single = ends.astype(np.complex64)
    quick = sector_distances(single[0], single[1], RANGE_M, 32)
    assert quick.dtype == np.float32
    assert np.mean(np.abs(quick - exact) < 1e-3) > 0.999
