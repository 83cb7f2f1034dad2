"""The simulated autopilot on a UDP port, for real time: a thin layer around `RoverAutopilot`."""

from __future__ import annotations

from typing import Protocol

from twinscrew.runtime.link.transport import Transport
from twinscrew.runtime.messages.types import Float64, Odometry


class Autopilot(Protocol):
    """What answers on the net: `RoverAutopilot`, or who stands for one elsewhere."""

    def receive(self, data: bytes, now_s: float) -> None:
        """Take bytes from the network."""

    def step(self, now_s: float, vehicle: Odometry | None = None) -> bytes:
        """Let time pass, and give what it sends."""

    def thrust_command_N(self) -> Float64:
        """Give the thrust, (2,) [N] left and right, that the outputs ask of the propellers."""


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

    def __init__(self, autopilot: Autopilot, transport: Transport) -> None:
        self.autopilot = autopilot
        self.transport = transport

    def step(self, now_s: float, vehicle: Odometry | None) -> None:
        """Take what came, let time pass, send what is due; never waits."""
        self.autopilot.receive(self.transport.receive(), now_s)
        self.transport.send(self.autopilot.step(now_s, vehicle))

    def close(self) -> None:
        """Close the connection."""
        self.transport.close()
