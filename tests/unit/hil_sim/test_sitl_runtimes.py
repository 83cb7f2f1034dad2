"""What each vessel's runtime is told."""

from pathlib import Path

import pytest

from twinscrew.hil_sim.scenario import load_scenario
from twinscrew.hil_sim.sitl_runtimes import runtime_config
from twinscrew.hil_sim.sitl_settings import OdometrySource, SitlSettings

SCENARIO = load_scenario("random", 2, 1, 3)


def test_every_vessel_has_its_own_name_and_system_and_sails_to_the_scenarios_goals() -> None:
    one, two = (runtime_config(SitlSettings(), SCENARIO, i, None) for i in (0, 1))
    assert (one.name, two.name) == SCENARIO.names
    assert (one.autopilot.system_id, two.autopilot.system_id) == (1, 2)
    assert one.mission.goal_radius_m == SCENARIO.goal_radius


@pytest.mark.parametrize("odometry", list(OdometrySource))
def test_odometry_comes_from_where_it_was_asked_for(odometry: OdometrySource) -> None:
    config = runtime_config(SitlSettings(odometry=odometry), SCENARIO, 0, None)
    whole = odometry is OdometrySource.AUTOPILOT_ODOMETRY
    assert config.odometry_source == ("autopilot" if whole else odometry.value)
    assert config.autopilot.state_message == ("odometry" if whole else "local_position")


def test_a_run_is_recorded_where_there_is_a_folder_only(tmp_path: Path) -> None:
    kept, lost = (runtime_config(SitlSettings(), SCENARIO, 0, f) for f in (tmp_path, None))
    assert kept.recording.folder == str(tmp_path)
    assert kept.recording.about == {"scenario": SCENARIO.name, "seed": "0"}
    assert lost.recording.folder == ""


def test_a_watching_ground_station_is_told_what_the_vessels_see() -> None:
    alone = runtime_config(SitlSettings(), SCENARIO, 0, None).ground
    watched = runtime_config(SitlSettings(ground="127.0.0.1:14550"), SCENARIO, 0, None).ground
    assert alone.obstacles_hz == 0.0
    assert watched.obstacles_hz > 0.0


def test_a_policy_file_is_found_from_wherever_the_runtime_starts(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "mine.onnx").touch()
    monkeypatch.chdir(tmp_path)
    given = (
        runtime_config(SitlSettings(policy=p), SCENARIO, 0, None) for p in ("mine.onnx", "apf")
    )
    assert [config.policy for config in given] == [str(tmp_path / "mine.onnx"), "apf"]
