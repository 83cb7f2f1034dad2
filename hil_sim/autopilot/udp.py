"""The simulated autopilot on the network, for real time: a thin layer around `RoverAutopilot`."""

from __future__ import annotations

from twinscrew.hil_sim.autopilot.endpoint import RoverAutopilot
from twinscrew.runtime.link.transport import Transport
from twinscrew.runtime.messages.types import Odometry


class AutopilotOnTheNet:
    """One vessel's autopilot and its connections.

    Parameters
    ----------
    autopilot
        What answers.
    transports
        Where, one for each of its ports: the companion first. ArduPilot's simulator calls
        (`udpout`); a boat's runtime listens (`udpin`).
    """

    def __init__(self, autopilot: RoverAutopilot, *transports: Transport) -> None:
        self.autopilot = autopilot
        self.transports = transports

    def step(self, now_s: float, vehicle: Odometry | None) -> None:
        """Take what came, let time pass, send what is due; never waits."""
        companion, *others = self.transports
        self.autopilot.receive(companion.receive(), now_s)
        for port, transport in enumerate(others, start=1):
            self.autopilot.receive(transport.receive(), now_s, port)
        companion.send(self.autopilot.step(now_s, vehicle))
        for port, transport in enumerate(others, start=1):
            transport.send(self.autopilot.outgoing(port))

    def close(self) -> None:
        """Close the connections."""
        for transport in self.transports:
            transport.close()
