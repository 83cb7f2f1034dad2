"""The chart kept beside the recordings."""

from types import SimpleNamespace

import numpy as np
import pytest

from twinscrew.hil_sim.scenario import load_scenario
from twinscrew.hil_sim.sitl import SitlSettings, sail
from twinscrew.hil_sim.supervisor import Outcome, Result
from twinscrew.hil_sim.viewer.scene import (
    OUTCOMES_FILE,
    SCENE_FILE,
    SUMMARY_FILE,
    OutcomeLog,
    Scene,
    read_outcomes,
    read_result,
    read_scene,
    scene_of,
    write_scene,
)
from twinscrew.runtime.errors import RecordingError


@pytest.mark.parametrize(
    ("name", "kinds", "has_flow"),
    [
        ("harbour:mixed", {"land", "keep_out"}, False),
        ("fences", {"fence", "keep_out"}, False),
        ("current:0.5", set(), True),
    ],
)
def test_a_scene_tells_what_is_fixed_and_how_the_water_flows(name, kinds, has_flow, tmp_path):
    scenario = load_scenario(name, seed=4)
    write_scene(tmp_path, scenario)
    scene = read_scene(tmp_path)
    assert {region.kind for region in scene.regions} <= kinds
    assert bool(scene.regions) == bool(kinds)
    assert len(scene.piles) == len(scenario.piles)
    assert [region.keep_in for region in scene.regions].count(True) == (name == "fences")
    assert bool(scene.flow) == has_flow
    for north, east, v_north, v_east in scene.flow:
        there = scenario.current.velocity(np.array([(north, east)]))[0]
        assert there == pytest.approx((v_north, v_east))


@pytest.mark.parametrize("name", ["random", "passage", "crossing"])
def test_a_scene_comes_back_as_it_was_written(name, tmp_path):
    scenario = load_scenario(name, buoys=3 if name == "random" else None, seed=4)
    write_scene(tmp_path, scenario)
    scene = read_scene(tmp_path)
    assert scene == scene_of(scenario)
    assert scene.names == scenario.names
    assert scene.buoys == tuple(map(tuple, scenario.buoys.tolist()))
    assert scene.quays == tuple(map(tuple, scenario.quays.tolist()))


def test_a_folder_without_a_scene_has_an_empty_one(tmp_path):
    assert read_scene(tmp_path) == Scene()


@pytest.mark.parametrize(
    "content",
    [b'{"buoys": 3}', b'{"names": ["\xff"]}', pytest.param(b'{"x": ' + b"[" * 100_000, id="deep")],
)
def test_a_damaged_scene_is_refused_by_name(tmp_path, content):
    (tmp_path / SCENE_FILE).write_bytes(content)
    with pytest.raises(RecordingError, match=SCENE_FILE):
        read_scene(tmp_path)


def test_a_scene_tells_wind_and_current():
    scene = scene_of(load_scenario("crossing"))
    assert scene.wind == (10.0, 90.0), "the paper's sea"
    assert scene.current == (0.0, 0.0)


def test_a_scene_of_an_earlier_version_is_read(tmp_path):
    (tmp_path / SCENE_FILE).write_text('{"name": "old", "names": ["wamv1"]}')
    assert read_scene(tmp_path) == Scene(name="old", names=("wamv1",))


@pytest.mark.slow
def test_a_run_leaves_where_each_vessel_ended_and_where_it_was_held(tmp_path):
    scenario = load_scenario("random", vessels=1, buoys=0, seed=3)
    sail(scenario, SitlSettings(lockstep=True, policy="apf"), tmp_path)
    (rows,) = read_outcomes(tmp_path).values()
    first = rows[0]
    assert (first.name, first.outcome) == ("wamv1", "goal")
    off = np.hypot(*(np.array(first.pose[:2]) - scenario.goals[0]))
    assert off == pytest.approx(scenario.goal_radius, abs=0.2), "where it came to its goal"


class Held:
    """A world that holds one vessel, and lets time pass."""

    def __init__(self):
        self.stamp_ns = 0
        self.present = np.array([True, False])
        self.state = SimpleNamespace(position_N=np.zeros((2, 3)), heading=np.zeros(2))


def test_outcomes_are_followed_while_others_are_under_way_but_not_of_what_is_gone(tmp_path):
    world = Held()
    log = OutcomeLog(tmp_path, world)
    results = [
        Result(name=name, outcome=how, travel_time_s=3.0, closest_approach_m=float("inf"))
        for name, how in (("a", Outcome.GOAL), ("b", Outcome.COLLISION), ("c", None))
    ]
    for step in range(41):
        world.stamp_ns = step * 50_000_000
        world.state.position_N[:, 0] = step
        log.note(results)
    with (tmp_path / OUTCOMES_FILE).open("ab") as file:
        file.write(b'{"name": "a", "out')  # it is being written
    ended = read_outcomes(tmp_path)
    assert set(ended) == {"a", "b"}
    assert [row.stamp_ns / 1e9 for row in ended["a"]] == [0.0, 0.5, 1.0, 1.5, 2.0]
    assert [row.pose[0] for row in ended["a"]] == [0.0, 10.0, 20.0, 30.0, 40.0]
    assert len(ended["b"]) == 1
    assert ended["b"][0].closest_approach_m is None


@pytest.mark.parametrize("content", [None, b"", b'{"success": 3}', b"\xff"])
def test_a_run_without_a_result_has_none(tmp_path, content):
    if content is not None:
        (tmp_path / SUMMARY_FILE).write_bytes(content)
    assert read_result(tmp_path) is None
    assert read_outcomes(tmp_path) == {}
