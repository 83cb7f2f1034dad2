"""Water with edges in the simulator: land, fences, shallows, piles and currents."""

import math
from pathlib import Path

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from twinscrew.hil_sim.contacts import Shore
from twinscrew.hil_sim.scenario import Scenario, load_scenario
from twinscrew.hil_sim.supervisor import Outcome, Supervisor
from twinscrew.hil_sim.world import World, make_world
from twinscrew.runtime.charts.static_map import Area, StaticMap
from twinscrew.runtime.errors import ConfigError
from twinscrew.runtime.vessel_description import load_vessel
from twinscrew.training.harbours import HarbourSettings, draw_harbour

AHEAD = "[[vessel]]\nstart_m = [0, 0]\nheading_deg = 0\ngoal_m = [60, 0]\n"
WAM_V = load_vessel("wam_v")


def scenario_of(folder: Path, rest: str, head: str = "", vessel: str = AHEAD) -> Scenario:
    file = folder / "scenario.toml"
    file.write_text(f'sea = "calm"\n{head}{vessel}{rest}')
    return load_scenario(file)


def sail(scenario: Scenario, thrust_n: float, most_s: float = 60.0) -> Supervisor:
    supervisor = Supervisor(make_world(scenario, seed=1))
    commands = np.full((scenario.vessels, 2), thrust_n)
    while not supervisor.over and supervisor.elapsed_s < most_s:
        supervisor.advance(0.1, commands)
    return supervisor


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 2**32), st.floats(-math.pi, math.pi))
def test_a_hull_is_as_far_from_a_shore_as_geometry_says(seed: int, heading: float) -> None:
    rng = np.random.default_rng(seed)
    harbour = draw_harbour(rng, HarbourSettings(kinds=("basin", "fingers", "dead_end")))
    region = StaticMap.of([Area(kind="land", outline=ring) for ring in harbour.land])
    shore = Shore(region, [WAM_V] * 3)
    land = shapely.union_all([shapely.Polygon(ring) for ring in harbour.land])
    places = harbour.ways[0][0] + rng.uniform(-12.0, 12.0, (3, 2))
    headings = heading + rng.uniform(-1.0, 1.0, 3)
    found = shore.gaps(places, headings)
    for place, turned, gap in zip(places, headings, found, strict=True):
        half = np.array([(1, 1), (1, -1), (-1, -1), (-1, 1)]) * (2.5, 1.25)
        c, s = np.cos(turned), np.sin(turned)
        hull = shapely.Polygon(place + half @ np.array([[c, s], [-s, c]]))
        true = shapely.distance(hull, land)
        if true > 0.0:
            if true < 18.0:
                assert gap == pytest.approx(true, abs=5e-3)
        elif shapely.intersects(hull, land.boundary):
            assert gap <= 0.0


def test_a_shore_is_found_again_after_a_long_way() -> None:
    far = np.array([(1000.0, -10.0), (1004.0, -10.0), (1004.0, 10.0), (1000.0, 10.0)])
    shore = Shore(StaticMap.of([Area(kind="land", outline=far)]), [WAM_V])
    north = np.array([0.0, 500.0, 990.0, 997.4, 998.0])
    gaps = [shore.gaps(np.array([(n, 0.0)]), np.zeros(1))[0] for n in north]
    assert gaps[:2] == [np.inf, np.inf]
    assert gaps[2:4] == pytest.approx([7.5, 0.1], abs=1e-3)
    assert gaps[4] <= 0.0


WALL = "outline_m = [[20, -9], [22, -9], [22, 9], [20, 9]]\n"


