"""The simulated autopilot on a UDP port, for real time: a thin layer around `RoverAutopilot`."""

from __future__ import annotations

from twinscrew.hil_sim.autopilot.endpoint import RoverAutopilot
from twinscrew.runtime.link.transport import Transport
from twinscrew.runtime.messages.types import Odometry


class AutopilotOnTheNet:
    """One vessel's autopilot and its connection.

    Parameters
    ----------
    autopilot
        What answers.
    transport
        Where: ArduPilot's simulator calls (`udpout`), and so does ours by default; a boat's
        runtime listens (`udpin`).
    """

    def __init__(self, autopilot: RoverAutopilot, transport: Transport) -> None:
        self.autopilot = autopilot
        self.transport = transport

    def step(self, now_s: float, vehicle: Odometry | None) -> None:
        """Take what came, let time pass, send what is due; never waits."""
        self.autopilot.receive(self.transport.receive(), now_s)
        self.transport.send(self.autopilot.step(now_s, vehicle))

    def close(self) -> None:
        """Close the connection."""
        self.transport.close()
