"""The static map's laws: one forbidden region, whoever asks and in whatever order it was made."""

import math
import subprocess
import sys

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.harness.work import examples

from twinscrew.runtime.charts.static_map import MOST_VERTICES, Area, Disc, StaticMap
from twinscrew.runtime.errors import ConfigError

PLACES = st.tuples(*[st.floats(-200.0, 200.0)] * 2)
SOLID = st.sampled_from(["land", "keep_out", "fence"])


@st.composite
def stars(draw, keep_in=False):
    """A star-shaped polygon, seldom a convex one, in either direction, with or without a hole."""
    centre = np.array(draw(PLACES))
    radii = np.array(draw(st.lists(st.floats(2.0, 60.0), min_size=3, max_size=9)))
    bearings = np.linspace(0.0, 2.0 * np.pi, len(radii), endpoint=False)
    around = np.stack([np.cos(bearings), np.sin(bearings)], axis=1)
    if draw(st.booleans()):
        radii, around = radii[::-1], around[::-1]
    # The least distance from the centre to an edge of three or more vertices at 2 m is 1 m.
    hole = (centre + 0.3 * around,) if draw(st.booleans()) else ()
    kind = "fence" if keep_in else draw(SOLID)
    return Area(
        kind=kind, outline=centre + radii[:, None] * around, holes=hole, keep_in=keep_in, name="a"
    )


@st.composite
def discs(draw, keep_in=False):
    kind = "fence" if keep_in else draw(st.sampled_from(["hazard", "fence"]))
    return Disc(
        kind=kind, centre=draw(PLACES), radius_m=draw(st.floats(0.5, 80.0)), keep_in=keep_in
    )


OBSTACLES = st.one_of(stars(), discs())
FENCES = st.one_of(stars(keep_in=True), discs(keep_in=True))
FEATURES = st.tuples(
    st.lists(OBSTACLES, max_size=4), st.lists(FENCES, max_size=2)
).map(lambda both: both[0] + both[1])  # fmt: skip
POINTS = st.lists(PLACES, min_size=1, max_size=30).map(lambda p: np.array(p, np.float64))


@settings(max_examples=examples(25))
@given(features=FEATURES, points=POINTS)
def test_the_distance_is_zero_exactly_where_it_is_forbidden(features, points):
    chart = StaticMap.of(features)
    np.testing.assert_array_equal(chart.distance_m(points) == 0.0, chart.forbidden(points))


def test_features_too_small_for_the_grid_are_near_nothing():
    specks = [Disc(kind="fence", centre=(k, 0.0), radius_m=1e-4) for k in (0.0, 5.0004)]
    chart = StaticMap.of(specks)
    assert not chart.is_empty
    assert np.isinf(chart.distance_m(np.array([[100.0, 100.0]]))).all()


@settings(max_examples=examples(25))
@given(features=FEATURES, points=POINTS)
def test_the_distance_is_that_to_the_nearest_edge(features, points):
    chart = StaticMap.of(features)
    free = points[~chart.forbidden(points)]
    if not len(chart.edges):
        assert not len(free) or np.isinf(chart.distance_m(free)).all()
        return
    expected = [distance_to_segments(point, chart.edges).min() for point in free]
    np.testing.assert_allclose(chart.distance_m(free), expected, atol=1e-9)


@settings(max_examples=examples(25))
@given(features=FEATURES, points=POINTS)
def test_a_place_is_forbidden_if_any_feature_forbids_it(features, points):
    """By the crossing number of each polygon alone; within 2 mm of an edge either is right."""
    chart = StaticMap.of(features)
    expected = np.zeros(len(points), bool)
    certain = np.ones(len(points), bool)
    for outline in chart.polygons:
        rings = (outline.ring, *outline.holes)
        inside = np.logical_xor.reduce([crossings_are_odd(points, ring) for ring in rings])
        expected |= ~inside if outline.keep_in else inside
        for ring in rings:
            segments = np.stack([ring[:-1], ring[1:]], axis=1)
            certain &= [distance_to_segments(p, segments).min() > 2e-3 for p in points]
    np.testing.assert_array_equal(chart.forbidden(points)[certain], expected[certain])


@settings(max_examples=examples(25))
@given(features=FEATURES, random=st.randoms(use_true_random=False))
def test_the_order_of_features_makes_no_difference(features, random):
    shuffled = random.sample(features, len(features))
    first, second = StaticMap.of(features), StaticMap.of(shuffled)
    np.testing.assert_array_equal(first.edges, second.edges)
    assert first.version == second.version


