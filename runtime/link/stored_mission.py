"""The one mission that is kept: its items as they came, and what of them is sailed."""

from __future__ import annotations

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from twinscrew.runtime.link.mission_items import Item, has_home
from twinscrew.runtime.link.orders import OrderSettings, Waypoint
from twinscrew.runtime.link.places import Chart, Fault
from twinscrew.runtime.link.wire import Message

UNKNOWN_TOTAL = 65_535
"""[-] MISSION_CURRENT's word for a mission that is not there."""


class StoredMission:
    """Keeps a mission that can be sailed, or none."""

    def __init__(self, settings: OrderSettings, chart: Chart) -> None:
        self.items: tuple[Item, ...] = ()
        self.way: tuple[Waypoint, ...] = ()
        """What of the items is sailed: all, or all but home."""
        self.current = 0
        """[-] The item that is headed for, or would be."""
        self.state = int(mavlink.MISSION_STATE_NO_MISSION)
        """MISSION_STATE."""
        self._settings = settings
        self._chart = chart

    def fault(self, seq: int, item: Item) -> Fault | None:
        """Tell what is wrong with an item as it comes, if anything.

        Whether the first one is home is known only when all are there, unless it is settled.
        """
        if seq == 0 and self._settings.home != "none":
            return None
        place = item.place(self._chart)
        return place if isinstance(place, Fault) else None

    def keep(self, items: tuple[Item, ...]) -> Fault | None:
        """Take a whole mission in the place of the one before; or tell what is wrong with item 0.

        The other items have passed `fault`.
        """
        first = 1 if items and self._is_home(items) else 0
        way = []
        for seq, item in enumerate(items[first:], first):
            place = item.place(self._chart)
            if isinstance(place, Fault):
                return place
            way.append(Waypoint(seq, *place.tolist()))
        self.items, self.way = items, tuple(way)
        self.current = way[0].seq if way else 0
        there, none = mavlink.MISSION_STATE_NOT_STARTED, mavlink.MISSION_STATE_NO_MISSION
        self.state = int(there if way else none)
        return None

    def rest(self, seq: int) -> tuple[Waypoint, ...]:
        """Give the way from an item on; empty if there is no such item."""
        if seq >= len(self.items):
            return ()
        return tuple(waypoint for waypoint in self.way if waypoint.seq >= seq)

    def told(self) -> Message:
        """Give MISSION_CURRENT."""
        total = len(self.items) or UNKNOWN_TOTAL
        return mavlink.MAVLink_mission_current_message(self.current, total, self.state)

    def _is_home(self, items: tuple[Item, ...]) -> bool:
        if self._settings.home == "auto":
            return has_home(items)
        return self._settings.home == "first"
