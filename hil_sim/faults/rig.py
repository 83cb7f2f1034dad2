"""Everything of one vessel at which faults are made."""

from __future__ import annotations

import math
from collections.abc import Callable
from contextlib import suppress

import numpy as np

from twinscrew.hil_sim.drivers.processes import LOOPBACK
from twinscrew.hil_sim.drivers.realtime import SimulatedFleet
from twinscrew.hil_sim.faults.line import Line
from twinscrew.hil_sim.faults.mavlink_line import FaultyTransport
from twinscrew.hil_sim.faults.pilot import Bridge
from twinscrew.hil_sim.faults.proxy import Proxy
from twinscrew.hil_sim.faults.remote_autopilot import RemoteAutopilot
from twinscrew.runtime.bus.base import Received
from twinscrew.runtime.errors import ConfigError, MessageError
from twinscrew.runtime.link.transport import Transport, UdpTransport
from twinscrew.runtime.messages import cdr
from twinscrew.runtime.messages.types import Float64, Odometry

SENSORS = ("points", "odometry", "gps", "imu")
TOPICS = (*SENSORS, "nmea", "radar", "goal", "enable")


class Berth:
    """An autopilot in another process, with its connection."""

    def __init__(self, autopilot: RemoteAutopilot, transport: Transport) -> None:
        self.autopilot = autopilot
        self._transport = transport

    def step(self, now_s: float, vehicle: Odometry | None) -> None:
        """Take what came, let time pass, send what is due; never waits."""
        self.autopilot.receive(self._transport.receive(), now_s)
        self._transport.send(self.autopilot.step(now_s, vehicle))

    def close(self) -> None:
        """Close the connection, and switch the autopilot off."""
        self._transport.close()
        self.autopilot.close()


class Thrusters:
    """Takes newtons by topic, as VRX: those that came last act for ever."""

    bridge = Bridge("thrust", armed=True)

    def __init__(self) -> None:
        self._thrust_N = np.zeros(2)

    def thrust_command_N(self) -> Float64:
        """Give the thrust, (2,) [N] left and right, that came last."""
        return self._thrust_N.copy()

    def take(self, side: int, message: Received) -> None:
        """Take one, in Zenoh's thread."""
        with suppress(MessageError):
            self._thrust_N[side] = cdr.decode_thrust(message.payload)

    def step(self, now_s: float, vehicle: Odometry | None) -> None:
        """See `Berth`; they have no time of their own."""

    def close(self) -> None:
        """See `Berth`."""

    @property
    def autopilot(self) -> Thrusters:
        """See `Berth`."""
        return self


class Rig:
    """One vessel's lines, what turns its propellers, and the connection of its runtime."""

    def __init__(
        self,
        vessel: int,
        system_id: int,
        clock: Callable[[], float],
        push: Callable[[tuple[float, float]], None] = lambda _force_N: None,
        *,
        by_topic: bool = False,
    ) -> None:
        """Start its autopilot, on a port of its own.

        `clock` is that of the lines' delays; `push` lets a force act on the vessel, north and east.
        `by_topic`: it has no autopilot, but thrusters that take newtons by topic.
        """
        self.vessel = vessel
        self.push = push
        self.system_id = system_id
        self.lines = {name: Line() for name in (*TOPICS, "to_autopilot", "from_autopilot")}
        """By topic, and by direction of MAVLink."""
        self.goal = b""
        """The goal that it was given."""
        self._proxy: Proxy | None = None
        self.thrusters: Thrusters | None = None
        self.enable_s = -math.inf
        """[s] When the operator said last that thrusters may be driven."""
        if by_topic:
            self.net: Berth | Thrusters = Thrusters()
            self.thrusters = self.net
            self.port = 0
            return
        self._autopilot = RemoteAutopilot(system_id)
        socket = UdpTransport(LOOPBACK, 0, listens=True)
        transport = FaultyTransport(
            socket, self.lines["to_autopilot"], self.lines["from_autopilot"], clock
        )
        self.port = socket.port
        self.net = Berth(self._autopilot, transport)

    @property
    def autopilot(self) -> RemoteAutopilot:
        """Its autopilot."""
        if self.thrusters is not None:
            raise ConfigError("of thrusters by topic there is no autopilot", key="fault.target")
        return self._autopilot

    def reroute(self, port: int) -> int:
        """Stand between the runtime and the simulator's port; give the port to connect to."""
        self._proxy = Proxy(port)
        return self._proxy.port

    @property
    def proxy(self) -> Proxy:
        """Who stands between runtime and simulator."""
        assert self._proxy is not None, "the crew reroutes before it sails"  # noqa: S101
        return self._proxy

    def lines_of(self, target: str) -> list[Line]:
        """Give the lines that a target means."""
        names = {
            "sensors": SENSORS,
            "mavlink": ("to_autopilot", "from_autopilot"),
        }.get(target, (target,))
        return [self.lines[name] for name in names]

    def close(self) -> None:
        """Stop what stands between; the autopilot is closed with its fleet."""
        if self._proxy is not None:
            self._proxy.close()


def fleet_of(rigs: list[Rig]) -> SimulatedFleet:
    """Make the fleet of the vessels' autopilots."""
    return SimulatedFleet([rig.net for rig in rigs], [rig.port for rig in rigs])
