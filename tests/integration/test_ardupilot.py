"""`twinscrew sitl --autopilot ardupilot`, end to end, as users run it.

A stand-in speaks ArduRover's side (tests/harness/ardupilot_peer.py). The same runs against the real
one:

    ARDUROVER=/path/to/ardurover pytest tests/integration/test_ardupilot.py
"""

import os
import socket
import stat
import sys
from pathlib import Path

import psutil
import pytest
from tests.harness.commands import as_json, start, twinscrew
from tests.harness.waiting import wait_until

from twinscrew.hil_sim.scenario import load_scenario
from twinscrew.runtime.messages import cdr
from twinscrew.runtime.recording.recording import find_recordings

pytestmark = pytest.mark.realtime

REPOSITORY = Path(__file__).parents[2]
REAL = os.environ.get("ARDUROVER", "")
PEER = f"""#!/bin/sh
PYTHONPATH={REPOSITORY} exec {sys.executable} -m tests.harness.ardupilot_peer "$@"
"""
INSTANCES = 20
"""Instance numbers to look for free ports in."""


@pytest.fixture(scope="module", params=["stand-in", "ardurover"])
def ardurover(request, tmp_path_factory) -> Path:
    if request.param == "stand-in":
        return executable(tmp_path_factory.mktemp("bin") / "ardurover", PEER)
    if not REAL:
        pytest.skip("no ArduRover binary: set ARDUROVER to its path to try the real one")
    return Path(REAL)


@pytest.fixture(scope="module")
def stand_in(tmp_path_factory) -> Path:
    return executable(tmp_path_factory.mktemp("bin") / "ardurover", PEER)


def executable(path: Path, words: str) -> Path:
    path.write_text(words)
    path.chmod(path.stat().st_mode | stat.S_IXUSR)
    return path


def free_instance(count: int = 2) -> int:
    """Give the first of so many instance numbers in a row whose ports nobody uses."""
    for first in range(30, 200, INSTANCES):
        if all(is_free(first + i) for i in range(count)):
            return first
    raise AssertionError("all of ArduPilot's ports are in use")


def is_free(instance: int) -> bool:
    ports = ((socket.SOCK_DGRAM, 9002), (socket.SOCK_STREAM, 5760))
    try:
        for kind, port in ports:
            with socket.socket(socket.AF_INET, kind) as probe:
                probe.bind(("127.0.0.1", port + 10 * instance))
    except OSError:
        return False
    return True


def sail(binary: Path, out: Path, *words: object):
    return twinscrew(
        *("sitl", "--autopilot", "ardupilot", "--ardupilot-binary", binary, "--json"),
        *("--ardupilot-instance", free_instance(), "--out", out, *words),
    )


@pytest.mark.parametrize("odometry", ["bus", pytest.param("autopilot", marks=pytest.mark.nightly)])
def test_two_vessels_sail_on_their_ardupilots_and_arrive(ardurover, odometry, tmp_path) -> None:
    words = ("--vessels", 2, "--buoys", 1, "--seed", 1, "--odometry", odometry)
    done = sail(ardurover, tmp_path / "run", *words)
    report = as_json(done)
    assert [vessel["outcome"] for vessel in report["vessels"]] == ["goal", "goal"], done.stderr
    replayed = as_json(twinscrew("replay", tmp_path / "run", "--json"))
    assert replayed["same"] is True
    assert replayed["decisions_sha256"] == report["decisions_sha256"]


def test_the_autopilots_odometry_is_in_the_scenarios_frame_and_the_scans_time(
    stand_in, tmp_path
) -> None:
    words = ("--vessels", 1, "--max-time", 2, "--seed", 4, "--odometry", "autopilot")
    done = sail(stand_in, tmp_path / "run", *words)
    assert done.returncode == 1  # 2 s are too short to arrive
    odometry = [cdr.decode_odometry(p) for p in inputs_of(tmp_path / "run", "odometry")]
    start_N = load_scenario("random", 1, None, 4).starts[0, :2]
    assert len(odometry) > 40
    assert odometry[0].position_N[:2] == pytest.approx(start_N, abs=0.5)
    scans = [cdr.decode_point_cloud(p).stamp_ns for p in inputs_of(tmp_path / "run", "points")]
    stamps = [sample.stamp_ns for sample in odometry]
    usable = [scan for scan in scans if scan > stamps[0]]
    assert len(usable) > 20
    assert all(min(abs(scan - stamp) for stamp in stamps) < 0.2e9 for scan in usable)


def inputs_of(run: Path, topic: str) -> list[bytes]:
    (recording,) = find_recordings(run)
    return [message.payload for message in recording.inputs() if message.topic == topic]


def test_a_wrong_parameter_is_named_and_the_run_does_not_hide_it(tmp_path) -> None:
    words = PEER.replace('"$@"', '"$@" --wrong PILOT_STEER_TYPE=0')
    binary = executable(tmp_path / "ardurover", words)
    done = sail(binary, tmp_path / "run", "--vessels", 1, "--max-time", 1)
    assert "wamv1: parameters_wrong: PILOT_STEER_TYPE is 0, must be 1" in done.stderr
    told = diagnostics_of(tmp_path / "run")
    wrong = [event.detail for event in told if event.name == "parameters_wrong"]
    assert wrong
    assert "PILOT_STEER_TYPE" in wrong[0]


