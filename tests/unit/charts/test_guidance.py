"""The place to steer for: the goal, or a place on the route with no land before it."""

import math

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from tests.property.test_route import drawn

from twinscrew.runtime.charts import route
from twinscrew.runtime.charts.route import NO_WALLS, Guidance, Router, RouteSettings
from twinscrew.runtime.charts.static_map import Area, StaticMap

RULES = RouteSettings()
OPEN = StaticMap.empty()
QUAY = StaticMap.of(
    [Area(kind="land", outline=np.array([[20, -40], [24, -40], [24, 40], [20, 40]]))]
)
HERE, THERE = np.array([0.0, 0.0]), np.array([50.0, 0.0])
S = 1_000_000_000


def box(low: float, high: float) -> list[tuple[float, float]]:
    return [(low, low), (high, low), (high, high), (low, high)]


def test_without_a_map_the_goal_itself_is_steered_for() -> None:
    aim = Guidance().step(0, HERE, THERE, OPEN)
    assert aim.place_N is THERE
    assert not aim.news
    assert not aim.trouble


def test_learnt_walls_that_do_not_stand_in_the_way_change_nothing() -> None:
    aside = np.array([[[0.0, 3.0], [50.0, 3.0]]])
    assert Guidance().step(0, HERE, THERE, OPEN, aside).place_N is THERE


def test_a_wall_in_the_way_is_gone_around_and_that_is_told_once() -> None:
    guidance, wall = Guidance(), np.array([[[25.0, -10.0], [25.0, 10.0]]])
    aim = guidance.step(0, HERE, THERE, OPEN, wall)
    assert "legs" in aim.news
    assert aim.place_N is not None
    assert abs(aim.place_N[1]) > 1.0
    assert not guidance.step(S, HERE, THERE, OPEN, wall).news
    assert len(guidance.ahead_N) >= 2
    # As soon as it is behind, or gone, the way is straight again.
    assert guidance.step(2 * S, np.array([30.0, 9.0]), THERE, OPEN, wall).place_N is THERE
    assert guidance.step(3 * S, HERE, THERE, OPEN, NO_WALLS).place_N is THERE
    assert len(guidance.ahead_N) == 0


def test_turned_off_it_steers_for_the_goal_whatever_is_in_the_way() -> None:
    guidance = Guidance(RouteSettings(enabled=False))
    assert guidance.step(0, HERE, THERE, QUAY).place_N is THERE


