"""What ground stations say to the companion, and what they are answered.

Their messages come through the autopilot, which hands on what is addressed to our component.
Sans-IO like the link: messages and the time go in; replies, orders and plain words come out.
"""

from __future__ import annotations

import math

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from twinscrew.runtime.link.datum import Datum
from twinscrew.runtime.link.mission_server import MissionServer, Station
from twinscrew.runtime.link.orders import Order, OrderSettings
from twinscrew.runtime.link.places import Chart
from twinscrew.runtime.link.station_commands import (
    ACCEPTED,
    DENIED,
    FAILED,
    UNSUPPORTED,
    StationCommands,
    position_target,
)
from twinscrew.runtime.link.wire import Message

EVERYBODY = 0
"""Target component that means all of a system's."""
TARGETS = ("SET_POSITION_TARGET_LOCAL_NED", "SET_POSITION_TARGET_GLOBAL_INT")
COMMANDS = ("COMMAND_LONG", "COMMAND_INT")
COMPLAIN_S = 5.0
"""[s] A system that is not permitted is named once in this time."""
CURRENT_S = 1.0
"""[s] Between two MISSION_CURRENT while there is a mission."""
_MOST = 256
"""[-] Replies and orders kept until somebody takes them: a flood must not fill the memory."""


class Stations:
    """All ground stations together.

    Parameters
    ----------
    settings, datum
        Whose orders count, and where the frame of the goals lies on the earth.
    us
        System and component that we speak as.
    """

    def __init__(self, settings: OrderSettings, datum: Datum | None, us: Station) -> None:
        self._settings = settings
        self._us = us
        self._chart = Chart(datum, settings.reach_m)
        self.server = MissionServer(settings, self._chart, self._permits)
        self._commands = StationCommands(self.server, self._chart)
        self._complained_s: dict[int, float] = {}
        self._told_s = -math.inf
        self._now_s = -math.inf

    def take(self, message: Message, now_s: float) -> None:
        """Take a message from anybody but the autopilot; most are not for us."""
        station = (message.get_srcSystem(), message.get_srcComponent())
        component = self._addressed(message)
        if component is None or station == self._us or self._is_full:
            return
        self._now_s = now_s
        kind = message.get_type()
        if kind in TARGETS:
            self._on_target(message)
        elif kind in COMMANDS:
            self._on_command(message, station, exact=component != EVERYBODY)
        elif component != EVERYBODY:  # a mission for everybody is the autopilot's
            self.server.take(message, station, now_s)

    def due(self, now_s: float) -> list[Message]:
        """Give what is to be sent now."""
        server = self.server
        server.tick(now_s)
        replies, server.replies = server.replies, []
        if server.mission.items and now_s - self._told_s >= CURRENT_S:
            self._told_s = now_s
            replies.append(server.mission.told())
        return replies

    def orders(self) -> list[Order]:
        """Give what was ordered since the last call."""
        orders, self.server.orders = self.server.orders, []
        return orders

    def complaints(self) -> list[str]:
        """Give in plain words what was refused since the last call."""
        complaints, self.server.complaints = self.server.complaints, []
        return complaints

    @property
    def _is_full(self) -> bool:
        server = self.server
        return max(len(server.replies), len(server.orders), len(server.complaints)) >= _MOST

    def _addressed(self, message: Message) -> int | None:
        """Give the component that is meant, if it is ours or everybody; None if we are not."""
        if getattr(message, "target_system", None) != self._us[0]:
            return None
        component = getattr(message, "target_component", None)
        return component if component in (EVERYBODY, self._us[1]) else None

    def _permits(self, system: int) -> bool:
        """Whether a system's orders count; one whose do not is named."""
        if system in self._settings.permitted:
            return True
        if self._now_s - self._complained_s.get(system, -math.inf) >= COMPLAIN_S:
            self._complained_s[system] = self._now_s
            words = f"order refused: system {system} is not in ground.orders.permitted"
            self.server.complaints.append(words)
        return False

    def _on_target(self, message: Message) -> None:
        if not self._permits(message.get_srcSystem()):
            return
        order = position_target(message, self._chart)
        if isinstance(order, str):
            self.server.complaints.append(order)
        else:
            self.server.orders.append(order)

    def _on_command(self, message: Message, station: Station, *, exact: bool) -> None:
        command = message.command
        if command == mavlink.MAV_CMD_REQUEST_MESSAGE and exact:
            result = self._tell(message.param1)
        elif self._commands.knows(command):
            permitted = self._permits(station[0])
            result = self._commands.execute(message) if permitted else DENIED
        elif exact:
            result = UNSUPPORTED
        else:
            return  # for everybody, and nothing that we know: the autopilot answers
        ack = mavlink.MAVLink_command_ack_message(command, result, 0, 0, *station)
        self.server.replies.append(ack)

    def _tell(self, message_id: float) -> int:
        if message_id == mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION:
            self.server.replies.append(_version())
        elif message_id == mavlink.MAVLINK_MSG_ID_MISSION_CURRENT:
            self.server.replies.append(self.server.mission.told())
        else:
            return FAILED
        return ACCEPTED


def _version() -> Message:
    """Tell what we can do; our version is not an autopilot's, and is left out."""
    capabilities = (
        mavlink.MAV_PROTOCOL_CAPABILITY_MISSION_INT
        | mavlink.MAV_PROTOCOL_CAPABILITY_COMMAND_INT
        | mavlink.MAV_PROTOCOL_CAPABILITY_SET_POSITION_TARGET_LOCAL_NED
        | mavlink.MAV_PROTOCOL_CAPABILITY_SET_POSITION_TARGET_GLOBAL_INT
        | mavlink.MAV_PROTOCOL_CAPABILITY_MAVLINK2
    )
    none = [0] * 8
    return mavlink.MAVLink_autopilot_version_message(
        capabilities, 0, 0, 0, 0, none, none, none, 0, 0, 0
    )
