import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from matplotlib.image import imread

from twinscrew.hil_sim.figures import (
    HULL_LENGTH_M,
    HULL_WIDTH_M,
    SNAPSHOT_S,
    draw_trajectories,
    outline,
    shown,
)
from twinscrew.hil_sim.scenario import Scenario, load_scenario
from twinscrew.hil_sim.trajectory import TrajectoryLog


def area(polygon: np.ndarray) -> float:
    x, y = polygon.T
    return 0.5 * abs(float(np.dot(x[:-1], y[1:]) - np.dot(x[1:], y[:-1])))


@pytest.mark.parametrize(
    ("heading", "bow"),
    [(0.0, (20.0, 12.5)), (math.pi / 2, (22.5, 10.0)), (math.pi, (20.0, 7.5))],
)
def test_the_bow_points_where_the_vessel_heads_on_a_map_with_north_up(
    heading: float, bow: tuple[float, float]
) -> None:
    polygon = outline(10.0, 20.0, heading)
    np.testing.assert_allclose(polygon[0], bow, atol=1e-9)
    np.testing.assert_allclose(polygon[-1], polygon[0])


@pytest.mark.parametrize("heading", [0.0, 0.7, -2.0])
def test_an_outline_has_the_hulls_size_whatever_the_heading(heading: float) -> None:
    pointed = HULL_LENGTH_M * HULL_WIDTH_M * 0.9  # the bow's two corners, a tenth, are cut
    assert area(outline(3.0, -4.0, heading)) == pytest.approx(pointed)


def drawn(folder: Path, name: str, steps: int) -> np.ndarray:
    scenario = load_scenario(name)
    log = TrajectoryLog()
    pose = scenario.starts.copy()
    for k in range(steps):
        pose[:, :2] += 0.05 * (scenario.goals - scenario.starts[:, :2]) / 10
        log.add(0.1 * k, pose, np.ones((scenario.vessels, 2)), np.zeros((scenario.vessels, 2)))
    path = folder / f"{name}{steps}.png"
    draw_trajectories(
        path, scenario, log, ["goal"] * scenario.vessels, [0.1 * steps] * scenario.vessels
    )
    return imread(path)


@pytest.mark.parametrize("name", ["head_on", "passage", "random"])
def test_every_kind_of_scenario_can_be_drawn(tmp_path: Path, name: str) -> None:
    picture = drawn(tmp_path, name, 60)
    assert picture.shape[0] > 500
    assert len(np.unique(picture.reshape(-1, picture.shape[2]), axis=0)) > 20


def elsewhere(scenario: Scenario, shift_m: tuple[float, float]) -> Scenario:
    starts, goals = scenario.starts.copy(), scenario.goals + shift_m
    starts[:, :2] += shift_m
    return replace(scenario, starts=starts, goals=goals)


def framed(scenario: Scenario, *way_N: tuple[float, float]) -> tuple[list[float], list[float]]:
    rows = np.zeros((len(way_N), scenario.vessels, 7))
    rows[:, :, :2] = np.reshape(way_N, (-1, 1, 2))
    low, high = shown(scenario, rows)
    return low.tolist(), high.tolist()


def test_a_picture_shows_the_map_and_whatever_leaves_it() -> None:
    scenario = load_scenario("head_on")
    assert framed(scenario, (20.0, 20.0)) == ([-3.0, -3.0], [58.0, 58.0])
    assert framed(scenario, (20.0, 20.0), (-7.0, 70.0)) == ([-10.0, -3.0], [58.0, 73.0])


@pytest.mark.parametrize("shift_m", [(-200.0, -200.0), (1e5, -2e5)])
def test_a_picture_of_a_run_elsewhere_shows_the_run_and_not_the_map(
    shift_m: tuple[float, float],
) -> None:
    scenario = elsewhere(load_scenario("head_on"), shift_m)
    low, high = framed(scenario, tuple(scenario.starts[0, :2]))
    assert np.subtract(low, shift_m).tolist() == [1.0, 24.5]
    assert np.subtract(high, shift_m).tolist() == [54.0, 30.5]


def test_a_run_far_from_the_origin_is_drawn_where_it_was(tmp_path: Path) -> None:
    pictures = []
    for shift_m in ((0.0, 0.0), (1e5, -2e5)):
        scenario, log = elsewhere(load_scenario("head_on"), shift_m), TrajectoryLog()
        for k in range(100):
            pose = scenario.starts.copy()
            pose[:, :2] += 0.01 * k * (scenario.goals - scenario.starts[:, :2])
            log.add(0.1 * k, pose, np.zeros((2, 2)), np.zeros((2, 2)))
        path = tmp_path / "run.png"
        draw_trajectories(path, scenario, log, ["goal", "goal"], [10.0, 10.0])
        picture = imread(path)[..., :3]
        pictures.append(float(np.mean(np.ptp(picture, axis=2) > 0.1)))  # how much is coloured
    assert pictures[1] > 0.8 * pictures[0]


def test_a_run_that_ended_at_once_can_be_drawn_and_a_longer_one_shows_more(
    tmp_path: Path,
) -> None:
    brief, longer = drawn(tmp_path, "head_on", 1), drawn(tmp_path, "head_on", 120)
    white = [float(np.mean(picture[..., :3].min(axis=2) > 0.99)) for picture in (brief, longer)]
    assert white[1] < white[0]


@pytest.mark.parametrize("end_s", [SNAPSHOT_S, 4 * SNAPSHOT_S - 5e-10])
def test_a_run_that_ended_a_rounding_before_a_snapshot_can_be_drawn(
    tmp_path: Path, end_s: float
) -> None:
    scenario = load_scenario("crossing")
    log = TrajectoryLog(every_s=0.01)
    for time_s in np.linspace(0.0, end_s, 50):
        log.add(float(time_s), scenario.starts, np.zeros((2, 2)), np.zeros((2, 2)))
    path = tmp_path / "run.png"
    draw_trajectories(path, scenario, log, ["timeout", "timeout"], [end_s, end_s])
    assert len(np.unique(imread(path).reshape(-1, 4), axis=0)) > 20
