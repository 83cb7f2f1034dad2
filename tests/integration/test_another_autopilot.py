"""Another kind of autopilot sails the same boat: one file, and a line in the table of kinds."""

import socket
import threading
import time
from contextlib import closing, suppress
from pathlib import Path

import numpy as np
import pytest
from tests.harness.boat import EPOCH_NS, TICK_S, cloud, odometry
from tests.harness.text_autopilot import TextBoat
from tests.harness.waiting import wait_until

from twinscrew.runtime.bus.zenoh import ZenohBus, ZenohSettings
from twinscrew.runtime.doctor.checks import check_autopilot_port
from twinscrew.runtime.doctor.listening import judge_autopilot
from twinscrew.runtime.errors import ConfigError
from twinscrew.runtime.link.autopilot import AUTOPILOTS, make_autopilot
from twinscrew.runtime.messages import cdr
from twinscrew.runtime.recording.recording import find_recordings
from twinscrew.runtime.vessel.config import RuntimeConfig, load_config
from twinscrew.runtime.vessel.lockstep import SteppedRuntime
from twinscrew.runtime.vessel.realtime import run_vessel
from twinscrew.runtime.vessel.replay import replay

HOST = "127.0.0.1"
BOAT = """
sensor = "vrx16"
policy = "apf"
odometry_source = "autopilot"
[mission]
waypoints_m = [[100.0, 0.0]]
[autopilot]
kind = "text"
connection = "{connection}"
[autopilot.options]
silent_after_s = 0.4
[recording]
folder = "{folder}"
"""


@pytest.fixture(autouse=True)
def _known(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(AUTOPILOTS, "text", "tests.harness.text_autopilot:make")


def configured(folder: Path, connection: str = "udpin:127.0.0.1:0", bus: str = "") -> RuntimeConfig:
    path = folder / "boat.toml"
    path.write_text(BOAT.format(connection=connection, folder=folder / "kept") + bus)
    return load_config(path)


def sail(runtime: SteppedRuntime, boat: TextBoat, begin: int, ticks: int, *, line: bool = True):
    """Let boat and runtime talk, 20 times a second; the boat goes ahead at 1 m/s."""
    for k in range(begin, begin + ticks):
        now_s = round(TICK_S * k, 6)
        if k % 2 == 0:
            scan = cdr.encode_point_cloud(cloud(now_s))
            boat.receive(runtime.deliver("points", scan, now_s))
        said = boat.says(odometry(now_s, north=now_s)) if line else b""
        boat.receive(runtime.exchange(said, now_s))


def test_it_sails_a_vessel_in_lock_step_and_what_it_did_replays(tmp_path: Path) -> None:
    boat, runtime = TextBoat(), SteppedRuntime(configured(tmp_path), epoch_ns=EPOCH_NS)
    sail(runtime, boat, 0, 80)
    assert (boat.thrust > 100.0).all()
    assert boat.hellos >= 80  # with each tick
    boat.mode = "helm"
    sail(runtime, boat, 80, 4)
    assert not boat.thrust.any()
    boat.mode = "auto"
    sail(runtime, boat, 84, 40)
    assert (boat.thrust > 100.0).all()
    runtime.close()
    (recording,) = find_recordings(tmp_path / "kept")
    again = replay(recording)
    assert again.decisions == runtime.publisher.decisions > 50
    assert again.sha256 == runtime.publisher.sha256


def test_when_it_falls_silent_the_propellers_stop_and_it_is_told(tmp_path: Path) -> None:
    boat, runtime = TextBoat(), SteppedRuntime(configured(tmp_path), epoch_ns=EPOCH_NS)
    sail(runtime, boat, 0, 80)
    sail(runtime, boat, 80, 10, line=False)
    assert not boat.thrust.any()
    runtime.close()
    (recording,) = find_recordings(tmp_path / "kept")
    told = [m.payload for m in recording.messages() if m.topic == "diagnostics"]
    names = [event.name for payload in told for event in cdr.decode_diagnostics(payload)]
    assert names.count("autopilot_silent") == 1


def test_it_sails_a_vessel_in_real_time_over_its_own_socket(tmp_path: Path) -> None:
    with socket.socket() as probe, socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as port:
        probe.bind((HOST, 0))
        port.bind((HOST, 0))
        endpoint, there = f"tcp/{HOST}:{probe.getsockname()[1]}", port.getsockname()
    config = configured(
        tmp_path,
        f"udpin:{HOST}:{there[1]}",
        f'[bus]\nconnect = []\nlisten = ["{endpoint}"]\nshared_memory = false\n',
    )
    over, ready, boat = threading.Event(), threading.Event(), TextBoat()
    runtime = threading.Thread(
        target=run_vessel,
        args=(config,),
        kwargs={"source": tmp_path, "stop": over.is_set, "ready": ready.set},
    )
    runtime.start()
    try:
        assert ready.wait(60.0)
        settings = ZenohSettings(connect=(endpoint,), shared_memory=False)
        with (
            closing(ZenohBus(settings, "wamv")) as bus,
            socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as line,
        ):
            line.connect(there)
            line.setblocking(False)
            begun_s = time.monotonic()

            def hear() -> None:
                with suppress(BlockingIOError):
                    while True:
                        boat.receive(line.recv(65536))

            def drives() -> bool:
                time_s = time.monotonic() - begun_s
                bus.publish("points", cdr.encode_point_cloud(cloud(time_s)))
                line.send(boat.says(odometry(time_s, north=time_s)))
                hear()
                return bool((boat.thrust > 100.0).all())

            wait_until(drives)
            over.set()
            runtime.join(60.0)
            hear()
    finally:
        over.set()
        runtime.join(60.0)
    assert not boat.thrust.any()  # at rest at the end


def test_the_doctor_opens_its_port_and_hears_it(tmp_path: Path) -> None:
    config = configured(tmp_path)
    assert check_autopilot_port(config).verdict.value == "OK"
    link = make_autopilot(config.autopilot)
    assert [f.verdict.value for f in judge_autopilot(link)] == ["FAIL"]
    link.receive(b"MODE auto\n", 1.0)
    assert [(f.verdict.value, f.found) for f in judge_autopilot(link)] == [("OK", "auto")]


def test_bytes_of_a_damaged_line_change_nothing(tmp_path: Path) -> None:
    link = make_autopilot(configured(tmp_path).autopilot)
    rng = np.random.default_rng(1)
    for k in range(200):
        link.receive(rng.bytes(64) + b"\nAT 1 2\nMODE full\n\xff\n", 0.05 * k)
    assert not link.status.connected
    assert link.take_odometry() == []


def test_a_kind_that_nobody_knows_is_refused_by_name(tmp_path: Path) -> None:
    path = tmp_path / "boat.toml"
    path.write_text('[autopilot]\nkind = "ardupliot"\n')
    with pytest.raises(ConfigError, match=r"kind.*ardupilot"):
        load_config(path)
