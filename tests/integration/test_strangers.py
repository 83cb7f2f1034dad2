"""`twinscrew run` on a UDP port to which a stranger sends as well, and before the autopilot."""

import socket
import time
from pathlib import Path

import pytest
from tests.harness.commands import running, stop
from tests.harness.waiting import wait_until

from twinscrew.hil_sim.autopilot.endpoint import RoverAutopilot, RoverAutopilotSettings
from twinscrew.hil_sim.drivers.processes import free_port
from twinscrew.runtime.vessel import consent

pytestmark = pytest.mark.slow

HOST = "127.0.0.1"
STRANGER = (b"12345", b"\xfd" * 5)


@pytest.mark.parametrize("signed", [True, False], ids=["signed", "unsigned"])
def test_a_stranger_who_spoke_first_does_not_shut_the_autopilot_out(
    tmp_path: Path, signed: bool
) -> None:
    key = tmp_path / "key"
    key.write_bytes(bytes(range(32)))
    key.chmod(0o600)
    key_file = str(key) if signed else ""
    port, log = free_port(), tmp_path / "log.txt"
    config = tmp_path / "boat.toml"
    config.write_text(
        f'[autopilot]\nconnection = "udpin:{HOST}:{port}"\narm = true\nreceiver_fitted = false\n'
        f'signing_key_file = "{key_file}"\n[bus]\nconnect = []\n'
    )
    consent.give(consent.place_of(config, ""))
    rover = RoverAutopilot(
        RoverAutopilotSettings(signing_key_file=key_file), 1, boot_s=time.monotonic()
    )
    with (
        running("run", "--config", config, log=log) as runtime,
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as stranger,
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as autopilot,
    ):
        wait_until(lambda: "wamv: running" in log.read_text())
        for line in (stranger, autopilot):
            line.connect((HOST, port))
            line.setblocking(False)
        for _ in range(20):  # a second of the stranger alone
            stranger.send(STRANGER[0])
            time.sleep(0.05)

        def armed() -> bool:
            stranger.send(STRANGER[1])
            autopilot.send(rover.step(time.monotonic()))
            try:
                rover.receive(autopilot.recv(65_536), time.monotonic())
            except BlockingIOError:
                return False
            return bool(rover.rover.armed)

        wait_until(armed)
        with pytest.raises(BlockingIOError):
            stranger.recv(65_536)
        assert stop(runtime) == 0
