"""Laws of routes: they keep clear of what is fixed, are hardly longer than they must be, and exist
whenever the water is joined."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st
from numpy.random import Generator
from scipy.ndimage import label
from shapely import LineString, STRtree, get_coordinates, linestrings, points

from twinscrew.runtime.charts.route import FINEST_SHARE, Route, Router, RouteSettings
from twinscrew.runtime.charts.static_map import Area, Disc, Feature, StaticMap
from twinscrew.runtime.messages.types import Float64

SIDE_M = 80.0
RULES = RouteSettings()
LEAST_M = RULES.least_clearance_m
SEEDS = st.integers(0, 10_000)


def waters(rng: Generator, count: int = 12) -> StaticMap:
    """Piers at any angle, piles, and now and then a fence around it all."""
    features: list[Feature] = []
    for _ in range(count):
        centre = rng.uniform(0.0, SIDE_M, 2)
        if rng.uniform() < 0.3:
            features.append(Disc(kind="hazard", centre=tuple(centre), radius_m=rng.uniform(0.3, 3)))
            continue
        size, angle = rng.uniform(1.0, [30.0, 6.0]), rng.uniform(0.0, math.pi)
        turn = np.array([[math.cos(angle), math.sin(angle)], [-math.sin(angle), math.cos(angle)]])
        corners = size / 2 * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) @ turn
        features.append(Area(kind="land", outline=centre + corners))
    if rng.uniform() < 0.5:
        ring = np.array([[-5, -5], [SIDE_M + 5, -5], [SIDE_M + 5, SIDE_M + 5], [-5, SIDE_M + 5]])
        features.append(Area(kind="fence", outline=ring, keep_in=True))
    return StaticMap.of(features)


def drawn(seed: int) -> tuple[StaticMap, Float64, Float64]:
    """Waters, a start and a goal with the least clearance and some more."""
    rng = np.random.default_rng(seed)
    chart = waters(rng)
    places = rng.uniform(0.0, SIDE_M, (200, 2))
    clear = places[chart.distance_m(places) > LEAST_M + 1e-3]
    assume(len(clear) >= 2)
    return chart, clear[0], clear[1]


def clearance_m(chart: StaticMap, route: Route) -> float:
    """From all of a route to the edges of what is forbidden, by shapely."""
    tree = STRtree(linestrings(chart.edges))
    way = LineString(route.places_N)
    return float(tree.geometries.take(tree.nearest(way)).distance(way))


@given(SEEDS)
@settings(max_examples=60, deadline=None)
def test_no_leg_is_nearer_to_what_is_fixed_than_the_least_clearance(seed: int) -> None:
    chart, start_N, goal_N = drawn(seed)
    route = Router(RULES, chart).route(start_N, goal_N)
    assume(not route.reason)
    np.testing.assert_array_equal(route.places_N[[0, -1]], [start_N, goal_N])
    assert clearance_m(chart, route) >= LEAST_M - 1e-4
    assert not chart.forbidden(route.places_N).any()


CELL_M = 0.5


def flooded(chart: StaticMap, start_N: Float64, goal_N: Float64, clear_m: float) -> bool:
    """Whether a fill of cells whose middles have a clearance gets from start to goal."""
    low = -25.0
    axis = np.arange(low, SIDE_M - low, CELL_M) + CELL_M / 2
    middles = np.stack(np.meshgrid(axis, axis, indexing="ij"), axis=-1)
    free = (chart.distance_m(middles.reshape(-1, 2)) >= clear_m).reshape(len(axis), len(axis))
    first, last = (tuple(((p - low) / CELL_M).astype(int)) for p in (start_N, goal_N))
    free[first] = free[last] = True
    joined, _ = label(free, np.ones((3, 3)))
    return bool(joined[first] == joined[last])


@given(SEEDS)
@settings(max_examples=12, deadline=None)
@pytest.mark.slow
def test_a_route_exists_if_and_only_if_a_flood_gets_there(seed: int) -> None:
    """Between the two clearances either answer is right: cells are no finer."""
    chart, start_N, goal_N = drawn(seed)
    found = not Router(RULES, chart).route(start_N, goal_N).reason
    if found:
        assert flooded(chart, start_N, goal_N, LEAST_M - CELL_M)
    else:
        assert not flooded(chart, start_N, goal_N, (1.0 + FINEST_SHARE) * LEAST_M)


def shortest_m(chart: StaticMap, start_N: Float64, goal_N: Float64) -> float:
    """The shortest way at the least clearance, by a graph of all corners in sight of each other."""
    region = chart.region((-40.0, -40.0), (SIDE_M + 40.0, SIDE_M + 40.0))
    around = LEAST_M / math.cos(math.pi / 24) + 1e-3  # so that a circle's sides keep the clearance
    grown = region.buffer(around, quad_segs=6)
    inner = region.buffer(LEAST_M - 1e-3, quad_segs=24)
    corners = get_coordinates(grown)
    inside = (corners > -39).all(axis=1) & (corners < SIDE_M + 39).all(axis=1)
    nodes = np.concatenate([[start_N, goal_N], corners[inside]])
    i, j = np.triu_indices(len(nodes), 1)
    sees = ~inner.intersects(linestrings(np.stack([nodes[i], nodes[j]], axis=1)))
    length = np.hypot(*(nodes[i] - nodes[j]).T)
    away = np.full((len(nodes), len(nodes)), np.inf)
    away[i[sees], j[sees]] = away[j[sees], i[sees]] = length[sees]
    best, done = np.full(len(nodes), np.inf), np.zeros(len(nodes), bool)
    best[0] = 0.0
    for _ in nodes:
        k = int(np.where(done, np.inf, best).argmin())
        done[k] = True
        best = np.minimum(best, best[k] + away[k])
    return float(best[1])


@given(SEEDS)
@settings(max_examples=15, deadline=None)
@pytest.mark.slow
def test_a_route_is_hardly_longer_than_the_shortest_way_in_sight(seed: int) -> None:
    """Where nearness costs nothing within 8 %, and else no more than nearness may add."""
    chart, start_N, goal_N = drawn(seed)
    nearest = Router(RouteSettings(nearness=0.0), chart).route(start_N, goal_N)
    route = Router(RULES, chart).route(start_N, goal_N)
    assume(not route.reason and not nearest.reason)
    least_m = shortest_m(chart, start_N, goal_N)
    assume(math.isfinite(least_m))
    assert least_m * 0.99 <= nearest.length_m <= 1.08 * least_m + 0.5
    assert route.length_m <= (1.0 + RULES.nearness) * 1.08 * least_m + 0.5


@given(SEEDS)
@settings(max_examples=40, deadline=None)
def test_there_and_back_cost_the_same_but_for_a_few_per_cent(seed: int) -> None:
    chart, start_N, goal_N = drawn(seed)
    there = Router(RULES, chart).route(start_N, goal_N)
    back = Router(RULES, chart).route(goal_N, start_N)
    assert there.reason.replace("vessel", "goal") == back.reason.replace("vessel", "goal")
    if not there.reason:
        assert there.cost_m == pytest.approx(back.cost_m, rel=0.06, abs=0.5)


@given(SEEDS, st.floats(-1.5, 1.5), st.floats(-1.5, 1.5))
@settings(max_examples=30, deadline=None)
def test_the_same_question_has_the_same_answer_whatever_was_asked_before(
    seed: int, north: float, east: float
) -> None:
    chart, start_N, goal_N = drawn(seed)
    used = Router(RULES, chart)
    used.route(goal_N, start_N)
    used.route(start_N, goal_N, np.array([east, north]))
    drift_N = np.array([north, east])
    first = Router(RULES, chart).route(start_N, goal_N, drift_N)
    second = used.route(start_N, goal_N, drift_N)
    np.testing.assert_array_equal(first.places_N, second.places_N)
    assert (first.cost_m, first.reason) == (second.cost_m, second.reason)


@given(st.floats(1.6, 4.0), st.floats(0.0, math.pi), st.floats(-0.5, 0.5))
@example(1.6, 0.0, 0.0)
@example(1.6, math.pi / 4, 0.17)
@settings(max_examples=60, deadline=None)
def test_a_gap_of_1_6_beams_is_passed_at_any_angle(
    beams: float, angle: float, shift: float
) -> None:
    """Two long piers with a gap: the way through is 30 m, the one around them 200 m."""
    gap_m, turn = beams * 2.44, np.array([math.cos(angle), math.sin(angle)])
    across = np.array([-turn[1], turn[0]])
    piers = []
    for side in (-1.0, 1.0):
        ends = [side * (gap_m / 2), side * 100.0]
        corners = [
            e * turn + o * across for e, o in zip(np.repeat(ends, 2), (-2, 2, 2, -2), strict=True)
        ]
        piers.append(Area(kind="land", outline=np.array(corners) + shift))
    route = Router(RULES, StaticMap.of(piers)).route(-15.0 * across, 15.0 * across)
    assert not route.reason
    assert route.length_m < 33.0


def test_the_middle_of_a_channel_is_preferred_and_its_lee_side_shunned() -> None:
    banks = [
        Area(kind="land", outline=np.array([[-60, e], [60, e], [60, e + w], [-60, e + w]]))
        for e, w in ((6.0, 4.0), (-10.0, 4.0))
    ]
    chart = StaticMap.of(banks)
    start_N, goal_N = np.array([-70.0, 4.0]), np.array([70.0, 4.0])
    calm = Router(RULES, chart).route(start_N, goal_N)
    pushed = Router(RULES, chart).route(start_N, goal_N, np.array([0.0, 1.0]))
    assert abs(np.interp(0.0, *calm.places_N.T)) < 2.0
    assert np.interp(0.0, *pushed.places_N.T) < np.interp(0.0, *calm.places_N.T) - 0.3


def test_a_boat_that_lies_too_near_or_where_it_is_forbidden_leaves_by_the_shortest_way() -> None:
    quay = Area(kind="land", outline=np.array([[0, 0], [40, 0], [40, 10], [0, 10]]))
    router = Router(RULES, StaticMap.of([quay]))
    goal_N = np.array([20.0, 40.0])
    alongside = router.route(np.array([20.0, -0.8]), goal_N)
    assert alongside.places_N[1][1] < -LEAST_M + 1e-6
    within = router.route(np.array([20.0, 9.0]), goal_N)
    assert 10.0 < within.places_N[1][1] < 15.0
    far = router.route(np.array([20.0, 5.0]), goal_N)
    assert not far.reason


@pytest.mark.parametrize(
    ("start_N", "goal_N", "says"),
    [
        ((20.0, 20.0), (70.0, 20.0), "the vessel is shut in|no way leads"),
        ((70.0, 20.0), (20.0, 20.0), "the goal is shut in|no way leads"),
        ((70.0, 20.0), (-3.0, 20.0), "the goal is on land"),
    ],
)
def test_where_nothing_leads_there_the_reason_is_said(
    start_N: tuple[float, float], goal_N: tuple[float, float], says: str
) -> None:
    outer, inner = np.array([[-6, -6], [46, -6], [46, 46], [-6, 46]]), np.array([0, 0])
    hole = np.array([[0, 0], [40, 0], [40, 40], [0, 40]]) + inner
    walls = Area(kind="land", outline=outer, holes=(hole,), name="Mole")
    route = Router(RULES, StaticMap.of([walls])).route(np.array(start_N), np.array(goal_N))
    assert len(route.places_N) == 0
    assert any(words in route.reason for words in says.split("|")), route.reason


def test_walls_with_water_on_both_sides_are_gone_around() -> None:
    wall = np.array([[[-10.0, 0.0], [10.0, 0.0]]])
    route = Router(RULES, walls=wall).route(np.array([0.0, -10.0]), np.array([0.0, 10.0]))
    assert route.length_m > 25.0
    assert LineString(route.places_N).distance(LineString(wall[0])) >= LEAST_M - 1e-4


def test_a_large_chart_is_searched_in_parts_and_still_gone_around_as_a_whole() -> None:
    """An island of 6 km between the two: only the whole map shows the way around it."""
    island = Area(kind="land", outline=np.array([[0, 0], [6000, 0], [6000, 100], [0, 100.0]]))
    far = Disc(kind="hazard", centre=(30_000.0, 0.0), radius_m=5.0)
    router = Router(RULES, StaticMap.of([island, far]))
    near = router.route(np.array([100.0, -50.0]), np.array([100.0, 150.0]))
    assert near.length_m < 500.0
    around = router.route(np.array([3000.0, -50.0]), np.array([3000.0, 150.0]))
    assert 6000.0 < around.length_m < 6400.0


def test_no_place_is_lost_between_cells() -> None:
    """Clearances by the planner are those by shapely, anywhere."""
    rng = np.random.default_rng(3)
    chart = waters(rng)
    router = Router(RULES, chart)
    places = rng.uniform(0.0, SIDE_M, (500, 2))
    router.route(places[0], places[1])
    mine = [router.clearance(p, p) for p in places]
    np.testing.assert_allclose(mine, chart.distance_m(places), atol=1e-6)
    assert len(points(places)) == 500