@pytest.mark.parametrize(
    ("rest", "outcome", "touched"),
    [
        ("[[land]]\n" + WALL, Outcome.COLLISION, "quay"),
        ("[[keep_out]]\n" + WALL, Outcome.FENCE, "fence"),
        ("[[fence]]\n" + WALL, Outcome.FENCE, "fence"),
        ("[[fence]]\ncentre_m = [0, 0]\nradius_m = 30\nkeep_in = true\n", Outcome.FENCE, "fence"),
        ("[[depth]]\ndepth_m = 0.1\n" + WALL, Outcome.COLLISION, "quay"),
        ("[[depth]]\ndepth_m = 0.5\n" + WALL, Outcome.GOAL, None),
        ("[[hazard]]\ncentre_m = [20, 1]\nradius_m = 0.5\n", Outcome.COLLISION, "quay"),
        ("[[hazard]]\ncentre_m = [20, 5]\nradius_m = 0.5\n", Outcome.GOAL, None),
        ("[[pile]]\ncentre_m = [20, 1]\n", Outcome.COLLISION, "buoy"),
    ],
)
def test_what_was_touched_is_told_apart(
    tmp_path: Path, rest: str, outcome: Outcome, touched: str | None
) -> None:
    goal = AHEAD.replace("60, 0", "26, 0") if "keep_in" in rest else AHEAD
    supervisor = sail(scenario_of(tmp_path, rest, vessel=goal.replace("26, 0", "28, 0")), 800.0)
    if "radius_m = 30" in rest:  # the goal lies within the fence, and is reached
        assert supervisor.outcomes == [Outcome.GOAL]
        return
    assert supervisor.outcomes == [outcome]
    (result,) = supervisor.results()
    assert result.touched == touched


def test_a_hull_passes_a_gap_of_1_6_beams(tmp_path: Path) -> None:
    rest = "".join(
        f"[[land]]\noutline_m = [[20, {a}], [22, {a}], [22, {b}], [20, {b}]]\n"
        for a, b in ((-12.0, -2.0), (2.0, 12.0))
    )
    assert sail(scenario_of(tmp_path, rest), 800.0).outcomes == [Outcome.GOAL]


def test_the_lidar_sees_walls_and_tops_of_land_and_piles(tmp_path: Path) -> None:
    low = "[[land]]\nheight_m = 0.8\noutline_m = [[8, -6], [18, -6], [18, 6], [14, 0], [8, 6]]\n"
    post = "[[pile]]\ncentre_m = [-10, 3]\nradius_m = 0.4\nheight_m = 3\n"
    world = make_world(scenario_of(tmp_path, low + post), seed=1)
    scan = world.scan(0)
    points = scan.cloud.points_S[scan.object_ids == 1]
    mount = world.vessels[0]
    sensor = world._lidars[mount.key]._sensor  # where the sensor is on the hull
    points = points @ sensor.R_BS.T + sensor.mount_position_B + world.state.position_N[0]
    wall = points[np.abs(points[:, 0] - 8.0) < 0.05]
    top = points[(np.abs(points[:, 2] + 0.8) < 0.05) & (points[:, 0] > 0.0)]
    post_seen = points[np.hypot(points[:, 0] + 10.0, points[:, 1] - 3.0) < 0.5]
    assert min(len(wall), len(top), len(post_seen)) >= 5
    inland = shapely.Polygon([(8, -6), (18, -6), (18, 6), (14, 0), (8, 6)]).buffer(0.1)
    assert shapely.contains_xy(inland, top[:, 0], top[:, 1]).all()
    ashore = shapely.contains_xy(inland, points[:, 0], points[:, 1])
    assert (ashore | (np.hypot(points[:, 0] + 10.0, points[:, 1] - 3.0) < 0.6)).all()


def test_fences_hazards_and_shallows_are_seen_by_no_lidar_and_are_in_the_chart(
    tmp_path: Path,
) -> None:
    rest = (
        f"[[keep_out]]\n{WALL}[[hazard]]\ncentre_m = [5, 8]\nradius_m = 1\n"
        "[[depth]]\ndepth_m = -0.5\noutline_m = [[0, 20], [9, 20], [9, 30]]\n"
    )
    scenario = scenario_of(tmp_path, rest)
    world = make_world(scenario, seed=1)
    assert len(world.bodies().shape) == 1
    inside = np.array([(21.0, 0.0), (5.0, 8.0), (7.0, 22.0), (40.0, 0.0)])
    assert scenario.chart.forbidden(inside).tolist() == [True, True, True, False]


