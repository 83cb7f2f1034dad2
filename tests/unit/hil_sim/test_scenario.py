from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from twinscrew.hil_sim.random_scenario import from_quays
from twinscrew.hil_sim.scenario import Scenario, load_scenario
from twinscrew.runtime.errors import ConfigError
from twinscrew.runtime.settings import CONFIG_DIR


def relative_bearing(scenario: Scenario, ego: int, other: int) -> float:
    """Of the other's start, from the ego's bow, in (-pi, pi]; starboard is positive."""
    north, east = scenario.starts[other, :2] - scenario.starts[ego, :2]
    bearing = math.atan2(east, north) - scenario.starts[ego, 2]
    return math.atan2(math.sin(bearing), math.cos(bearing))


def course_difference(scenario: Scenario) -> float:
    return abs(math.remainder(scenario.starts[1, 2] - scenario.starts[0, 2], 2 * math.pi))


@pytest.mark.parametrize(
    "path", sorted((CONFIG_DIR / "scenarios").glob("*.toml")), ids=lambda p: p.stem
)
def test_every_shipped_scenario_can_be_sailed(path: Path) -> None:
    scenario = load_scenario(path.stem)
    assert scenario.name == path.stem
    assert scenario.names == tuple(f"wamv{i + 1}" for i in range(scenario.vessels))
    offset = scenario.starts[:, None, :2] - scenario.starts[None, :, :2]
    apart = np.hypot(offset[..., 0], offset[..., 1]) + 1e3 * np.eye(scenario.vessels)
    assert apart.min() > 10.0
    for inside in (scenario.starts[:, :2], scenario.goals):
        assert ((inside >= 0) & (inside <= scenario.map_size)).all()
    assert 90.0 <= scenario.time_limit_s <= 180.0
    assert scenario.goal_radius == 2.0
    assert (CONFIG_DIR / "sea" / f"{scenario.sea}.toml").is_file()


def test_the_same_seed_gives_the_same_scenario_and_another_seed_another() -> None:
    first, again = load_scenario("random", seed=4), load_scenario("random", seed=4)
    np.testing.assert_array_equal(first.starts, again.starts)
    np.testing.assert_array_equal(first.goals, again.goals)
    assert not np.array_equal(first.starts, load_scenario("random", seed=5).starts)


def test_counts_can_be_asked_for() -> None:
    scenario = load_scenario("random", vessels=5, buoys=4)
    assert (scenario.vessels, len(scenario.buoys)) == (5, 4)


def test_head_on_vessels_meet_bow_to_bow() -> None:
    scenario = load_scenario("head_on")
    assert course_difference(scenario) == pytest.approx(math.pi)
    assert relative_bearing(scenario, 0, 1) == pytest.approx(0.0, abs=1e-9)


def test_in_crossing_the_first_has_the_other_to_starboard() -> None:
    scenario = load_scenario("crossing")
    assert course_difference(scenario) == pytest.approx(math.pi / 2)
    assert 0 < relative_bearing(scenario, 0, 1) < math.radians(112.5)


def test_in_overtaking_the_first_comes_up_astern_of_a_slower_one() -> None:
    scenario = load_scenario("overtaking")
    assert course_difference(scenario) == 0
    assert abs(relative_bearing(scenario, 1, 0)) > math.radians(112.5)
    assert scenario.thrust_limits[1] < scenario.thrust_limits[0] == math.inf


def test_in_passage_four_buoys_leave_room_for_one_vessel_at_a_time() -> None:
    scenario = load_scenario("passage", vessels=5, buoys=4)
    south_west, _, south_east, _ = scenario.buoys
    gap = south_east[1] - south_west[1] - south_west[2] - south_east[2]
    assert 2 * 2.8 < gap < 4 * 2.8


def write(path: Path, text: str) -> Path:
    path.write_text(text)
    return path


QUAY = "[[quay]]\ncentre_m = [20, 0]\nsize_m = [30, 4, 1.5]\nheading_deg = 180\n"
VESSEL = "[[vessel]]\nstart_m = [1, 2]\nheading_deg = 90\ngoal_m = [30, 40]\n"


