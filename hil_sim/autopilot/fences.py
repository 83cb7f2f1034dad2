"""The fences that the simulated autopilot holds, and MAVLink's mission protocol for them.

As ArduPilot's: they are kept as they came, and told to whoever asks. It has no missions. What it
does at a fence, a breach, is not simulated: in MANUAL nothing stops a boat but its companion.
"""

from __future__ import annotations

from typing import Final

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from twinscrew.runtime.ground.fences import CIRCLES, FENCE, POLYGONS, RETURN_POINT
from twinscrew.runtime.ground.missions import (
    ALL,
    Item,
    Station,
    Upload,
    acknowledgement,
    download,
    item_of,
    kind_of,
)
from twinscrew.runtime.mavlink import Message

FENCE_MESSAGES: Final = (
    "MISSION_REQUEST_LIST",
    "MISSION_REQUEST",
    "MISSION_REQUEST_INT",
    "MISSION_COUNT",
    "MISSION_ITEM",
    "MISSION_ITEM_INT",
    "MISSION_CLEAR_ALL",
)
"""What it answers of the protocol."""
MOST_ITEMS: Final = 84
"""[-] ArduPilot keeps as many corners as fit its storage; about this on small boards."""


class Fences:
    """Holds fences, and takes them from one station at a time."""

    def __init__(self) -> None:
        self.items: tuple[Item, ...] = ()
        """As they came."""
        self._upload: Upload | None = None

    @property
    def fetches(self) -> bool:
        """Whether an upload has begun and is not over."""
        return self._upload is not None

    def take(self, message: Message, sender: Station, now_s: float) -> list[Message]:
        """Take a message of the protocol, and give the answers."""
        kind, what = kind_of(message), message.get_type()
        if what == "MISSION_CLEAR_ALL" and kind in (FENCE, ALL):
            self.items, self._upload = (), None
            return [acknowledgement(sender, mavlink.MAV_MISSION_ACCEPTED, kind)]
        if kind != FENCE:
            if what == "MISSION_REQUEST_LIST":
                return [mavlink.MAVLink_mission_count_message(*sender, 0, kind)]
            return [acknowledgement(sender, mavlink.MAV_MISSION_UNSUPPORTED, kind)]
        if what == "MISSION_COUNT":
            return self._count(message.count, sender, now_s)
        if what in ("MISSION_ITEM", "MISSION_ITEM_INT"):
            return self._item(message, sender, now_s)
        return [download(message, self.items, sender)]

    def ask(self, now_s: float) -> list[Message]:
        """Give the request for the next item, where one is due."""
        if self._upload is None:
            return []
        requests = self._upload.ask(now_s)
        if self._upload.hopeless:
            self._upload = None
        return requests

    def _count(self, count: int, sender: Station, now_s: float) -> list[Message]:
        if count > MOST_ITEMS:
            return [acknowledgement(sender, mavlink.MAV_MISSION_NO_SPACE, FENCE)]
        if count == 0:
            self.items = ()
            return [acknowledgement(sender, mavlink.MAV_MISSION_ACCEPTED, FENCE)]
        self._upload = Upload(sender, count, FENCE)
        return self.ask(now_s)

    def _item(self, message: Message, sender: Station, now_s: float) -> list[Message]:
        upload = self._upload
        if upload is None or upload.station != sender:
            return [acknowledgement(sender, mavlink.MAV_MISSION_INVALID_SEQUENCE, FENCE)]
        if message.command not in (*POLYGONS, *CIRCLES, RETURN_POINT):
            self._upload = None
            return [acknowledgement(sender, mavlink.MAV_MISSION_UNSUPPORTED, FENCE)]
        if upload.take(message.seq, item_of(message)) and upload.whole:
            self.items, self._upload = tuple(upload.items), None
            return [acknowledgement(sender, mavlink.MAV_MISSION_ACCEPTED, FENCE)]
        return self.ask(now_s)
