"""A run in this process: what it reports, and what it refuses."""

from dataclasses import replace
from pathlib import Path

import pytest

from twinscrew.hil_sim.scenario import load_scenario
from twinscrew.hil_sim.sitl import SitlSettings, sail
from twinscrew.runtime.errors import ConfigError, PolicyError

BRIEF = replace(load_scenario("random", 2, 1, 3), time_limit_s=2.0)
IN_STEP = SitlSettings(sensor="vrx16", lockstep=True)


def test_a_run_reports_every_vessel_and_keeps_nothing_where_no_folder_is_given(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    report = sail(BRIEF, IN_STEP)
    assert [v.name for v in report.vessels] == ["wamv1", "wamv2"]
    assert [v.outcome for v in report.vessels] == ["timeout", "timeout"]
    assert not report.success
    assert all(v.decisions >= 20 for v in report.vessels)
    assert all(v.travel_time_s == pytest.approx(2.0, abs=0.1) for v in report.vessels)
    assert all(v.latency.count == v.decisions for v in report.vessels)
    assert all(v.energy_ns > 0 for v in report.vessels)
    assert report.real_time_factor > 0
    assert list(tmp_path.iterdir()) == []


def test_recording_a_run_does_not_change_it(tmp_path: Path) -> None:
    assert sail(BRIEF, IN_STEP, tmp_path / "run").sha256 == sail(BRIEF, IN_STEP).sha256


def test_progress_is_told_with_every_vessels_state() -> None:
    told: list[int] = []
    sail(BRIEF, IN_STEP, progress=lambda time_s, results: told.append(len(results)))
    assert set(told) == {2}


def test_real_time_needs_a_folder() -> None:
    with pytest.raises(ConfigError, match="folder"):
        sail(BRIEF, SitlSettings(sensor="vrx16"))


def test_a_policy_or_sensor_that_does_not_exist_is_refused_before_anything_moves() -> None:
    with pytest.raises(PolicyError, match="clairvoyant"):
        sail(BRIEF, SitlSettings(sensor="vrx16", lockstep=True, policy="clairvoyant"))
    with pytest.raises(ConfigError, match="sonar"):
        sail(BRIEF, SitlSettings(sensor="sonar", lockstep=True))