def test_a_written_scenario_is_read_as_written(tmp_path: Path) -> None:
    buoy = "[[buoy]]\ncentre_m = [9, 8]\nradius_m = 1.0\n"
    path = write(tmp_path / "mine.toml", 'sea = "calm"\ntime_limit_s = 40\n' + VESSEL + buoy + QUAY)
    scenario = load_scenario(path)
    assert (scenario.name, scenario.sea, scenario.time_limit_s) == ("mine", "calm", 40.0)
    np.testing.assert_allclose(scenario.starts, [[1, 2, math.pi / 2]])
    np.testing.assert_array_equal(scenario.goals, [[30, 40]])
    np.testing.assert_array_equal(scenario.buoys, [[9, 8, 1]])
    np.testing.assert_allclose(scenario.quays, [[20, 0, 30, 4, 1.5, math.pi]])


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", r"either \[random\]"),
        ("[random]\n" + VESSEL, r"either \[random\]"),
        ("[random]\n[[buoy]]\ncentre_m = [1, 1]\n", r"remove \[\[buoy\]\]"),
        ("[random]\nvessels = 0\n", "vessels"),
        ("[random]\nvessels = 500\n", r"random\.vessels: .*<= 20"),
        ("[random]\nbuoys = 1000000000000\n", r"random\.buoys: .*<= 50"),
        ("[random]\nvessel = 3\n", r"random\.vessel: unknown key"),
        (VESSEL + "colour = 1\n", "colour"),
        ("time_limit_s = -1\n" + VESSEL, "time_limit_s"),
        ("[[vessel]]\nstart_m = [1]\nheading_deg = 0\ngoal_m = [3, 4]\n", "start_m"),
        (VESSEL.replace("[1, 2]", "[1e8, 2]"), r"start_m\[0\]: .*<= 10000000\.0, got"),
        (
            VESSEL + "[[quay]]\ncentre_m = [0, -1e300]\nsize_m = [1, 1, 1]\n",
            r"centre_m\[1\]: .*>= -10000000\.0",
        ),
        ("[random]\nvessel_area_m = [-1e9, 1e9]\n", r"vessel_area_m\[0\]: .*>= -10"),
        (
            VESSEL + "[[quay]]\ncentre_m = [0, 2]\nsize_m = [4, 2, 1]\n",
            "quay: the start of wamv1 lies within quay 1",
        ),
        (
            VESSEL
            + QUAY
            + "[[quay]]\ncentre_m = [30, 45]\nsize_m = [12, 1, 1]\nheading_deg = 90\n",
            "quay: the goal of wamv1 lies within quay 2",
        ),
        ("sea = 'stormy'\n" + VESSEL, "sea: .*'stormy' is not one of 'calm', 'paper', 'rough'"),
    ],
)
def test_a_file_that_cannot_be_used_is_refused_by_name(
    tmp_path: Path, text: str, words: str
) -> None:
    path = write(tmp_path / "bad.toml", text)
    with pytest.raises(ConfigError, match=words) as caught:
        load_scenario(path)
    assert "bad.toml" in str(caught.value)


def test_a_random_scenario_with_quays_is_never_refused_and_leaves_long_hulls_room(
    tmp_path: Path,
) -> None:
    path = write(tmp_path / "harbour.toml", "[random]\nvessels = 4\nbuoys = 1\n" + QUAY)
    for seed in range(200):
        scenario = load_scenario(path, seed=seed, types=["workboat"])
        for places in (scenario.starts[:, :2], scenario.goals):
            assert (from_quays(places, scenario.quays) >= 5.0).all()


def test_an_unknown_name_lists_the_names() -> None:
    with pytest.raises(ConfigError, match="'harbour', 'head_on', 'overtaking', 'passage'"):
        load_scenario("nowhere")


@pytest.mark.parametrize(
    ("name", "vessels", "buoys", "seed", "words"),
    [
        ("head_on", 3, None, 0, "vessels: this scenario has 2 vessels, not 3"),
        ("passage", None, 1, 0, "buoys: this scenario has 4 buoys, not 1"),
        ("random", 0, None, 0, "vessels: must be at least 1, got 0"),
        ("random", 3, -1, 0, "buoys: must be at least 0, got -1"),
        ("random", 3, 0, -1, "seed: must be at least 0, got -1"),
        ("random", 40, 0, 0, "no place found for 40 vessels"),
    ],
)
def test_a_request_that_cannot_be_met_is_refused(
    name: str, vessels: int | None, buoys: int | None, seed: int, words: str
) -> None:
    with pytest.raises(ConfigError, match=words) as caught:
        load_scenario(name, vessels, buoys, seed)
    assert f"{name}.toml" in str(caught.value)