@settings(max_examples=examples(25))
@given(features=FEATURES)
def test_what_is_forbidden_lies_to_the_left_of_every_edge(features):
    chart = StaticMap.of(features)
    along = chart.edges[:, 1] - chart.edges[:, 0]
    lengths = np.hypot(*along.T)
    assert (lengths > 0.0).all()
    left = np.stack([-along[:, 1], along[:, 0]], axis=1) / np.maximum(lengths, 1e-9)[:, None]
    middle = chart.edges.mean(axis=1)
    # Half of the grid: nothing is thinner than that.
    assert chart.forbidden(middle + 2e-4 * left).all()
    assert not chart.forbidden(middle - 2e-4 * left).any()


@settings(max_examples=examples(25))
@given(fence=stars(), points=POINTS)
def test_an_inclusion_fence_forbids_what_the_exclusion_fence_of_its_outline_leaves(fence, points):
    kept_in = Area(kind="fence", outline=fence.outline, holes=fence.holes, keep_in=True)
    kept_out = Area(kind="fence", outline=fence.outline, holes=fence.holes)
    inside, outside = StaticMap.of([kept_in]), StaticMap.of([kept_out])
    far = np.minimum(*[np.array([distance_to_segments(p, m.edges).min() for p in points])
                       for m in (inside, outside)]) > 2e-3  # fmt: skip
    np.testing.assert_array_equal(inside.forbidden(points)[far], ~outside.forbidden(points)[far])


@settings(max_examples=examples(25))
@given(features=FEATURES, point=PLACES, radius=st.floats(0.0, 300.0))
def test_the_near_edges_are_those_within_the_radius(features, point, radius):
    chart = StaticMap.of(features)
    distances = distance_to_segments(np.array(point), chart.edges)
    near = chart.near(np.array(point), radius)
    rows = {edge.tobytes() for edge in near}
    certain = np.abs(distances - radius) > 1e-9
    for edge, inside in zip(chart.edges[certain], (distances < radius)[certain], strict=True):
        assert (edge.tobytes() in rows) == inside
    assert len(near) <= len(chart.edges)


@settings(max_examples=examples(25))
@given(disc=discs())
def test_the_polygon_of_a_hazard_goes_around_its_circle(disc):
    chart = StaticMap.of([disc])
    bearings = np.linspace(0.0, 2.0 * np.pi, 100)
    around = np.stack([np.cos(bearings), np.sin(bearings)], axis=1)
    assert chart.forbidden(disc.centre + (disc.radius_m - 2e-3) * around).all()
    assert not chart.forbidden(disc.centre + (1.01 * disc.radius_m + 2e-3) * around).any()


@settings(max_examples=examples(25))
@given(disc=discs(keep_in=True))
def test_a_circular_inclusion_fence_leaves_nothing_outside_of_its_circle(disc):
    chart = StaticMap.of([disc])
    bearings = np.linspace(0.0, 2.0 * np.pi, 100)
    around = np.stack([np.cos(bearings), np.sin(bearings)], axis=1)
    assert chart.forbidden(disc.centre + (disc.radius_m + 2e-3) * around).all()
    assert not chart.forbidden(disc.centre + (0.99 * disc.radius_m - 2e-3) * around).any()


@settings(max_examples=examples(25))
@given(features=FEATURES, point=PLACES)
def test_a_reason_is_given_exactly_where_it_is_forbidden(features, point):
    chart = StaticMap.of(features)
    here = np.array(point)
    assert bool(chart.why(here)) == chart.forbidden(here[None])[0]


@settings(max_examples=examples(25))
@given(features=FEATURES, start=PLACES, end=PLACES)
def test_a_way_is_blocked_if_any_place_on_it_is_forbidden(features, start, end):
    chart = StaticMap.of(features)
    a, b = np.array(start), np.array(end)
    places = a + np.linspace(0.0, 1.0, 200)[:, None] * (b - a)
    if chart.forbidden(places).any():
        assert chart.blocks(a, b)
    elif chart.distance_m(places).min() > math.dist(a, b) / 200:
        assert not chart.blocks(a, b)


@settings(max_examples=examples(25))
@given(features=FEATURES)
def test_the_region_in_a_box_has_the_area_that_its_points_say(features):
    chart = StaticMap.of(features)
    region = chart.region((-50.0, -50.0), (50.0, 50.0))
    axis = np.linspace(-49.5, 49.5, 100)
    grid = np.stack(np.meshgrid(axis, axis), axis=-1).reshape(-1, 2)
    boundary_m = region.length + 400.0
    # A cell of 1 m is judged by its middle: it can be wrong only where the boundary crosses it.
    assert abs(chart.forbidden(grid).sum() - region.area) <= 1.5 * boundary_m


