"""The two that are held against each other: our simulated autopilot, and a real ArduRover.

Both have two ports, as a boat's autopilot has: the companion's, and a ground station's.
"""

from __future__ import annotations

import socket
import subprocess
import time
from pathlib import Path
from typing import Protocol

from twinscrew.hil_sim.autopilot.endpoint import RoverAutopilot, RoverAutopilotSettings
from twinscrew.hil_sim.autopilot.rover import Rover, RoverSettings
from twinscrew.hil_sim.autopilot.udp import AutopilotOnTheNet
from twinscrew.hil_sim.bridges.ardupilot_process import Instance
from twinscrew.runtime.errors import LinkError
from twinscrew.runtime.link.transport import Transport, UdpTransport, open_transport

STEP_S = 0.02
SYSTEM = 1
GROUND_PORT = 5762
"""TCP port of an instance's second serial port, instance 0."""
START_S = 60.0
"""[s] How long a real one may take to listen."""


class Endpoint(Protocol):
    """An autopilot that can be spoken to; time passes by waiting."""

    companion: Transport
    ground: Transport

    @property
    def now_s(self) -> float:
        """[s] The autopilot's time."""

    def wait(self) -> None:
        """Let a little time pass."""

    def close(self) -> None:
        """Stop it."""


class Ours:
    """Our simulated autopilot behind two UDP sockets, in simulated time."""

    def __init__(self) -> None:
        rover = RoverSettings(arming_delay_s=5.0, calibrated=False)
        lines = [UdpTransport("127.0.0.1", 0, listens=True) for _ in range(2)]
        autopilot = RoverAutopilot(RoverAutopilotSettings(rover=rover), SYSTEM, ports=2)
        self._net = AutopilotOnTheNet(autopilot, *lines)
        self.companion, self.ground = (
            open_transport(f"udpout:127.0.0.1:{line.port}") for line in lines
        )
        self.now_s = 0.0

    @property
    def rover(self) -> Rover:
        """What is behind the sockets."""
        return self._net.autopilot.rover

    def wait(self) -> None:
        """Let 20 ms of its time pass; they take none of ours."""
        self.now_s += STEP_S
        self._net.step(self.now_s, None)

    def close(self) -> None:
        """Close the sockets."""
        self.companion.close()
        self.ground.close()
        self._net.close()


class Real:
    """A real ArduRover in its own simulator, started here with what `sitl` gives it, in real time.

    Raises
    ------
    LinkError
        It does not listen; its words are in the folder's log.
    """

    def __init__(self, binary: Path, folder: Path) -> None:
        instance = Instance(free_instance(), SYSTEM, folder)
        instance.write_parameters()
        words = instance.command(str(binary.resolve()))
        words[words.index("--model") + 1] = "rover-skid"  # its own physics
        self._log = folder / "log.txt"
        with self._log.open("wb") as log:
            self._process = subprocess.Popen(
                words, cwd=folder, stdin=subprocess.DEVNULL, stdout=log, stderr=log
            )
        try:
            self.companion = self._open(instance.connection)
            self.ground = self._open(f"tcp:127.0.0.1:{GROUND_PORT + 10 * instance.number}")
        except LinkError:
            self._process.kill()
            self._process.wait()
            raise

    @property
    def now_s(self) -> float:
        """[s] Real time."""
        return time.monotonic()

    def wait(self) -> None:
        """Let 20 ms pass."""
        time.sleep(STEP_S)

    def close(self) -> None:
        """Stop it."""
        self.companion.close()
        self.ground.close()
        self._process.terminate()
        self._process.wait()

    def _open(self, connection: str) -> Transport:
        until_s = time.monotonic() + START_S
        while True:
            try:
                return open_transport(connection)
            except LinkError as error:
                if self._process.poll() is not None or time.monotonic() > until_s:
                    words = self._log.read_text(errors="replace")[-400:].strip()
                    raise LinkError(f"{connection}: {error}: {words}") from error
            time.sleep(0.1)


def free_instance() -> int:
    """Give an instance number whose ports nobody uses."""
    for number in range(20, 200, 10):
        if all(_is_free(port + 10 * number) for port in (5760, 5762, 5763)):
            return number
    raise LinkError("all of ArduPilot's ports are in use")


def _is_free(port: int) -> bool:
    with socket.socket(socket.AF_INET, socket.SOCK_STREAM) as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind(("127.0.0.1", port))
        except OSError:
            return False
        return True
