import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from matplotlib.image import imread

from twinscrew.hil_sim.figures import (
    APART_M,
    HULL_LENGTH_M,
    HULL_WIDTH_M,
    SNAPSHOT_S,
    draw_trajectories,
    outline,
    shown,
    snapshots,
    trajectory_figure,
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


@pytest.mark.slow
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


@pytest.mark.slow
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


@pytest.mark.slow
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


def way(seconds: float, speed_mps: float, loiter_s: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """Sail north, lie still for a while with a drift of a hand's breadth, sail on."""
    times = np.arange(0.0, seconds, 0.1) + 0.04
    moved = np.minimum(times, 10.0) + np.maximum(times - 10.0 - loiter_s, 0.0)
    rows = np.zeros((len(times), 7))
    rows[:, 0] = speed_mps * moved + 0.1 * np.sin(times)
    return times, rows


def test_numbers_are_round_seconds_and_outlines_are_of_those_moments() -> None:
    times, rows = way(60.0, 3.0)
    shots = list(snapshots(times, rows))
    assert [second for _, second in shots] == [SNAPSHOT_S * k for k in range(15)]
    assert all(abs(times[row] - second) <= 0.06 for row, second in shots)


def test_where_a_boat_loiters_its_outline_is_drawn_once() -> None:
    times, rows = way(80.0, 3.0, loiter_s=40.0)
    seconds = [second for _, second in snapshots(times, rows)]
    assert not [second for second in seconds if 13.0 < second < 50.0]
    assert [second for second in seconds if second >= 52.0], "and again when it sails on"
    places = rows[[row for row, _ in snapshots(times, rows)], :2]
    gaps = np.hypot(*(places[:, None] - places).T)[np.triu_indices(len(places), 1)]
    assert gaps.min() >= APART_M


def crowded() -> tuple[Scenario, TrajectoryLog]:
    """Boats that circle in one corner of the map, beyond its edge too."""
    scenario = load_scenario("random", vessels=5, buoys=4, seed=3)
    log = TrajectoryLog()
    for k in range(600):
        angle = 0.004 * k * np.arange(1, 6) + np.arange(5)
        around = np.column_stack([6.0 * np.sin(angle) - 4.0, 6.0 * np.cos(angle) + 3.0, angle])
        log.add(0.1 * k, around, np.full((5, 2), -3.0), np.zeros((5, 2)))
    return scenario, log


def test_numbers_lie_apart_and_nothing_is_cut_at_the_axes() -> None:
    scenario, log = crowded()
    figure = trajectory_figure(scenario, log, ["timeout"] * 5, [60.0] * 5)
    figure.draw_without_rendering()
    (axes,) = figure.axes
    inside = axes.get_window_extent()
    words = [text for text in axes.texts if text.get_text().isdigit()]
    assert len(words) > 10
    boxes = [text.get_window_extent() for text in words]
    for i, box in enumerate(boxes):
        assert inside.x0 <= box.x0, "a number is cut"
        assert box.x1 <= inside.x1, "a number is cut"
        touched = [other for other in boxes[:i] if box.shrunk(0.8, 0.8).overlaps(other)]
        assert not touched, words[i].get_text()
    low, high = np.array([axes.get_xlim(), axes.get_ylim()]).T
    for line in axes.lines[:5]:
        path = line.get_xydata()
        assert ((path >= low) & (path <= high)).all()
    for arrow in axes.texts:
        if not arrow.get_text():
            assert ((np.array(arrow.xy) >= low) & (np.array(arrow.xy) <= high)).all()


@pytest.mark.slow
def test_a_figure_is_saved_for_the_screen_and_for_print_the_same_each_time(tmp_path: Path) -> None:
    scenario, log = crowded()
    drawings = []
    for name in ("one", "two"):
        (tmp_path / name).mkdir()
        draw_trajectories(tmp_path / name / "run.png", scenario, log, ["goal"] * 5, [60.0] * 5)
        drawings.append((tmp_path / name / "run.svg").read_bytes())
        assert (tmp_path / name / "run.png").is_file()
    assert b"<svg" in drawings[0]
    assert drawings[0] == drawings[1]


def test_the_legend_says_in_words_what_became_of_each() -> None:
    scenario, log = crowded()
    outcomes = ["goal", "collision", "timeout", "goal", "goal"]
    figure = trajectory_figure(scenario, log, outcomes, [17.7, 8.0, 90.0, 20.0, 21.0])
    said = [text.get_text() for text in figure.axes[0].get_legend().get_texts()]
    assert said[0].endswith("arrived after 17.7 s")
    assert said[1].endswith("collided after 8.0 s")
    assert said[2].endswith("out of time after 90.0 s")
