"""`twinscrew sitl`, as users run it: in processes of their own."""

import json
from pathlib import Path

import psutil
import pytest
from tests.harness.commands import as_json, start, twinscrew
from tests.harness.waiting import wait_until

pytestmark = pytest.mark.slow

KEYS = {"success", "seed", "vessels", "latency_ms", "real_time_factor", "decisions_sha256"}
VESSEL_KEYS = {"name", "outcome", "travel_time_s", "closest_approach_m", "decisions"}
VESSEL_KEYS |= {"touched", "greatest_current_mps"}
"""Keys may come to others; none may go."""


def lockstep(out: Path, *words: object, **environment: str):
    return twinscrew("sitl", "--lockstep", "--json", "--out", out, *words, **environment)


@pytest.fixture(scope="module")
def head_on(tmp_path_factory: pytest.TempPathFactory):
    """A run to its end: the folder, and the finished command."""
    folder = tmp_path_factory.mktemp("head_on") / "run"
    return folder, lockstep(folder, "--scenario", "head_on")


def test_two_vessels_meet_head_on_and_both_arrive(head_on) -> None:
    _, done = head_on
    report = as_json(done)
    assert done.returncode == 0
    assert report["success"] is True
    assert [vessel["outcome"] for vessel in report["vessels"]] == ["goal", "goal"]
    assert all(vessel["closest_approach_m"] > 0 for vessel in report["vessels"])


def test_the_json_object_has_exactly_the_keys_that_others_script(head_on) -> None:
    report = as_json(head_on[1])
    assert set(report) == KEYS
    assert {frozenset(vessel) for vessel in report["vessels"]} == {frozenset(VESSEL_KEYS)}
    assert set(report["latency_ms"]) == {"p50", "p99", "max"}
    assert 0 < report["latency_ms"]["p50"] <= report["latency_ms"]["p99"]
    assert report["real_time_factor"] > 0
    assert len(report["decisions_sha256"]) == 64
    assert head_on[1].stderr == ""


def test_a_run_leaves_recordings_a_figure_and_a_summary(head_on) -> None:
    folder, done = head_on
    summary = json.loads((folder / "summary.json").read_text())
    report = as_json(done)
    assert summary["decisions_sha256"] == report["decisions_sha256"]
    assert summary["setup"]["scenario"] == "head_on"
    assert (folder / "trajectories.png").read_bytes().startswith(b"\x89PNG")
    for vessel in report["vessels"]:
        bag = folder / vessel["name"] / "recording"
        assert (bag / "metadata.yaml").is_file()
        assert list(bag.glob("*.mcap"))


@pytest.mark.parametrize("threads", ["1", "2"])
def test_a_replay_of_the_run_gives_the_same_decisions(head_on, threads: str) -> None:
    folder, done = head_on
    again = twinscrew(
        "replay", folder, "--json", OMP_NUM_THREADS=threads, OPENBLAS_NUM_THREADS=threads
    )
    replayed = as_json(again)
    assert again.returncode == 0
    assert replayed["same"] is True
    assert replayed["decisions_sha256"] == as_json(done)["decisions_sha256"]
    assert [v["decisions"] for v in replayed["vessels"]] == [
        v["decisions"] for v in as_json(done)["vessels"]
    ]


def test_a_replay_with_another_configuration_differs_and_says_so(head_on, tmp_path: Path) -> None:
    blind = tmp_path / "blind.toml"
    blind.write_text("[perception]\nmin_points = 1000000\n")
    again = twinscrew("replay", head_on[0] / "wamv1", "--config", blind, "--json")
    assert again.returncode == 1
    assert as_json(again)["same"] is False


