"""One mission on its way from a ground station: asked for item by item, until it is whole."""

from __future__ import annotations

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from twinscrew.runtime.link.mission_items import Item
from twinscrew.runtime.link.wire import Message

ASK_AGAIN_S = 0.5
"""[s] A request is repeated after this long without its item (MAVLink advises 0.25 s; a slow radio
takes longer)."""
TRIES = 10
"""[-] Then the station is taken to be gone (5 s; MAVLink advises 5 tries)."""


class Upload:
    """Asks for items in their order; times are the caller's.

    Parameters
    ----------
    station
        System and component that send.
    count
        [-] How many items there will be, at least one.
    """

    def __init__(self, station: tuple[int, int], count: int) -> None:
        self.station = station
        self.count = count
        self.items: list[Item] = []
        self._asked_s = float("-inf")
        self._tries = 0

    @property
    def whole(self) -> bool:
        """Whether every item is there."""
        return len(self.items) == self.count

    @property
    def hopeless(self) -> bool:
        """Whether nothing has come for so long that nothing will."""
        return self._tries > TRIES

    def take(self, seq: int, item: Item) -> bool:
        """Take an item; False if it is not the one that was asked for.

        One that is there already came twice, and is passed over; one too far ahead means that a
        request was lost, and it is repeated at once.
        """
        if seq != len(self.items):
            if seq > len(self.items):
                self._asked_s = float("-inf")
            return False
        self.items.append(item)
        self._asked_s, self._tries = float("-inf"), 0
        return True

    def ask(self, now_s: float) -> list[Message]:
        """Give the request to send now, if any."""
        if self.whole or now_s - self._asked_s < ASK_AGAIN_S:
            return []
        self._asked_s = now_s
        self._tries += 1
        if self.hopeless:
            return []
        return [mavlink.MAVLink_mission_request_int_message(*self.station, len(self.items))]
