"""Goals that need no mission: SET_POSITION_TARGET_* and the commands to go, start, pause."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TypeAlias

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from twinscrew.runtime.link.mission_server import MissionServer
from twinscrew.runtime.link.orders import GoTo, Halt, Relative
from twinscrew.runtime.link.places import (
    DEGREES_PER_UNIT,
    LOCAL,
    METRES_PER_UNIT,
    ON_EARTH,
    Chart,
    Fault,
)
from twinscrew.runtime.link.wire import Message

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


def position_target(message: Message, chart: Chart) -> GoTo | Refusal:
    """Read SET_POSITION_TARGET_LOCAL_NED or _GLOBAL_INT: its position is a goal, all else is not.

    Velocities and accelerations are the policy's to choose: a message that has no position is
    refused.
    """
    if message.type_mask & NO_POSITION:
        return "goal refused: a target needs a position; velocities are not taken"
    station = message.get_srcSystem()
    if message.get_type() == "SET_POSITION_TARGET_GLOBAL_INT":
        if message.coordinate_frame not in ON_EARTH:
            return f"goal refused: {Fault.FRAME.words}"
        x, y = message.lat_int * DEGREES_PER_UNIT, message.lon_int * DEGREES_PER_UNIT
        return _go(station, chart, message.coordinate_frame, x, y)
    relative = RELATIVE.get(message.coordinate_frame)
    if relative is None:
        return f"goal refused: {Fault.FRAME.words}"
    if relative is Relative.ORIGIN:
        return _go(station, chart, LOCAL, message.x, message.y)
    if not math.hypot(message.x, message.y) <= GREATEST_RELATIVE_M:
        return f"goal refused: {Fault.FAR.words}"
    return GoTo(station, message.x, message.y, relative)


def _go(station: int, chart: Chart, frame: int, x: float, y: float) -> GoTo | Refusal:
    place = chart.place(frame, x, y)
    if isinstance(place, Fault):
        return f"goal refused: {place.words}"
    north, east = place.tolist()
    return GoTo(station, north, east)


class StationCommands:
    """Carries out COMMAND_LONG and COMMAND_INT; orders and complaints go where missions' do."""

    def __init__(self, server: MissionServer, chart: Chart) -> None:
        self._server = server
        self._chart = chart
        self._handlers: dict[int, Callable[[Message], int]] = {
            mavlink.MAV_CMD_DO_REPOSITION: self._reposition,
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
        order = _go(message.get_srcSystem(), self._chart, frame, x, y)
        if isinstance(order, str):
            self._server.complaints.append(order)
            return DENIED
        self._server.orders.append(order)
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
            self._server.orders.append(Halt(station))
            return ACCEPTED
        if message.param1 != 1.0:
            return DENIED
        return ACCEPTED if self._server.start(station, self._server.mission.current) else FAILED