def test_the_same_seed_gives_the_same_decisions_and_another_seed_others(tmp_path: Path) -> None:
    words = ("--vessels", 2, "--buoys", 1, "--max-time", 4)
    runs = [
        lockstep(tmp_path / f"run{k}", *words, "--seed", seed, PYTHONHASHSEED=str(k))
        for k, seed in enumerate((1, 1, 2))
    ]
    hashes = [as_json(run)["decisions_sha256"] for run in runs]
    assert hashes[0] == hashes[1]
    assert hashes[0] != hashes[2]
    assert [run.returncode for run in runs] == [1, 1, 1]  # 4 s are too short to arrive
    assert {v["outcome"] for v in as_json(runs[0])["vessels"]} == {"timeout"}


def test_a_folder_that_holds_something_is_not_overwritten(tmp_path: Path) -> None:
    (tmp_path / "notes.txt").write_text("mine")
    done = lockstep(tmp_path)
    assert done.returncode == 2
    assert "not empty" in done.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["notes.txt"]


def test_a_policy_that_does_not_exist_is_refused(tmp_path: Path) -> None:
    done = lockstep(tmp_path / "run", "--policy", "clairvoyant")
    assert done.returncode == 2
    assert "clairvoyant" in done.stderr
    assert "apf, mpc" in done.stderr


@pytest.mark.parametrize("there", [False, True])
def test_a_run_that_was_refused_leaves_the_folder_as_it_was_for_the_next_try(
    tmp_path: Path, there: bool
) -> None:
    out = tmp_path / "run"
    if there:
        out.mkdir()
    assert lockstep(out, "--policy", "clairvoyant").returncode == 2
    assert out.exists() == there
    again = lockstep(out, "--vessels", 1, "--max-time", 0.5)
    assert again.returncode == 1, again.stderr
    assert (out / "scene.json").is_file()


def test_without_json_there_is_a_table(tmp_path: Path) -> None:
    words = ("--lockstep", "--vessels", 1, "--max-time", 1, "--out", tmp_path / "run")
    done = twinscrew("sitl", *words, COLUMNS="160")
    assert done.returncode == 1
    for word in ("wamv1", "timeout", "closest approach", "latency p99"):
        assert word in done.stdout
    assert done.stderr.startswith("1 vessel, random, seed 0")


def test_in_real_time_every_vessel_has_a_process_of_its_own(tmp_path: Path) -> None:
    folder = tmp_path / "run"
    words = ("--scenario", "head_on", "--max-time", 3, "--out", folder, "--json")
    done = twinscrew("sitl", *words)
    report = as_json(done)
    assert done.returncode == 1
    assert [vessel["outcome"] for vessel in report["vessels"]] == ["timeout"] * 2
    assert all(vessel["decisions"] > 0 for vessel in report["vessels"])
    for name in ("wamv1", "wamv2"):
        assert "decisions, stopped" in (folder / name / "log.txt").read_text()
    replayed = twinscrew("replay", folder, "--json")
    assert as_json(replayed)["decisions_sha256"] == report["decisions_sha256"]


def test_a_runtime_that_is_killed_ends_the_run_and_is_named(tmp_path: Path) -> None:
    folder, log = tmp_path / "run", tmp_path / "log.txt"
    words = ("--scenario", "head_on", "--max-time", 60, "--out", folder, "--json")
    sitl = start("sitl", *words, log=log)
    try:
        victim = wait_until(lambda: runtime_of(sitl.pid, "wamv2"))
        wait_until(lambda: list((folder / "wamv2" / "recording").glob("*.mcap")))
        victim.kill()
        assert sitl.wait(250) == 2
    finally:
        sitl.kill()
    words = log.read_text()
    assert "the runtime of wamv2 ended with status -9" in words
    assert not [child for child in psutil.process_iter() if str(folder) in command_of(child)]


def runtime_of(parent: int, name: str) -> psutil.Process | None:
    children = psutil.Process(parent).children()
    return next((child for child in children if f"/{name}/" in command_of(child)), None)


def command_of(process: psutil.Process) -> str:
    try:
        return " ".join(process.cmdline())
    except psutil.Error:
        return ""
