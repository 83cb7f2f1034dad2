"""Who may arm: `twinscrew run` with `arm = true`, started by a person and by a supervisor."""

import socket
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from tests.harness.commands import running, twinscrew
from tests.harness.waiting import wait_until

from twinscrew.hil_sim.autopilot.endpoint import RoverAutopilot, RoverAutopilotSettings
from twinscrew.hil_sim.drivers.processes import free_port

HOST = "127.0.0.1"
LONG_ENOUGH_S = 3.0
"""[s] Asked once a second, it would be armed."""


class Boat:
    """A simulated autopilot on a socket, and the file of its runtime."""

    def __init__(self, folder: Path) -> None:
        port = free_port()
        self.config = folder / "boat.toml"
        self.config.write_text(
            f'[autopilot]\nconnection = "udpin:{HOST}:{port}"\narm = true\n'
            "receiver_fitted = false\n[bus]\nconnect = []\n"
        )
        self.autopilot = RoverAutopilot(RoverAutopilotSettings(), 1, boot_s=time.monotonic())
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.connect((HOST, port))
        self.socket.setblocking(False)

    def armed(self) -> bool:
        """Let the two talk for a moment; tell whether the autopilot is armed."""
        now_s = time.monotonic()
        try:
            self.socket.send(self.autopilot.step(now_s))
            while True:
                self.autopilot.receive(self.socket.recv(65_536), now_s)
        except (BlockingIOError, ConnectionRefusedError):
            pass  # nothing there; or nobody listens yet
        return self.autopilot.rover.armed

    def stays_disarmed(self) -> bool:
        """Let them talk for longer than arming takes."""
        until_s = time.monotonic() + LONG_ENOUGH_S
        while time.monotonic() < until_s:
            if self.armed():
                return False
            time.sleep(0.02)
        return True


@pytest.fixture
def boat(tmp_path: Path) -> Iterator[Boat]:
    afloat = Boat(tmp_path)
    yield afloat
    afloat.socket.close()


def test_a_supervisors_restart_does_not_arm_a_boat_that_a_pilot_disarmed(boat, tmp_path) -> None:
    assert twinscrew("consent", "--config", boat.config).returncode == 0
    log = tmp_path / "log.txt"
    with running("run", "--config", boat.config, log=log) as runtime:
        wait_until(boat.armed)
        boat.autopilot.rover.disarm()  # the pilot
        runtime.kill()
        runtime.wait()
    with running("run", "--config", boat.config, log=log):
        wait_until(lambda: "asks for no arming: nobody has given consent" in log.read_text())
        wait_until(lambda: "wamv: running" in log.read_text().rpartition("asks for no arming")[2])
        assert boat.stays_disarmed()
    assert twinscrew("consent", "--config", boat.config).returncode == 0
    with running("run", "--config", boat.config, log=log):
        wait_until(boat.armed)


def test_consent_to_a_configuration_that_arms_nothing_is_refused(tmp_path) -> None:
    config = tmp_path / "boat.toml"
    config.write_text("[autopilot]\narm = false\n")
    done = twinscrew("consent", "--config", config)
    assert done.returncode == 2
    assert "autopilot.arm" in done.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["boat.toml"]
