"""Ground stations: their commands, and the answers to them."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import TypeAlias

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from twinscrew.runtime.charts.static_map import StaticMap
from twinscrew.runtime.datum import Datum
from twinscrew.runtime.ground.missions import MissionServer, Station
from twinscrew.runtime.ground.orders import (
    BAD_FRAME,
    DEGREES_PER_UNIT,
    LOCAL,
    METRES_PER_UNIT,
    ON_EARTH,
    TOO_FAR,
    Fault,
    GoalFrames,
    GoTo,
    Order,
    OrderSettings,
    Pause,
    Relative,
)
from twinscrew.runtime.mavlink import Message

# -- Goals that need no mission: SET_POSITION_TARGET_* and the commands to go, start, pause.


ACCEPTED = int(mavlink.MAV_RESULT_ACCEPTED)
DENIED = int(mavlink.MAV_RESULT_DENIED)
FAILED = int(mavlink.MAV_RESULT_FAILED)
UNSUPPORTED = int(mavlink.MAV_RESULT_UNSUPPORTED)

NO_POSITION = mavlink.POSITION_TARGET_TYPEMASK_X_IGNORE | mavlink.POSITION_TARGET_TYPEMASK_Y_IGNORE
RELATIVE = {
    mavlink.MAV_FRAME_LOCAL_NED: Relative.ORIGIN,
    mavlink.MAV_FRAME_LOCAL_OFFSET_NED: Relative.VESSEL,
    mavlink.MAV_FRAME_BODY_NED: Relative.BOW,
    mavlink.MAV_FRAME_BODY_OFFSET_NED: Relative.BOW,
    mavlink.MAV_FRAME_BODY_FRD: Relative.BOW,
}
"""Frames of SET_POSITION_TARGET_LOCAL_NED, as ArduPilot takes them: both BODY frames begin at the
vessel."""
GREATEST_RELATIVE_M = 1000.0
"""[m] Farther than this from the vessel is a mistake."""

Refusal: TypeAlias = str
"""Plain words."""


def position_target(message: Message, frames: GoalFrames) -> GoTo | Refusal:
    """Read SET_POSITION_TARGET_LOCAL_NED or _GLOBAL_INT: its position is a goal, all else is not.

    Velocities and accelerations are the policy's to choose: a message that has no position is
    refused.
    """
    if message.type_mask & NO_POSITION:
        return "goal refused: a target needs a position; velocities are not taken"
    station = message.get_srcSystem()
    if message.get_type() == "SET_POSITION_TARGET_GLOBAL_INT":
        if message.coordinate_frame not in ON_EARTH:
            return f"goal refused: {BAD_FRAME.words}"
        x, y = message.lat_int * DEGREES_PER_UNIT, message.lon_int * DEGREES_PER_UNIT
        return _go(station, frames, message.coordinate_frame, x, y)
    relative = RELATIVE.get(message.coordinate_frame)
    if relative is None:
        return f"goal refused: {BAD_FRAME.words}"
    if relative is Relative.ORIGIN:
        return _go(station, frames, LOCAL, message.x, message.y)
    if not math.hypot(message.x, message.y) <= GREATEST_RELATIVE_M:
        return f"goal refused: {TOO_FAR.words}"
    return GoTo(station, message.x, message.y, relative)


def _go(station: int, frames: GoalFrames, frame: int, x: float, y: float) -> GoTo | Refusal:
    place = frames.place(frame, x, y)
    if isinstance(place, Fault):
        return f"goal refused: {place.words}"
    north, east = place.tolist()
    return GoTo(station, north, east)


class StationCommands:
    """Carries out COMMAND_LONG and COMMAND_INT; orders and complaints go where missions' do."""

    def __init__(self, server: MissionServer, frames: GoalFrames) -> None:
        self._server = server
        self._frames = frames
        self._handlers: dict[int, Callable[[Message], int]] = {
            mavlink.MAV_CMD_DO_REPOSITION: self._reposition,
            mavlink.MAV_CMD_NAV_LOITER_UNLIM: self._hold_here,
            mavlink.MAV_CMD_MISSION_START: self._start,
            mavlink.MAV_CMD_DO_SET_MISSION_CURRENT: self._start,
            mavlink.MAV_CMD_DO_PAUSE_CONTINUE: self._pause,
        }

    def knows(self, command: int) -> bool:
        """Tell whether this is one of ours."""
        return command in self._handlers

    def execute(self, message: Message) -> int:
        """Carry out a command that is known; gives its MAV_RESULT."""
        return self._handlers[message.command](message)

    def _reposition(self, message: Message) -> int:
        if message.param1 > 0.0:
            self._server.complaints.append("goal refused: the speed is not a station's to choose")
            return DENIED
        if message.get_type() == "COMMAND_INT":
            frame = message.frame
            unit = METRES_PER_UNIT if frame == LOCAL else DEGREES_PER_UNIT
            x, y = message.x * unit, message.y * unit
        else:
            frame, x, y = int(mavlink.MAV_FRAME_GLOBAL), message.param5, message.param6
        order = _go(message.get_srcSystem(), self._frames, frame, x, y)
        if isinstance(order, str):
            self._server.complaints.append(order)
            return DENIED
        yaw = message.param4
        if math.isfinite(yaw) and yaw != 0.0:  # a yaw of 0 is what stations send that mean none
            if abs(yaw) > 2.0 * math.pi + 1e-3:
                self._server.complaints.append("goal refused: the yaw is in radians, up to 2 pi")
                return DENIED
            order = replace(order, holds=True, heading=yaw)
        self._server.orders.append(order)
        return ACCEPTED

    def _hold_here(self, message: Message) -> int:
        """Stay where the vessel is: what ArduPilot's LOITER mode does."""
        station = message.get_srcSystem()
        self._server.orders.append(GoTo(station, 0.0, 0.0, Relative.VESSEL, holds=True))
        return ACCEPTED

    def _start(self, message: Message) -> int:
        seq = int(message.param1) if math.isfinite(message.param1) else 0
        if self._server.start(message.get_srcSystem(), max(0, seq)):
            return ACCEPTED
        self._server.complaints.append("there is no mission to sail from there")
        return FAILED

    def _pause(self, message: Message) -> int:
        station = message.get_srcSystem()
        if message.param1 == 0.0:
            self._server.orders.append(Pause(station))
            return ACCEPTED
        if message.param1 != 1.0:
            return DENIED
        return ACCEPTED if self._server.start(station, self._server.mission.current) else FAILED