def test_only_water_shallower_than_the_safety_depth_is_forbidden():
    square = np.array([[0.0, 0.0], [10.0, 0.0], [10.0, 10.0], [0.0, 10.0]])
    shoal = Area(kind="depth", outline=square, depth_m=1.5)
    basin = Area(kind="depth", outline=square + np.array([0.0, 20.0]), depth_m=5.0)
    chart = StaticMap.of([shoal, basin], safety_depth_m=2.0)
    assert chart.why(np.array([5.0, 5.0])) == "in water shallower than 2 m"
    assert chart.why(np.array([5.0, 25.0])) == ""
    assert StaticMap.of([shoal, basin], safety_depth_m=1.0).is_empty
    assert len(chart.features) == 2


def test_two_fences_that_do_not_meet_leave_no_water():
    fences = [
        Disc(kind="fence", centre=(north, 0.0), radius_m=10.0, keep_in=True)
        for north in (0.0, 100.0)
    ]
    chart = StaticMap.of(fences)
    assert not chart.leaves_water
    assert chart.forbidden(np.array([[0.0, 0.0]])).all()
    assert StaticMap.of(fences[:1]).leaves_water


def test_the_version_changes_with_the_content():
    rock = Disc(kind="hazard", centre=(1.0, 2.0), radius_m=3.0)
    versions = [
        StaticMap.empty().version,
        StaticMap.of([rock]).version,
        StaticMap.of([Disc(kind="hazard", centre=(1.0, 2.0), radius_m=3.001)]).version,
        StaticMap.of([Disc(kind="fence", centre=(1.0, 2.0), radius_m=3.0)]).version,
    ]
    assert versions[0] == 0
    assert len(set(versions)) == 4


@pytest.mark.parametrize(
    ("feature", "words"),
    [
        (Area(kind="land", outline=np.array([[0.0, 0], [10, 10], [10, 0], [0, 10]]), name="Mole"),
         "land 'Mole': the outline crosses itself at north 5.00 m, east 5.00 m"),
        (Area(kind="land", outline=np.array([[0.0, 0], [1, 0], [0, 0]])), "fewer than three"),
        (Area(kind="land", outline=np.array([[0.0, 0], [1, 0], [2, 0]])), "crosses itself|without area"),  # noqa: E501
        (Area(kind="land", outline=np.array([[0.0, 0], [1, 0], [np.nan, 0]])), "within 1e\\+06 m"),
        (Area(kind="land", outline=np.array([[0.0, 0], [2e6, 0], [0, 3]])), "within 1e\\+06 m"),
        (Disc(kind="hazard", centre=(0.0, 0.0), radius_m=0.0), "a radius of 0 m"),
        (Disc(kind="hazard", centre=(0.0, 0.0), radius_m=1.0, keep_in=True), "only a fence"),
        (Area(kind="land", outline=np.zeros((MOST_VERTICES + 1, 2))), "at most 50000"),
    ],
)  # fmt: skip
def test_what_is_no_area_is_refused_by_name(feature, words):
    with pytest.raises(ConfigError, match=words):
        StaticMap.of([feature])


def test_an_empty_map_does_not_import_shapely():
    """It takes 25 ms of a boat's start; only boats with a map wait for it."""
    code = (
        "import sys, numpy as np\n"
        "from twinscrew.runtime.charts.static_map import StaticMap\n"
        "chart, here = StaticMap.empty(), np.zeros((1, 2))\n"
        "chart.edges, chart.polygons, chart.forbidden(here), chart.distance_m(here)\n"
        "chart.near(here[0], 9.0), chart.why(here[0]), chart.blocks(here[0], here[0])\n"
        "assert chart.leaves_water and 'shapely' not in sys.modules\n"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


def distance_to_segments(point, segments):
    """[m] (S,) By projection on each segment."""
    start, along = segments[:, 0], segments[:, 1] - segments[:, 0]
    length2 = np.maximum((along**2).sum(axis=1), 1e-30)
    share = np.clip(((point - start) * along).sum(axis=1) / length2, 0.0, 1.0)
    return np.hypot(*(start + share[:, None] * along - point).T)


def crossings_are_odd(points, ring):
    """(P,) Whether a ray to the east from each point crosses the ring an odd number of times."""
    a, b = ring[:-1], ring[1:]
    north, east = points[:, :1], points[:, 1:]
    spans = (a[:, 0] > north) != (b[:, 0] > north)
    rise = np.where(b[:, 0] == a[:, 0], 1.0, b[:, 0] - a[:, 0])
    at = a[:, 1] + (north - a[:, 0]) / rise * (b[:, 1] - a[:, 1])
    return (spans & (at > east)).sum(axis=1) % 2 == 1