def test_write_params_puts_it_right(tmp_path) -> None:
    words = PEER.replace('"$@"', '"$@" --wrong MOT_SLEWRATE=50')
    binary = executable(tmp_path / "ardurover", words)
    sail(binary, tmp_path / "run", "--vessels", 1, "--max-time", 1, "--write-params")
    told = diagnostics_of(tmp_path / "run")
    written = [event.detail for event in told if event.name == "parameters_written"]
    assert written == ["MOT_SLEWRATE was 50, is 0 now"]


def test_what_was_written_lasts_where_a_memory_is_kept(tmp_path) -> None:
    binary = executable(
        tmp_path / "ardurover", PEER.replace('"$@"', '"$@" --wrong MOT_SLEWRATE=50')
    )
    short = ("--vessels", 1, "--max-time", 1, "--ardupilot-memory", tmp_path / "memory")
    sail(binary, tmp_path / "first", *short, "--write-params")
    sail(binary, tmp_path / "second", *short)
    told = {event.name for event in diagnostics_of(tmp_path / "second")}
    assert not told & {"parameters_wrong", "parameters_written"}


def diagnostics_of(run: Path) -> list:
    (recording,) = find_recordings(run)
    messages = recording.messages(("diagnostics",))
    return [event for m in messages for event in cdr.decode_diagnostics(m.payload)]


def test_an_ardupilot_that_dies_ends_the_run_and_is_named(stand_in, tmp_path) -> None:
    folder, log = tmp_path / "run", tmp_path / "log.txt"
    words = ("--autopilot", "ardupilot", "--ardupilot-binary", stand_in, "--vessels", 1)
    instance = free_instance(1)
    run = start(
        *("sitl", *words, "--ardupilot-instance", instance, "--out", folder, "--json"), log=log
    )
    try:
        wait_until(lambda: list((folder / "wamv1" / "recording").glob("*.mcap")))
        victim = wait_until(lambda: peer_of(run.pid))
        victim.kill()
        assert run.wait(250) == 2
    finally:
        run.kill()
    assert f"ArduPilot's instance {instance} ended with status -9" in log.read_text()
    assert not [p for p in psutil.process_iter() if str(folder) in command_of(p)]


def peer_of(parent: int) -> psutil.Process | None:
    children = psutil.Process(parent).children()
    return next((child for child in children if "ardupilot_peer" in command_of(child)), None)


def command_of(process: psutil.Process) -> str:
    try:
        return " ".join(process.cmdline())
    except psutil.Error:
        return ""


def test_without_a_binary_it_tells_what_to_type_and_waits(stand_in, tmp_path) -> None:
    folder, log = tmp_path / "run", tmp_path / "log.txt"
    words = ("--autopilot", "ardupilot", "--vessels", 1, "--max-time", 1, "--out", folder)
    run = start("sitl", *words, "--ardupilot-instance", free_instance(1), "--json", log=log)
    pilot = None
    try:
        wait_until(lambda: "--defaults" in log.read_text())
        (line,) = (ln for ln in log.read_text().splitlines() if "--defaults" in ln)
        typed = line.strip().replace(" ardurover ", f" exec {stand_in} ")
        pilot = psutil.Popen(["/bin/sh", "-c", typed])
        assert run.wait(250) == 1  # a second is too short to arrive
    finally:
        run.kill()
        if pilot is not None:
            pilot.kill()
            pilot.wait()


def test_a_port_in_use_is_named(tmp_path) -> None:
    instance = free_instance(1)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
        other.bind(("127.0.0.1", 9002 + 10 * instance))
        words = ("--autopilot", "ardupilot", "--ardupilot-instance", instance)
        done = twinscrew("sitl", *words, "--vessels", 1, "--out", tmp_path / "run")
    assert done.returncode == 2
    assert f"UDP port {9002 + 10 * instance}" in done.stderr


def test_what_cannot_be_started_is_named(tmp_path) -> None:
    text = tmp_path / "ardurover"
    text.write_text("not a program")
    done = sail(text, tmp_path / "run", "--vessels", 1)
    assert done.returncode == 2
    assert f"{text}: cannot be started: Permission denied" in done.stderr


def test_lockstep_is_refused(tmp_path) -> None:
    done = twinscrew("sitl", "--autopilot", "ardupilot", "--lockstep", "--out", tmp_path / "run")
    assert done.returncode == 2
    assert "without --lockstep" in done.stderr


def test_a_binary_without_its_word_is_refused(stand_in, tmp_path) -> None:
    done = twinscrew("sitl", "--ardupilot-binary", stand_in, "--out", tmp_path / "run")
    assert done.returncode == 2
    assert "--autopilot ardupilot" in done.stderr
