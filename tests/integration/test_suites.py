"""A suite from the command line, and a drawn harbour in lock-step."""

import pytest
from tests.harness.commands import as_json, twinscrew

pytestmark = pytest.mark.slow


def test_a_suite_has_its_own_sets_figures_aims_and_section(tmp_path) -> None:
    out = tmp_path / "out"
    words = ("experiment", "--suite", "currents", "--episodes", 1, "--jobs", 1, "--out", out)
    done = twinscrew(*words, "--json")
    assert done.returncode == 0, done.stderr
    answer = as_json(done)
    assert answer["episodes"] == 2
    assert answer["suite"]["name"] == "currents"
    for row, share in zip(answer["suite"]["figures"], (0.3, 0.5), strict=True):
        assert row["vessels"] == row["arrived"] + row["contacts"] + row["out_of_time"] == 3
        assert 0.2 * share * 3.3 < row["greatest_current_mps"] <= share * 3.4
        assert row["aims"]["contacts at most 0"] is (row["contacts"] == 0)
    told = twinscrew("report", out, "--no-trajectories", "--failures", 0)
    assert told.returncode == 0, told.stderr
    report = (out / "REPORT.md").read_text()
    assert "## Suite currents" in report
    assert "arrived_rate at least 0.995" in report


def test_a_suite_takes_no_other_sets(tmp_path) -> None:
    refused = twinscrew("experiment", "--suite", "gap", "--sets", "paper", "--out", tmp_path / "o")
    assert refused.returncode == 2
    assert "a suite has its own sets" in refused.stderr


def test_a_harbour_sails_in_lock_step_the_same_twice(tmp_path) -> None:
    words = ("sitl", "--scenario", "harbour", "--seed", 3, "--lockstep", "--max-time", 3, "--json")
    first, again = (as_json(twinscrew(*words, "--out", tmp_path / k)) for k in ("a", "b"))
    assert first["decisions_sha256"] == again["decisions_sha256"]
    assert {"touched", "greatest_current_mps"} <= set(first["vessels"][0])