@pytest.mark.parametrize(
    ("rest", "words"),
    [
        (
            "[[land]]\noutline_m = [[-3, -3], [3, -3], [3, 3], [-3, 3]]\n",
            "start of wamv1 lies on land",
        ),
        (
            "[[keep_out]]\noutline_m = [[58, -3], [63, -3], [63, 3], [58, 3]]\n",
            "goal of wamv1 lies in a keep",
        ),
        ("[[fence]]\nkeep_in = true\ncentre_m = [0, 0]\nradius_m = 9\n", "outside the fence"),
        ("[[land]]\noutline_m = [[9, 9], [12, 12], [12, 9], [9, 12]]\n", "crosses itself"),
        ("[[fence]]\nradius_m = 9\n", "either outline_m, or centre_m and radius_m"),
        ("[current]\nshear = 2.0\n", "shear"),
    ],
)
def test_what_cannot_be_is_refused_by_name(tmp_path: Path, rest: str, words: str) -> None:
    with pytest.raises(ConfigError, match=words):
        scenario_of(tmp_path, rest)


def test_a_harbour_takes_no_land_of_its_own_and_a_share_needs_a_harbour(tmp_path: Path) -> None:
    file = tmp_path / "mine.toml"
    file.write_text(f"[harbour]\n[[land]]\n{WALL}")
    with pytest.raises(ConfigError, match=r"remove .*land"):
        load_scenario(file)
    file.write_text("current_share = 0.3\n" + AHEAD)
    with pytest.raises(ConfigError, match=r"only with .harbour"):
        load_scenario(file)
    for name in ("harbour:pond", "current:fast"):
        with pytest.raises(ConfigError):
            load_scenario(name)


def adrift(scenario: Scenario, seconds: float) -> World:
    world = make_world(scenario, seed=1)
    world.advance(seconds, np.zeros((scenario.vessels, 2)))
    return world


def test_every_hull_drifts_with_the_water_at_its_own_place(tmp_path: Path) -> None:
    two = AHEAD + AHEAD.replace("[0, 0]", "[0, 40]").replace("60, 0", "60, 40")
    table = "[current]\nmean_mps = [0.6, 0.0]\nshear = 0.5\nshear_width_m = 5\ncentre_m = [0, 20]\n"
    world = adrift(scenario_of(tmp_path, table, vessel=two), 60.0)
    speed = world.state.velocity_B[:, 0]  # both still head north
    assert speed == pytest.approx([0.3, 0.9], abs=0.03)
    assert world.greatest_current == pytest.approx([0.3, 0.9], abs=0.03)


def test_a_tide_turns(tmp_path: Path) -> None:
    table = "[current]\nmean_mps = [0.5, 0.0]\ntide_period_s = 240\n"
    scenario = scenario_of(tmp_path, table)
    assert adrift(scenario, 40.0).state.velocity_B[0, 0] > 0.1
    assert adrift(scenario, 130.0).state.velocity_B[0, 0] < -0.3


def test_harbours_of_the_simulator_are_those_of_training() -> None:
    scenario = load_scenario("harbour:basin", seed=7)
    wanted = HarbourSettings(kinds=("basin",), length_m=WAM_V.length_m, beam_m=WAM_V.beam_m)
    drawn = draw_harbour(np.random.default_rng(7), wanted)
    assert np.array_equal(scenario.starts, drawn.starts)
    assert np.array_equal(scenario.goals, drawn.goals)
    for land, ring in zip(scenario.land, drawn.land, strict=True):
        assert np.array_equal(land.outline, ring)
    assert scenario.kind == "basin"


def test_a_current_is_drawn_as_a_share_of_the_vessels_top_speed() -> None:
    for seed in range(3):
        field = load_scenario("current:0.5", seed=seed, types=["otter"]).current
        places = np.random.default_rng(0).uniform(-50.0, 100.0, (2000, 2))
        fastest = np.hypot(*field.velocity(places, 0.0).T).max()
        assert fastest <= 0.5 * load_vessel("otter").top_speed_mps + 1e-9
