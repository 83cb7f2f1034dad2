"""`twinscrew run`: what is deployed on the boat, as a process with real sockets."""

import os
import random
import signal
import socket
import subprocess
import time
from collections.abc import Iterator
from contextlib import closing
from functools import partial
from pathlib import Path

import onnx
import pytest
from tests.harness.commands import GIVE_UP_S, running, stop, twinscrew
from tests.harness.sensors import Sensors
from tests.harness.waiting import wait_until

from twinscrew.runtime.bus.zenoh import ZenohBus, ZenohSettings
from twinscrew.runtime.messages import cdr
from twinscrew.runtime.recording.recording import find_recordings
from twinscrew.runtime.settings import CONFIG_DIR
from twinscrew.runtime.vessel.summary import read_summary

pytestmark = pytest.mark.slow

HOST = "127.0.0.1"


@pytest.fixture
def endpoint() -> str:
    with socket.socket() as probe:
        probe.bind((HOST, 0))
        return f"tcp/{HOST}:{probe.getsockname()[1]}"


@pytest.fixture
def busy_port() -> Iterator[int]:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as taken:
        taken.bind((HOST, 0))
        yield taken.getsockname()[1]


def written(folder: Path, text: str = "", *, autopilot: str = "", bus: str = "") -> Path:
    """Write a configuration that needs no free port of a fixed number."""
    path = folder / "boat.toml"
    connection = autopilot or f"udpin:{HOST}:0"
    path.write_text(
        f'{text}\n[autopilot]\nconnection = "{connection}"\n[bus]\n{bus or "connect = []"}\n'
        f'[recording]\nfolder = "{folder / "kept"}"\n'
    )
    return path


def events_in(folder: Path) -> list[str]:
    (recording,) = find_recordings(folder)
    payloads = [m.payload for m in recording.messages() if m.topic == "diagnostics"]
    return [event.name for payload in payloads for event in cdr.decode_diagnostics(payload)]


def test_without_an_autopilot_it_says_so_decides_on_and_stops_cleanly(
    tmp_path: Path, endpoint: str
) -> None:
    log = tmp_path / "log.txt"
    config = written(
        tmp_path,
        "[mission]\nwaypoints_m = [[100.0, 0.0]]",
        bus=f'connect = []\nlisten = ["{endpoint}"]',
    )
    with running("run", "--config", config, log=log) as runtime:
        wait_until(lambda: "wamv: running" in log.read_text())
        with closing(ZenohBus(ZenohSettings(connect=(endpoint,)), "wamv")) as bus:
            sensors = Sensors(bus)
            sensors.measure_until_decided(5)
            assert stop(runtime) == 0
    assert all(not cdr.decode_decision(payload).thrust.any() for payload in sensors.decisions)
    assert "decisions, stopped" in log.read_text()
    assert read_summary(tmp_path / "kept").decisions >= 5
    assert "autopilot_silent" in events_in(tmp_path / "kept")


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_told_to_stop_before_anything_came_it_stops_cleanly(tmp_path: Path, number: int) -> None:
    log = tmp_path / "log.txt"
    with running("run", "--config", written(tmp_path), log=log) as runtime:
        wait_until(lambda: "wamv: running" in log.read_text())
        assert stop(runtime, number) == 0
    assert read_summary(tmp_path / "kept").decisions == 0


def test_told_to_stop_again_and_again_it_stops_as_cleanly(tmp_path: Path) -> None:
    """Handlers run in the middle of each other: with a lock in one, some of these never ended."""
    for turn in range(4):
        log = tmp_path / f"log_{turn}.txt"
        with running("run", "--config", written(tmp_path), log=log) as runtime:
            wait_until(partial(says, log, "wamv: running"))
            storm(runtime, random.Random(turn))
            runtime.wait(GIVE_UP_S)
        assert "decisions, stopped" in log.read_text()


def says(log: Path, words: str) -> bool:
    return words in log.read_text()


def storm(process: subprocess.Popen[bytes], rng: random.Random) -> None:
    """Send signals for 50 ms, some tens of microseconds apart."""
    end_s = time.perf_counter() + 0.05
    while time.perf_counter() < end_s:
        os.kill(process.pid, rng.choice([signal.SIGTERM, signal.SIGINT]))  # nobody waits for it yet
        next_s = time.perf_counter() + rng.uniform(0.0, 60e-6)
        while time.perf_counter() < next_s:
            pass


def refused(config: Path, *words: str) -> None:
    done = twinscrew("run", "--config", config)
    assert done.returncode == 2
    assert done.stdout == ""
    (line,) = done.stderr.splitlines()
    for word in words:
        assert word in line


def test_an_autopilots_port_in_use_is_refused_by_name(tmp_path: Path, busy_port: int) -> None:
    connection = f"udpin:{HOST}:{busy_port}"
    refused(written(tmp_path, autopilot=connection), connection, "in use")


def test_a_zenoh_port_in_use_is_refused_by_name(tmp_path: Path) -> None:
    with socket.socket() as taken:
        taken.bind((HOST, 0))
        taken.listen()
        endpoint = f"tcp/{HOST}:{taken.getsockname()[1]}"
        refused(written(tmp_path, bus=f'connect = []\nlisten = ["{endpoint}"]'), endpoint)


def test_an_unknown_key_is_refused_with_those_that_are_known(tmp_path: Path) -> None:
    config = written(tmp_path, "[mission]\nwaypoint = []")
    refused(config, str(config), "mission.waypoint", "unknown key", "waypoints_m")


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"thrust_max_n": "2000"}, ["thrust_max_n", "2000"]),
        ({"decision_period_s": None}, ["decision_period_s"]),
        ({"observed_objects": "9"}, ["inputs.objects.shape", "9"]),
    ],
)
def test_a_policy_made_for_something_else_is_refused(
    tmp_path: Path, changes: dict[str, str | None], words: list[str]
) -> None:
    model = onnx.load(CONFIG_DIR / "policies" / "ac_iqn_wam_v.onnx")
    properties = {entry.key: entry.value for entry in model.metadata_props}
    kept = {k: v for k, v in {**properties, **changes}.items() if v is not None}
    onnx.helper.set_model_props(model, kept)
    policy = tmp_path / "other.onnx"
    onnx.save(model, policy)
    refused(written(tmp_path, f'policy = "{policy}"'), str(policy), *words)


def test_a_sensor_that_does_not_exist_is_refused_with_those_that_do(tmp_path: Path) -> None:
    refused(written(tmp_path, 'sensor = "sonar"'), "sonar", "vrx32")


def test_a_recording_is_not_written_over_another(tmp_path: Path) -> None:
    old = tmp_path / "kept" / "recording" / "old.mcap"
    old.parent.mkdir(parents=True)
    old.write_bytes(b"of yesterday")
    config = written(tmp_path)
    fresh = tmp_path / "kept" / "recording-2"
    with running("run", "--config", config, log=tmp_path / "log.txt") as runtime:
        wait_until(lambda: fresh.is_dir() and any(fresh.glob("*.mcap")))
        assert stop(runtime) == 0
    assert old.read_bytes() == b"of yesterday"
