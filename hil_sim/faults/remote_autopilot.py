"""A simulated autopilot in a process of its own, so that it can be killed.

The simulator keeps the MAVLink port, as a radio or a serial line would: what comes is handed to the
process with the vessel's state, and its answer is sent. A dead one answers nothing.
"""

from __future__ import annotations

import contextlib
import os
import signal
import socket
import subprocess
import sys

import msgspec
import numpy as np
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from twinscrew.hil_sim.autopilot.endpoint import RoverAutopilot, RoverAutopilotSettings
from twinscrew.hil_sim.drivers.processes import be_punctual, is_punctual, ordinary
from twinscrew.hil_sim.faults.pilot import Bridge, act, bridge_of
from twinscrew.runtime.mavlink import Wire
from twinscrew.runtime.messages import cdr
from twinscrew.runtime.messages.types import Float64, Odometry

SIGNAL_LOST_S = 0.1
"""[s] A propeller whose input has no pulse for this long stops."""
PUNCTUAL = "punctual"
"""The word that asks for real-time priority."""
STATION_ID = 255
"""[-] The system id of a ground station."""
_LARGEST = 1 << 18


class Asked(msgspec.Struct, frozen=True, array_like=True):
    """What the simulator says."""

    now_s: float
    mavlink: bytes
    vehicle: bytes
    """nav_msgs/Odometry in CDR; empty if it is not known."""
    pilot: tuple[str, ...]
    """What a pilot did since the last time."""
    parameters: tuple[tuple[str, float], ...]
    """Parameters that were set since then."""


class Answered(msgspec.Struct, frozen=True, array_like=True):
    """What the autopilot says."""

    mavlink: bytes
    thrust_N: tuple[float, float]
    bridge: Bridge


class RemoteAutopilot:
    """Stands for an autopilot in another process, with the face of `RoverAutopilot`."""

    def __init__(self, system_id: int) -> None:
        self._system_id = system_id
        self._heard: list[bytes] = []
        self._acts: list[str] = []
        self._parameters: list[tuple[str, float]] = []
        self._answer = Answered(b"", (0.0, 0.0), Bridge("", armed=False))
        self._answered_s = 0.0
        self._now_s = 0.0
        self._station = Wire(STATION_ID, mavlink.MAV_COMP_ID_MISSIONPLANNER)
        self._station_speaks, self._station_s = True, 0.0
        self.start()

    @property
    def bridge(self) -> Bridge:
        """Mode and arming, as of the last answer."""
        return self._answer.bridge

    def start(self) -> None:
        """Switch it on."""
        self._socket, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        self._socket.setblocking(False)
        words = [sys.executable, "-m", __name__, str(theirs.fileno()), str(self._system_id)]
        words += [PUNCTUAL] if is_punctual() else []
        with ordinary():
            self._process = subprocess.Popen(words, pass_fds=(theirs.fileno(),))
        theirs.close()

    def kill(self) -> None:
        """Kill it as hard as can be."""
        self._process.kill()
        self._process.wait()
        self._socket.close()

    def signal(self, number: signal.Signals) -> None:
        """Send the process a signal."""
        os.kill(self._process.pid, number)

    def act(self, does: str) -> None:
        """Let a pilot do something."""
        self._acts.append(does)

    def request_streams(self, rate_hz: float) -> None:
        """Ask for all of its streams at a rate, as a ground station does."""
        message = mavlink.MAVLink_request_data_stream_message(
            self._system_id, mavlink.MAV_COMP_ID_AUTOPILOT1, 0, round(rate_hz), 1
        )
        self._heard.append(Wire(STATION_ID, mavlink.MAV_COMP_ID_MISSIONPLANNER).encode(message))

    def set_parameter(self, name: str, value: float) -> None:
        """Set a parameter."""
        self._parameters.append((name, value))

    def receive(self, data: bytes, now_s: float) -> None:  # noqa: ARG002
        """See `RoverAutopilot`."""
        self._heard.append(data)

    def step(self, now_s: float, vehicle: Odometry | None = None) -> bytes:
        """See `RoverAutopilot`; the answer is the last step's."""
        self._now_s = now_s
        station = self._heartbeat_of_the_station(now_s)
        seen = b"" if vehicle is None else cdr.encode_odometry(vehicle)
        asked = Asked(
            now_s, b"".join(self._heard), seen, tuple(self._acts), tuple(self._parameters)
        )
        self._heard = []
        with contextlib.suppress(OSError):  # it is dead, or too slow to take more
            self._socket.send(msgspec.msgpack.encode(asked))
            self._acts, self._parameters = [], []  # else a pilot tries again
        said = b""
        with contextlib.suppress(OSError):
            while data := self._socket.recv(_LARGEST):
                self._answer = msgspec.msgpack.decode(data, type=Answered)
                self._answered_s = now_s
                said += self._answer.mavlink
        return said + station

    def let_station_speak(self, speaks: bool) -> None:
        """Let the ground station be heard by way of the autopilot, or not any more."""
        self._station_speaks = speaks

    def _heartbeat_of_the_station(self, now_s: float) -> bytes:
        if not self._station_speaks or now_s - self._station_s < 1.0:
            return b""
        self._station_s = now_s
        beat = (mavlink.MAV_TYPE_GCS, mavlink.MAV_AUTOPILOT_INVALID, 0, 0, 4, 3)
        return self._station.encode(mavlink.MAVLink_heartbeat_message(*beat))

    def thrust_command_N(self) -> Float64:
        """See `RoverAutopilot`; without a pulse the propellers stop."""
        lost = self._now_s - self._answered_s > SIGNAL_LOST_S
        return np.zeros(2) if lost else np.array(self._answer.thrust_N)

    def close(self) -> None:
        """Switch it off."""
        self.kill()


def main() -> None:
    """Be the other process, until the simulator is gone."""
    if PUNCTUAL in sys.argv:
        be_punctual()
    # A terminal's Ctrl-C is for the simulator, whose end is the end of the line.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    line = socket.socket(fileno=int(sys.argv[1]))
    autopilot: RoverAutopilot | None = None
    while data := line.recv(_LARGEST):
        asked = msgspec.msgpack.decode(data, type=Asked)
        if autopilot is None:
            settings = RoverAutopilotSettings()
            autopilot = RoverAutopilot(settings, int(sys.argv[2]), boot_s=asked.now_s)
        answer = _answer(autopilot, asked)
        try:
            line.send(msgspec.msgpack.encode(answer))
        except OSError:
            return


def _answer(autopilot: RoverAutopilot, asked: Asked) -> Answered:
    for does in asked.pilot:
        act(autopilot, does)
    for name, value in asked.parameters:
        autopilot.rover.parameters.set(name, value)
    autopilot.receive(asked.mavlink, asked.now_s)
    vehicle = cdr.decode_odometry(asked.vehicle) if asked.vehicle else None
    said = autopilot.step(asked.now_s, vehicle)
    left, right = autopilot.thrust_command_N()
    return Answered(said, (float(left), float(right)), bridge_of(autopilot))


if __name__ == "__main__":
    main()
