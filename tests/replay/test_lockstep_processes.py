"""Lock-step across processes, with Zenoh between them, decides as lock-step in one process does."""

import os
import signal
from dataclasses import replace
from pathlib import Path

import pytest
from tests.harness.commands import as_json, twinscrew
from tests.replay.test_determinism import busy_machine

from twinscrew.hil_sim.drivers.lockstep import ProcessCrew
from twinscrew.hil_sim.scenario import load_scenario
from twinscrew.hil_sim.sitl import SitlReport, SitlSettings, sail
from twinscrew.runtime.errors import ConfigError, LinkError, PolicyError
from twinscrew.runtime.recording.recording import find_recordings
from twinscrew.runtime.vessel.config import RuntimeConfig
from twinscrew.runtime.vessel.lockstep import Step
from twinscrew.runtime.vessel.replay import combined_sha256, replay

BRIEF = replace(load_scenario("crossing"), time_limit_s=4.0)
HERE = SitlSettings(sensor="vrx16", lockstep=True)
ELSEWHERE = SitlSettings(sensor="vrx16", lockstep=True, processes=True)


@pytest.fixture(scope="module")
def here(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, SitlReport]:
    folder = tmp_path_factory.mktemp("here")
    return folder, sail(BRIEF, HERE, folder)


def fates(report: SitlReport) -> list[tuple[object, ...]]:
    """All that a run decides of a vessel, to the last bit."""
    return [
        (v.name, v.outcome, v.travel_time_s, v.closest_approach_m, v.decisions, v.energy_ns)
        for v in report.vessels
    ]


def said(folder: Path) -> list[list[object]]:
    return [list(recording.messages()) for recording in find_recordings(folder)]


@pytest.mark.slow
def test_the_decisions_the_voyage_and_every_recorded_byte_are_the_same(
    here: tuple[Path, SitlReport], tmp_path: Path
) -> None:
    folder, expected = here
    found = sail(BRIEF, ELSEWHERE, tmp_path)
    assert all(vessel.decisions > 30 for vessel in found.vessels)
    assert found.sha256 == expected.sha256
    assert fates(found) == fates(expected)
    assert said(tmp_path) == said(folder)
    replays = [replay(recording) for recording in find_recordings(tmp_path)]
    assert all(r.same for r in replays)
    assert combined_sha256(r.sha256 for r in replays) == expected.sha256


@pytest.mark.slow
def test_a_busy_machine_changes_nothing(here: tuple[Path, SitlReport]) -> None:
    with busy_machine(processes=3):
        assert sail(BRIEF, ELSEWHERE).sha256 == here[1].sha256


@pytest.mark.slow
def test_another_seed_decides_otherwise(here: tuple[Path, SitlReport]) -> None:
    other = SitlSettings(sensor="vrx16", lockstep=True, processes=True, seed=1)
    assert sail(BRIEF, other).sha256 != here[1].sha256


def crew() -> ProcessCrew:
    return ProcessCrew([RuntimeConfig(name="wamv1", sensor="vrx16", policy="apf")], epoch_ns=0)


def test_a_runtime_that_is_killed_is_named_and_no_process_is_left() -> None:
    with crew() as runtimes:
        (vessel,) = runtimes.vessels
        assert vessel.exchange(b"", 0.05)
        os.kill(vessel.pid, signal.SIGKILL)
        with pytest.raises(LinkError, match="runtime of wamv1 ended with status -9"):
            vessel.exchange(b"", 0.1)
    with pytest.raises(ProcessLookupError):
        os.kill(vessel.pid, 0)


def test_what_a_runtime_cannot_use_is_told_in_its_words() -> None:
    wrong = RuntimeConfig(name="wamv1", policy="clairvoyant")
    with (
        pytest.raises(LinkError, match=r"wamv1 ended with status 2.*clairvoyant"),
        ProcessCrew([wrong], epoch_ns=0),
    ):
        pass
    with pytest.raises(PolicyError, match="clairvoyant"):
        sail(BRIEF, SitlSettings(lockstep=True, policy="clairvoyant"))


def test_in_real_time_there_is_nothing_to_choose(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="--lockstep"):
        sail(BRIEF, SitlSettings(processes=True), tmp_path)


def test_a_message_out_of_turn_ends_the_run_and_is_named() -> None:
    with crew() as runtimes:
        (vessel,) = runtimes.vessels
        vessel._bus.publish("odometry", b"")
        with pytest.raises(LinkError, match="out of step: points was announced, odometry came"):
            vessel._go(Step(0.05, topic="points"))


@pytest.mark.slow
def test_the_command_says_the_same_hash_in_one_process_and_in_many(tmp_path: Path) -> None:
    words = ("sitl", "--scenario", "crossing", "--lockstep", "--max-time", 3, "--json")
    one = twinscrew(*words, "--out", tmp_path / "one")
    many = twinscrew(*words, "--processes", "--out", tmp_path / "many")
    found = [as_json(finished)["decisions_sha256"] for finished in (one, many)]
    assert found[0] == found[1]
    assert len(list((tmp_path / "many").glob("*/recording/*.mcap"))) == 2
