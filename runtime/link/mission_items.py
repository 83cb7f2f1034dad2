"""One line of a mission, as a ground station sends it and gets it back."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from twinscrew.runtime.link.places import (
    DEGREES_PER_UNIT,
    LOCAL,
    METRES_PER_UNIT,
    ON_EARTH,
    Chart,
    Fault,
)
from twinscrew.runtime.link.wire import Message
from twinscrew.runtime.messages.types import Float64

WAYPOINT = int(mavlink.MAV_CMD_NAV_WAYPOINT)
ABSOLUTE = frozenset({mavlink.MAV_FRAME_GLOBAL, mavlink.MAV_FRAME_GLOBAL_INT})
"""Frames whose heights count from the sea."""
_FARTHEST = 2**31 - 1


@dataclass(frozen=True, slots=True)
class Item:
    """What a line says, kept as it came so that it can be given back."""

    command: int
    frame: int
    autocontinue: int
    params: tuple[float, float, float, float]
    x: int
    """[1e-7 deg] Latitude, or [1e-4 m] north."""
    y: int
    """[1e-7 deg] Longitude, or [1e-4 m] east."""
    z: float
    """[m] As it came; it means nothing to a boat."""

    def place(self, chart: Chart) -> Float64 | Fault:
        """Give where it is, (2,) [m] [N], or why it cannot be sailed."""
        if self.command != WAYPOINT:
            return Fault.COMMAND
        if self.params[0] > 0.0:
            return Fault.HOLD
        return chart.place_of_integers(self.frame, self.x, self.y)

    def message(self, station: tuple[int, int], seq: int, *, current: bool) -> Message:
        """Give the message that tells it to a station."""
        return mavlink.MAVLink_mission_item_int_message(
            *station,
            seq,
            self.frame,
            self.command,
            int(current),
            self.autocontinue,
            *self.params,
            self.x,
            self.y,
            self.z,
        )


def item_of(message: Message) -> Item:
    """Read MISSION_ITEM_INT, or MISSION_ITEM, which older stations send."""
    x, y = message.x, message.y
    if message.get_type() == "MISSION_ITEM":
        unit = METRES_PER_UNIT if message.frame == LOCAL else DEGREES_PER_UNIT
        x, y = _integer(x / unit), _integer(y / unit)
    params = (message.param1, message.param2, message.param3, message.param4)
    return Item(message.command, message.frame, message.autocontinue, params, x, y, message.z)


def has_home(items: Sequence[Item]) -> bool:
    """Tell whether item 0 is not part of the way, but home.

    Ground stations that know ArduPilot put home first, in an absolute frame, and the way after it
    in a frame that counts heights from home. Where all items are in one frame there is no home.
    """
    if len(items) < 2 or items[0].frame not in ABSOLUTE or items[0].command != WAYPOINT:
        return False
    relative = ON_EARTH - ABSOLUTE
    return all(item.frame in relative for item in items[1:])


def _integer(value: float) -> int:
    """Round, if it is a number; what is none becomes a place that is refused."""
    return round(value) if abs(value) <= _FARTHEST else _FARTHEST