@given(st.integers(0, 2000), st.floats(5.0, 60.0))
@settings(max_examples=25, deadline=None)
def test_a_boat_that_follows_its_aim_arrives_and_no_aim_ever_lies_behind_land(
    seed: int, reach_m: float
) -> None:
    chart, place_N, goal_N = drawn(seed)
    guidance = Guidance(RULES, reach_m)
    for step in range(400):
        aim = guidance.step(step * S // 2, place_N, goal_N, chart)
        assume(aim.place_N is not None)
        assert not chart.blocks(place_N, aim.place_N)
        way = aim.place_N - place_N
        left_m = math.hypot(*way)
        assert left_m <= reach_m + 2.0 * RULES.clearance_m
        if aim.place_N is goal_N and left_m < 1.5:
            return
        place_N = place_N + way * min(1.0, 1.5 / max(left_m, 1e-9))
        assert not chart.forbidden(place_N[None]).any()
    pytest.fail("it never arrived")


def test_a_boat_that_is_pushed_off_its_route_gets_another() -> None:
    guidance = Guidance()
    guidance.step(0, HERE, THERE, QUAY)
    first = guidance.route
    guidance.step(S, np.array([0.0, 1.0]), THERE, QUAY)
    assert guidance.route is first
    far = guidance.step(4 * S, np.array([-10.0, 60.0]), THERE, QUAY)
    assert guidance.route is not first
    assert far.place_N is not None


def test_a_drift_that_changes_asks_for_another_route() -> None:
    guidance = Guidance()
    guidance.step(0, HERE, THERE, QUAY, drift_N=np.zeros(2))
    first = guidance.route
    guidance.step(4 * S, HERE, THERE, QUAY, drift_N=np.array([0.0, 0.1]))
    assert guidance.route is first
    guidance.step(8 * S, HERE, THERE, QUAY, drift_N=np.array([0.0, 0.5]))
    assert guidance.route is not first


def test_where_nothing_leads_there_it_says_so_once_for_each_goal_and_looks_again() -> None:
    shut = Area(kind="land", outline=np.array(box(-30, 30)), holes=(np.array(box(-20, 20)),))
    guidance, chart, goal_N = Guidance(), StaticMap.of([shut]), np.array([60.0, 0.0])
    aim = guidance.step(0, HERE, goal_N, chart)
    assert aim.place_N is None
    assert aim.trouble in ("no way leads to the goal", "the vessel is shut in")
    assert guidance.step(5 * S, HERE, goal_N, chart).trouble == ""
    assert guidance.step(6 * S, HERE, goal_N + 1.0, chart).trouble
    found = guidance.step(9 * S, HERE, goal_N + 1.0, QUAY)
    assert found.place_N is not None


def test_what_nothing_leads_to_is_looked_for_again_only_where_the_answer_may_differ() -> None:
    shut = Area(kind="land", outline=np.array(box(40, 70)), holes=(np.array(box(45, 65)),))
    guidance, chart, goal_N = Guidance(), StaticMap.of([shut]), np.array([55.0, 55.0])
    assert guidance.step(0, HERE, goal_N, chart).trouble
    first = guidance.route
    guidance.step(5 * S, HERE + 1.0, goal_N, chart, drift_N=np.array([0.5, 0.0]))
    assert guidance.route is first
    guidance.step(10 * S, HERE - 9.0, goal_N, chart)
    assert guidance.route is not first
    second, walls = guidance.route, np.array([[[0.0, 90.0], [1.0, 90.0]]])
    guidance.step(15 * S, HERE - 9.0, goal_N, chart, walls)
    assert guidance.route is not second


def test_a_search_of_all_of_a_map_does_not_close_the_gaps_of_a_part(monkeypatch) -> None:
    monkeypatch.setattr(route, "MOST_CELLS", 4000)
    shut = Area(kind="land", outline=np.array(box(40, 70)), holes=(np.array(box(45, 65)),))
    walls = [
        Area(kind="land", outline=np.array([[-20, low], [-18, low], [-18, high], [-20, high]]))
        for low, high in ((-200.0, -2.1), (2.1, 200.0))
    ]
    far = [Area(kind="land", outline=np.array(box(at, at + 10))) for at in (-3000, 3000)]
    router = Router(RULES, StaticMap.of([shut, *walls, *far]))
    beyond = np.array([-40.0, 30.0])
    before = router.route(HERE, beyond)
    assert not before.reason
    assert router.route(HERE, np.array([55.0, 55.0])).reason
    assert router.route(HERE, beyond).cost_m == before.cost_m


def test_a_boat_that_lies_where_it_may_not_be_steers_out_and_not_across() -> None:
    guidance = Guidance()
    inside = np.array([20.8, 0.0])
    aim = guidance.step(0, inside, THERE, QUAY)
    assert aim.place_N is not None
    assert 15.0 < aim.place_N[0] < 20.0 - RULES.least_clearance_m + 0.01


def test_the_same_steps_give_the_same_aims() -> None:
    def sailed() -> list[float]:
        guidance, place_N, found = Guidance(), HERE.copy(), []
        for step in range(100):
            aim = guidance.step(step * S // 2, place_N, THERE, QUAY, drift_N=np.array([0.1, 0.2]))
            assert aim.place_N is not None
            found += aim.place_N.tolist()
            place_N = place_N + 0.05 * (aim.place_N - place_N)
        return found

    assert sailed() == sailed()
