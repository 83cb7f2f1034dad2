"""The autopilots of all vessels, as the real-time driver sees them: ours, or real ones."""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import Protocol

import numpy as np

from twinscrew.hil_sim.autopilot.endpoint import RoverAutopilot, RoverAutopilotSettings
from twinscrew.hil_sim.autopilot.udp import AutopilotOnTheNet
from twinscrew.hil_sim.drivers.ports import LOOPBACK
from twinscrew.runtime.link.sockets import UdpTransport
from twinscrew.runtime.link.transport import open_transport
from twinscrew.runtime.messages.types import Float64, Odometry


class Fleet(Protocol):
    """One autopilot a vessel, all on their own feet: they speak MAVLink with the runtimes."""

    patience_s: float
    """[s] How much longer than usual the runtimes may wait for them at the start."""

    def connection(self, vessel: int) -> str:
        """Give the connection string of a vessel's autopilot, for its runtime."""

    def exchange(self, vessel: int, now_s: float, odometry: Odometry) -> None:
        """Let an autopilot take in what came and send what is due."""

    def thrust_N(self) -> Float64:
        """Give what the autopilots ask of the propellers, (V, 2) [N]."""

    def wait(self, until_s: float) -> None:
        """Pass the time until the clock, `time.monotonic`, says `until_s` [s]."""

    def check(self) -> None:
        """Raise a `LinkError` if an autopilot has died."""

    def close(self) -> None:
        """Stop them all."""


class Autopilot(Protocol):
    """What asks something of the propellers."""

    def thrust_command_N(self) -> Float64:
        """Give the thrust, (2,) [N] left and right, that the outputs ask of the propellers."""


class OnTheNet(Protocol):
    """An autopilot with its connection, as `AutopilotOnTheNet`."""

    @property
    def autopilot(self) -> Autopilot:
        """Whose connection it is."""

    def step(self, now_s: float, vehicle: Odometry | None) -> None:
        """Take what came, let time pass, send what is due; never waits."""

    def close(self) -> None:
        """Close the connection."""


class SimulatedFleet:
    """Our simulated autopilots, each on a UDP port of its own."""

    patience_s = 0.0

    def __init__(self, pilots: Sequence[OnTheNet], ports: Sequence[int]) -> None:
        """Take autopilots, and the ports on which they listen."""
        self._pilots = pilots
        self._ports = ports

    def connection(self, vessel: int) -> str:
        """See `Fleet`."""
        return f"udpout:{LOOPBACK}:{self._ports[vessel]}"

    def exchange(self, vessel: int, now_s: float, odometry: Odometry) -> None:
        """See `Fleet`."""
        self._pilots[vessel].step(now_s, odometry)

    def thrust_N(self) -> Float64:
        """See `Fleet`."""
        return np.array([pilot.autopilot.thrust_command_N() for pilot in self._pilots])

    def wait(self, until_s: float) -> None:
        """See `Fleet`."""
        time.sleep(max(0.0, until_s - time.monotonic()))

    def check(self) -> None:
        """Nothing can have died but this process."""

    def close(self) -> None:
        """See `Fleet`."""
        for pilot in self._pilots:
            pilot.close()


def simulated_fleet(
    system_ids: Sequence[int], settings: RoverAutopilotSettings | None = None, ground: str = ""
) -> SimulatedFleet:
    """Make autopilots of these system ids in this process.

    Parameters
    ----------
    ground
        HOST:PORT where a ground station listens. They call it on a second port, and hand messages
        on between it and the companions. Empty: there is none.

    Raises
    ------
    LinkError
        There is no such place to call.
    """
    settings = settings or RoverAutopilotSettings()
    lines = [[open_transport(f"udpout:{ground}")] if ground else [] for _ in system_ids]
    transports = [UdpTransport(LOOPBACK, 0, listens=True) for _ in system_ids]
    pilots = [
        AutopilotOnTheNet(
            RoverAutopilot(settings, system_id, ports=1 + len(line)), transport, *line
        )
        for system_id, transport, line in zip(system_ids, transports, lines, strict=True)
    ]
    return SimulatedFleet(pilots, [transport.port for transport in transports])