# -- What ground stations say to the companion, and what they are answered.
#
# Their messages come through the autopilot, which hands on what is addressed to our component.
# Sans-IO like the link: messages and the time go in; replies, orders and plain words come out.

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
        self._frames = GoalFrames(datum, settings.reach_m)
        self.server = MissionServer(settings, self._frames, self._permits)
        self._commands = StationCommands(self.server, self._frames)
        self._complained_s: dict[int, float] = {}
        self._told_s = -math.inf
        self._now_s = -math.inf

    @property
    def chart(self) -> StaticMap:
        """What is fixed around the boat: what orders may ask for depends on it."""
        return self._frames.chart

    @chart.setter
    def chart(self, chart: StaticMap) -> None:
        self._frames.chart = chart

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
        order = position_target(message, self._frames)
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
        | mavlink.MAV_PROTOCOL_CAPABILITY_MISSION_FENCE
        | mavlink.MAV_PROTOCOL_CAPABILITY_COMMAND_INT
        | mavlink.MAV_PROTOCOL_CAPABILITY_SET_POSITION_TARGET_LOCAL_NED
        | mavlink.MAV_PROTOCOL_CAPABILITY_SET_POSITION_TARGET_GLOBAL_INT
        | mavlink.MAV_PROTOCOL_CAPABILITY_MAVLINK2
    )
    none = [0] * 8
    return mavlink.MAVLink_autopilot_version_message(
        capabilities, 0, 0, 0, 0, none, none, none, 0, 0, 0
    )
