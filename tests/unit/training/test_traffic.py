"""An experiment's episodes in the training environment."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.harness.work import examples

from twinscrew.runtime.cli.main import main
from twinscrew.runtime.errors import ConfigError
from twinscrew.runtime.policy.hull_units import HullUnits
from twinscrew.training.environment import EnvironmentSettings, steer_at_goal
from twinscrew.training.evaluate import open_policy
from twinscrew.training.perception import PAPER, NoiseSettings
from twinscrew.training.traffic import (
    FILE,
    SETS,
    GivenEnv,
    TrafficEnv,
    draw_traffic,
    evaluate_given,
    evaluate_traffic,
    in_hull_units,
    read_given,
    read_traffic,
    rectangles_gap,
)

EPISODES = {
    "sets": [
        {
            "name": "one buoy",
            "episodes": [
                {
                    "starts": [[5.0, 6.0, 0.5], [40.0, 41.0, -2.0]],
                    "goals": [[15.0, 16.0], [30.0, 29.0]],
                    "buoys": [[22.0, 45.0, 0.75]],
                },
                {
                    "starts": [[6.0, 6.0, 0.0], [45.0, 45.0, 3.0]],
                    "goals": [[16.0, 6.0], [35.0, 45.0]],
                    "buoys": [[30.0, 10.0, 0.75]],
                },
            ],
        },
        {
            "name": "none",
            "episodes": [{"starts": [[5.0, 5.0, 0.0]], "goals": [[12.0, 5.0]], "buoys": []}],
        },
    ]
}


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / FILE).write_text(json.dumps(EPISODES))
    return tmp_path


def test_vessels_begin_where_they_are_told_and_see_their_goals_there(folder: Path) -> None:
    found = read_given(folder)["one buoy"]
    seen = GivenEnv(found, EnvironmentSettings(), seed=1).reset()
    c, s = np.cos(0.5), np.sin(0.5)
    assert seen.ego[0, 0, :2] == pytest.approx([10 * c + 10 * s, 10 * c - 10 * s], abs=0.3)
    assert (seen.ego[..., 2:] == 0.0).all()


def test_buoys_stand_where_they_are_told(folder: Path) -> None:
    found = read_given(folder)["one buoy"]
    near = found._replace(buoy=found.start[:, :1] + 10.0)
    seen = GivenEnv(near, EnvironmentSettings(), seed=1).reset()
    assert seen.mask[:, 0].sum(axis=1).tolist() == [1.0, 1.0]
    assert np.hypot(*seen.objects[:, 0, 0, :2].T) == pytest.approx([10.0, 10.0], abs=0.5)


def test_a_policy_is_scored_on_every_episode_of_every_set(folder: Path) -> None:
    sets = read_given(folder)
    assert list(sets) == ["one buoy", "none"]
    for episodes in sets.values():
        result = evaluate_given(open_policy("apf"), episodes)
        assert result.episodes == len(episodes.start)
        assert result.success_rate == 1.0
        assert result.travel_time_s is not None
        assert result.travel_time_s < 30.0


@pytest.mark.parametrize(
    "text",
    [
        "",
        "{}",
        '{"sets": [{"name": "x", "episodes": [{}]}]}',
        pytest.param("[" * 100_000, id="deep"),
    ],
)
def test_a_file_that_is_none_is_refused(tmp_path: Path, text: str) -> None:
    (tmp_path / FILE).write_text(text)
    with pytest.raises(ConfigError, match="no episodes of an experiment"):
        read_given(tmp_path)


def test_a_folder_without_the_file_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="No such file"):
        read_given(tmp_path)


# -- one vessel among scripted others


def episode(others=(), goal=(40.0, 0.0), heading=0.0, start=(0.0, 0.0)):
    own = {"start_m": list(start), "heading_deg": heading, "goal_m": list(goal)}
    return {"own": own, "others": list(others)}


def other(start=(20.0, 30.0), course=180.0, speed=0.0, length=5.0, beam=2.5):
    return {
        "start_m": list(start),
        "course_deg": course,
        "speed_mps": speed,
        "length_m": length,
        "beam_m": beam,
    }


def written(tmp_path: Path, *episodes, **more) -> Path:
    file = tmp_path / "traffic.json"
    file.write_text(json.dumps({"episodes": list(episodes), **more}))
    return file


class Straight:
    """Steers at the goal, whatever is in the way."""

    name, period_s, layout, range_m = "straight", 0.5, PAPER, 20.0

    def begin(self, episodes: int, vessels: int) -> None:
        pass

    def rates(self, seen, active):
        return 1000.0 * steer_at_goal(seen.ego) * active[..., None]


def sailed(tmp_path: Path, *episodes, **more):
    return evaluate_traffic(Straight(), read_traffic(written(tmp_path, *episodes, **more)))


def test_each_episode_ends_by_arrival_contact_or_time(tmp_path: Path) -> None:
    answer = sailed(
        tmp_path,
        episode(),
        episode([other((20.0, 0.0))]),
        episode(goal=(400.0, 0.0)),
        episode([other((20.0, 30.0))]),
        time_limit_s=30.0,
    )
    assert [one["outcome"] for one in answer["episodes"]] == [
        *("arrived", "contact", "timeout", "arrived")
    ]
    assert (answer["success_rate"], answer["contacts"], answer["timeouts"]) == (0.5, 1, 1)
    times = [one["time_s"] for one in answer["episodes"]]
    assert times[2] == 30.0
    assert answer["travel_time_s"] == pytest.approx((times[0] + times[3]) / 2)
    gaps = [one["closest_approach_m"] for one in answer["episodes"]]
    assert gaps[0] is gaps[2] is None
    assert gaps[1] == 0.0
    assert gaps[3] == pytest.approx(30.0 - 1.25 - 1.25, abs=0.5)  # abeam, both north-south


def test_outlines_are_rectangles_and_not_circles(tmp_path: Path) -> None:
    """A 30 m ship that lies along the course 5 m away is not touched; one across it is."""
    along, across = (
        other((20.0, 5.0), 0.0, 0.0, 30.0, 3.0),
        other((20.0, 5.0), 90.0, 0.0, 30.0, 3.0),
    )
    answer = sailed(tmp_path, episode([along]), episode([across]))
    assert [one["outcome"] for one in answer["episodes"]] == ["arrived", "contact"]
    assert answer["episodes"][0]["closest_approach_m"] == pytest.approx(5.0 - 1.25 - 1.5, abs=0.3)


def test_others_hold_course_and_speed_and_pass_through_each_other(tmp_path: Path) -> None:
    moving = other((10.0, 20.0), 270.0, 2.0), other((10.0, 0.0), 90.0, 2.0)
    traffic = read_traffic(
        written(tmp_path, episode(moving, start=(0.0, 300.0), goal=(0.0, 400.0)))
    )
    env = TrafficEnv(traffic, EnvironmentSettings(), 0)
    env.reset()
    for _ in range(10):
        result = env.step(np.zeros((1, 1, 2)))
        assert not result.collided.any()
    places = env.state.scripted[0]
    assert places == pytest.approx([complex(10.0, 10.0), complex(10.0, 10.0)])
    assert np.angle(env.state.scripted_velocity[0], deg=True) == pytest.approx([-90.0, 90.0])


def test_a_fast_vessel_cannot_pass_through_between_two_decisions(tmp_path: Path) -> None:
    """At 40 m/s it crosses the own hull within one decision of 0.5 s."""
    crossing = other((0.0, -10.0), 90.0, 40.0, 4.0, 2.0)
    answer = sailed(tmp_path, episode([crossing], heading=0.0))
    assert answer["episodes"][0] == {"outcome": "contact", "time_s": 0.5, "closest_approach_m": 0.0}


def test_a_rectangle_is_seen_as_the_circle_around_it_within_the_range(tmp_path: Path) -> None:
    big, far = other((25.0, 0.0), 90.0, 1.0, 20.0, 6.0), other((60.0, 0.0))
    traffic = read_traffic(written(tmp_path, episode([big, far])))
    perfect = EnvironmentSettings(noise=NoiseSettings(perfect=True))
    seen = TrafficEnv(traffic, perfect, 0).reset()
    assert seen.mask[0, 0].tolist() == [1.0, 0.0, 0.0, 0.0, 0.0]
    radius = np.hypot(10.0, 3.0)
    assert seen.objects[0, 0, 0] == pytest.approx([25.0, 0.0, 0.0, 1.0, radius], abs=1e-5)


@settings(max_examples=examples(60), deadline=None)
@given(
    x=st.floats(-12, 12),
    y=st.floats(-12, 12),
    turn=st.floats(-4, 4),
    own=st.floats(-4, 4),
    halves=st.tuples(*[st.floats(0.2, 6)] * 4),
)
def test_the_gap_of_rectangles_is_that_of_their_points(x, y, turn, own, halves) -> None:
    half, other_half = np.array(halves[:2]), np.array(halves[2:])
    gap = rectangles_gap(np.array(complex(x, y)), np.array(own), half, np.array(turn), other_half)
    back = rectangles_gap(np.array(-complex(x, y)), np.array(turn), other_half, np.array(own), half)
    assert gap == pytest.approx(back, abs=1e-9)
    edge = np.linspace(-1, 1, 21)
    grid = (edge[:, None] + 1j * edge[None, :]).ravel()
    one = (grid.real * half[0] + 1j * grid.imag * half[1]) * np.exp(1j * own)
    two = (grid.real * other_half[0] + 1j * grid.imag * other_half[1]) * np.exp(1j * turn)
    two += complex(x, y)
    nearest = np.abs(one[:, None] - two[None, :]).min()
    coarse = 0.1 * (np.abs(half).sum() + np.abs(other_half).sum())
    assert gap - 1e-9 <= nearest <= gap + coarse


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "not JSON"),
        ("[1]", r"Expected `object`, got `array`"),
        ("[" * 100_000, "not JSON"),
        ("{}", "episodes"),
        ('{"episodes": []}', "episodes"),
        (json.dumps({"episodes": [{}]}), "own"),
        (json.dumps({"episodes": [episode()], "limit": 3}), "limit: unknown key"),
        (json.dumps({"episodes": [episode()], "time_limit_s": 0}), "time_limit_s"),
        (json.dumps({"episodes": [episode([other(length=0.0)])]}), r"length_m.*got 0"),
        (json.dumps({"episodes": [episode([other(speed=-1.0)])]}), r"speed_mps.*got -1"),
        (json.dumps({"episodes": [episode([other((1.0, 2.0, 3.0))])]}), "start_m"),
        (json.dumps({"episodes": [episode(goal=(float("nan"), 0.0))]}), "finite"),
        (json.dumps({"episodes": [episode(goal=("north", 0.0))]}), "goal_m"),
    ],
)
def test_a_malformed_traffic_file_is_refused_in_one_line(
    tmp_path: Path,
    text: str,
    words: str,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    file = tmp_path / "traffic.json"
    file.write_text(text)
    monkeypatch.setattr("sys.argv", ["twinscrew", "evaluate", "apf", "--traffic", str(file)])
    with pytest.raises(SystemExit) as ended:
        main()
    captured = capsys.readouterr()
    assert ended.value.code == 2
    assert captured.out == ""
    assert len(captured.err.splitlines()) == 1
    assert re.search(rf"traffic\.json.*{words}", captured.err)


def test_the_command_answers_with_one_json_object(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    file = str(written(tmp_path, episode([other((20.0, 12.0), 270.0, 0.5, 8.0, 3.0)]), episode()))
    answers = []
    for _ in range(2):
        argv = ["twinscrew", "evaluate", "ac_iqn", "--traffic", file, "--json"]
        monkeypatch.setattr("sys.argv", argv)
        with pytest.raises(SystemExit) as ended:
            main()
        assert not ended.value.code
        answers.append(json.loads(capsys.readouterr().out))
    assert answers[0] == answers[1]
    assert list(answers[0]) == [
        *("success_rate", "contacts", "timeouts", "travel_time_s", "episodes")
    ]
    assert set(answers[0]["episodes"][0]) == {"outcome", "time_s", "closest_approach_m"}
    assert answers[0]["success_rate"] == 1.0


@pytest.mark.parametrize("name", [*SETS, "imazu"])
def test_a_drawn_set_is_the_same_for_a_seed_and_begins_clear(name):
    """And nobody is in contact before anybody has moved."""
    first, again = draw_traffic(name, 44, 3), draw_traffic(name, 44, 3)
    assert first == again
    assert first != draw_traffic(name, 44, 4)
    assert len(first.episodes) == 44
    for one in first.episodes:
        start = np.array(one.own.start_m)
        for other in one.others:
            gap = np.hypot(*(np.array(other.start_m) - start))
            assert gap > np.hypot(other.length_m, other.beam_m) / 2


def test_unaltered_imazu_s_others_meet_at_one_point():
    """All come within a few metres of the middle of the own way, at one time."""
    for one in draw_traffic("imazu", 22, 0).episodes:
        middle = (np.array(one.own.start_m) + np.array(one.own.goal_m)) / 2
        for other in one.others:
            course = np.radians(other.course_deg)
            velocity = other.speed_mps * np.array([np.cos(course), np.sin(course)])
            then = np.array(other.start_m) + velocity * 40.0 / 2.5
            assert np.hypot(*(then - middle)) < 10.0


def test_an_unknown_set_is_named():
    with pytest.raises(ConfigError, match="sets are slow, fast, large, anchored, imazu"):
        draw_traffic("calm", 1, 0)


def test_in_a_hull_s_units_the_same_episodes_give_the_same_answer():
    """The file in SI, sailed in the units of a hull that is alike but for its scale."""
    traffic = draw_traffic("slow", 20, 5)
    units = HullUnits(0.4, 0.5, 0.1)
    small = in_hull_units(traffic, units)
    whole = evaluate_traffic(Straight(), traffic, 1)
    scaled_back = in_hull_units(small, HullUnits(2.5, 2.0, 10.0))
    assert evaluate_traffic(Straight(), scaled_back, 1)["contacts"] == whole["contacts"]
    other, same = traffic.episodes[0].others[0], small.episodes[0].others[0]
    assert same.length_m == pytest.approx(other.length_m / 0.4)
    assert same.speed_mps == pytest.approx(other.speed_mps / 0.8)
