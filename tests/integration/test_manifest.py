"""`twinscrew manifest`, and `twinscrew run` that refuses what has changed: as commands."""

import json
import shutil
import signal
from pathlib import Path

import pytest
from tests.harness.commands import as_json, start, twinscrew
from tests.harness.waiting import wait_until

from twinscrew.runtime.messages import cdr
from twinscrew.runtime.recording.recording import find_recordings
from twinscrew.runtime.settings import CONFIG_DIR

pytestmark = pytest.mark.slow


@pytest.fixture
def boat(tmp_path: Path) -> Path:
    """A boat's folder: a configuration with a policy of its own, a signed manifest, a key."""
    shutil.copy(CONFIG_DIR / "policies" / "ac_iqn.onnx", tmp_path / "policy.onnx")
    (tmp_path / "boat.toml").write_text(
        f'policy = "{tmp_path / "policy.onnx"}"\n[bus]\nconnect = []\n'
        f'[autopilot]\nconnection = "udpin:127.0.0.1:0"\n'
        f'[recording]\nfolder = "{tmp_path / "kept"}"\n'
    )
    done("manifest", "write", "--config", tmp_path / "boat.toml")
    done("manifest", "keys", tmp_path / "ashore")
    key = tmp_path / "ashore" / "twinscrew.key"
    done("manifest", "sign", tmp_path / "manifest.toml", "--key", key, "--comment", "sea trial 7")
    shutil.copy(tmp_path / "ashore" / "twinscrew.pub", tmp_path)
    return tmp_path


def done(*words: object) -> str:
    finished = twinscrew(*words)
    assert finished.returncode == 0, finished.stderr
    return finished.stdout


def refused(*words: object) -> str:
    finished = twinscrew(*words)
    assert finished.returncode == 2, finished.stdout
    assert finished.stderr.count("\n") == 1
    return finished.stderr


def options(boat: Path) -> tuple[object, ...]:
    return ("--manifest", boat / "manifest.toml", "--public-key", boat / "twinscrew.pub")


def test_files_that_were_signed_for_are_verified(boat: Path) -> None:
    said = done(
        "manifest", "verify", boat / "manifest.toml", "--public-key", boat / "twinscrew.pub"
    )
    assert said.startswith("5 files as in the manifest ")
    assert "(sea trial 7)" in said


@pytest.mark.parametrize("name", ["boat.toml", "policy.onnx", "manifest.toml"])
def test_a_changed_file_is_refused_before_the_runtime_begins(boat: Path, name: str) -> None:
    with (boat / name).open("a") as file:
        file.write("\n")
    words = refused("run", "--config", boat / "boat.toml", *options(boat))
    assert name in words
    assert "not over this file" in words if name == "manifest.toml" else "has changed" in words
    assert not (boat / "kept").exists()
    refused("manifest", "verify", boat / "manifest.toml", "--public-key", boat / "twinscrew.pub")


def test_the_manifests_own_words_do_not_help_an_unlisted_policy(boat: Path) -> None:
    shutil.copy(boat / "policy.onnx", boat / "other.onnx")
    text = (boat / "boat.toml").read_text().replace("policy.onnx", "other.onnx")
    (boat / "other.toml").write_text(text)
    words = refused("run", "--config", boat / "other.toml", *options(boat))
    assert "does not list" in words
    assert "other.toml" in words


def test_nothing_is_signed_that_is_not_as_the_manifest_says(boat: Path) -> None:
    (boat / "policy.onnx").write_bytes(b"changed")
    key = boat / "ashore" / "twinscrew.key"
    words = refused("manifest", "sign", boat / "manifest.toml", "--key", key)
    assert "policy.onnx has changed" in words


def test_the_doctor_has_a_line_for_it(boat: Path) -> None:
    def files() -> dict[str, str]:
        finished = twinscrew("doctor", "--json", "--config", boat / "boat.toml", *options(boat))
        (line,) = [c for c in as_json(finished)["checks"] if c["what"] == "files"]
        return line

    assert files()["verdict"] == "OK"
    (boat / "policy.onnx").write_bytes(b"changed")
    assert files()["verdict"] == "FAIL", json.dumps(files())


def test_an_approved_boat_runs_and_its_recording_says_who_approved_it(boat: Path) -> None:
    log = boat / "log.txt"
    runtime = start("run", "--config", boat / "boat.toml", *options(boat), log=log)
    try:
        wait_until(lambda: "wamv: running" in log.read_text() or runtime.poll() is not None)
        assert runtime.poll() is None, log.read_text()
        runtime.send_signal(signal.SIGTERM)
        assert runtime.wait(200) == 0
    finally:
        runtime.kill()
    (recording,) = find_recordings(boat / "kept")
    told = [m.payload for m in recording.messages() if m.topic == "diagnostics"]
    events = [event for payload in told for event in cdr.decode_diagnostics(payload)]
    (approved,) = [event.detail for event in events if event.name == "files_approved"]
    assert "(sea trial 7)" in approved
