"""Vessels of several kinds in one world, each by its own description."""

import dataclasses
import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from tests.reference.sailing import calm

from twinscrew.hil_sim.contacts import HullCircles, Obstacles, gaps, reaches
from twinscrew.hil_sim.scenario import load_scenario
from twinscrew.hil_sim.sitl import SitlSettings, sail
from twinscrew.hil_sim.vessel.dynamics import FleetDynamics, VesselDynamics
from twinscrew.hil_sim.vessel.rest import at_rest, fleet_at_rest
from twinscrew.hil_sim.world import make_world
from twinscrew.runtime.errors import ConfigError
from twinscrew.runtime.vessel_description import load_vessel

LEAST = """
[vessel]
name = "tub"
length_m = 3.0
beam_m = 1.4
mass_kg = 150.0
thruster_spacing_m = 1.0
thrust_max_n = 200.0
thrust_min_n = -120.0
top_speed_mps = 2.5
"""


def test_each_vessel_of_a_fleet_moves_as_it_would_alone() -> None:
    kinds = [load_vessel(name) for name in ("otter", "wam_v", "otter")]
    places, headings = np.array([[0.0, 0.0], [20.0, 0.0], [40.0, 0.0]]), np.array([0.0, 1.0, 2.0])
    fleet, sea = FleetDynamics(kinds), calm()
    state = fleet_at_rest(fleet, places, headings)
    commands = np.array([[100.0, 50.0], [800.0, 900.0], [-50.0, 100.0]])
    for step in range(100):
        state = fleet.step(state, commands, sea, 0.01 * step, 0.01)
    for i, kind in enumerate(kinds):
        alone = VesselDynamics(kind)
        one = at_rest(alone, places[i : i + 1], headings[i : i + 1])
        for step in range(100):
            one = alone.step(one, commands[i : i + 1], sea, 0.01 * step, 0.01)
        np.testing.assert_array_equal(state.position_N[i], one.position_N[0])
        np.testing.assert_array_equal(state.rates_B[i], one.rates_B[0])


def test_a_scenario_says_what_its_vessels_are(tmp_path: Path) -> None:
    file = tmp_path / "mixed.toml"
    entry = '[[vessel]]\ntype = "{}"\nstart_m = [{}, 5]\nheading_deg = 0\ngoal_m = [{}, 45]\n'
    file.write_text(entry.format("otter", 5, 5) + entry.format("workboat", 30, 30))
    scenario = load_scenario(file)
    assert scenario.types == ("otter", "workboat")
    assert scenario.goal_radius == pytest.approx(0.4 * 7.0)
    world = make_world(scenario)
    assert [vessel.name for vessel in world.vessels] == ["Maritime Robotics Otter", "Workboat 7 m"]
    assert load_scenario(file, types=["heron"]).types == ("heron", "heron")
    file.write_text(entry.format("titanic", 5, 5))
    with pytest.raises(ConfigError, match="titanic"):
        load_scenario(file)


def test_vessels_see_one_another_whatever_they_are() -> None:
    scenario = load_scenario("head_on", types=["wam_v", "otter"])
    starts = np.array([[0.0, 0.0, 0.0], [9.0, 0.0, np.pi]])
    world = make_world(dataclasses.replace(scenario, starts=starts, sea="calm"))
    for own, other in ((0, 1), (1, 0)):
        scan = world.scan(own)
        assert np.count_nonzero(scan.object_ids == other) > 20


def test_gaps_of_several_circles_are_those_of_the_nearest_pair() -> None:
    long, short = load_vessel("workboat"), load_vessel("blueboat")
    hulls = HullCircles([long, short])
    obstacles = Obstacles(circles=np.array([[10.0, 0.0, 0.75]]), boxes=np.empty((0, 6)))
    position, heading = np.array([[0.0, 0.0], [0.0, 6.0]]), np.array([np.pi / 2, 0.0])
    found = hulls.of_vessels(
        gaps(
            hulls.centres(position, heading),
            reaches(hulls, np.array([True, True]), obstacles),
            obstacles,
        )
    )
    ahead, radius = max(long.circles_m)
    assert found.shape == (2, 3)
    assert found[0, 1] == pytest.approx(6.0 - ahead - radius - short.radius_m)
    assert found[0, 1] == found[1, 0]
    assert np.isinf(found[0, 0])
    # Athwart, the middle circle is the nearest to the buoy.
    assert found[0, 2] == pytest.approx(10.0 - radius - 0.75)


def test_a_vessel_of_which_only_the_least_is_known_sails(tmp_path: Path) -> None:
    file = tmp_path / "tub.toml"
    file.write_text(LEAST)
    scenario = load_scenario("random", vessels=1, seed=3, types=[str(file)])
    report = sail(scenario, SitlSettings(policy="mpc", seed=3, lockstep=True))
    assert report.success


@pytest.mark.slow
def test_a_mixed_fleet_sails_from_the_command_line(tmp_path: Path) -> None:
    words = ["sitl", "--lockstep", "--vessel", "wam_v", "--vessel", "otter", "--vessels", "2"]
    words += ["--policy", "mpc", "--seed", "3", "--json", "--out", str(tmp_path / "run")]
    command = Path(sys.executable).with_name("twinscrew")
    result = subprocess.run([command, *words], capture_output=True, text=True, check=False)
    report = json.loads(result.stdout)
    assert [vessel["outcome"] for vessel in report["vessels"]] == ["goal", "goal"]


def test_a_shipped_policy_refuses_a_hull_that_it_was_not_trained_for() -> None:
    from twinscrew.runtime.errors import PolicyError

    scenario = load_scenario("random", vessels=1, seed=3, types=["blueboat"])
    with pytest.raises(PolicyError, match=r"WAM-V 16.*BlueBoat"):
        sail(scenario, SitlSettings(policy="ac_iqn_wam_v", seed=3, lockstep=True))
