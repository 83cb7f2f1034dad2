"""MAVLink's mission protocol, the vehicle's side: one mission is kept here, and given back.

https://mavlink.io/en/services/mission.html. A mission that cannot be sailed as it stands is refused
whole, at the item that is wrong, and the one before it stays.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeAlias

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from twinscrew.runtime.link.mission_download import (
    MISSION,
    acknowledgement,
    download,
    kind_of,
)
from twinscrew.runtime.link.mission_items import Item, item_of
from twinscrew.runtime.link.mission_upload import Upload
from twinscrew.runtime.link.orders import GoTo, Halt, Order, OrderSettings, Sail
from twinscrew.runtime.link.places import Chart, Fault
from twinscrew.runtime.link.stored_mission import StoredMission
from twinscrew.runtime.link.wire import Message

ALL = int(mavlink.MAV_MISSION_TYPE_ALL)
GUIDED = 2
"""[-] `current` of an item that is no part of a mission, but a goal."""
Station: TypeAlias = tuple[int, int]
"""System and component."""


class MissionServer:
    """Answers stations; `replies`, `orders` and `complaints` are for the owner to take.

    Parameters
    ----------
    settings, chart
        How long a mission may be, when it starts, and where its places lie.
    permits
        Tells whether a system may change the mission; anybody may read it.
    """

    def __init__(
        self, settings: OrderSettings, chart: Chart, permits: Callable[[int], bool]
    ) -> None:
        self.mission = StoredMission(settings, chart)
        self.replies: list[Message] = []
        self.orders: list[Order] = []
        self.complaints: list[str] = []
        """What was refused and why, in plain words."""
        self._settings = settings
        self._chart = chart
        self._permits = permits
        self._upload: Upload | None = None
        self._accepted: tuple[Station, int] | None = None
        self._handlers: dict[str, Callable[[Message, Station, float], None]] = {
            "MISSION_COUNT": self._on_count,
            "MISSION_ITEM": self._on_item,
            "MISSION_ITEM_INT": self._on_item,
            "MISSION_REQUEST_LIST": self._on_request,
            "MISSION_REQUEST": self._on_request,
            "MISSION_REQUEST_INT": self._on_request,
            "MISSION_CLEAR_ALL": self._on_clear,
            "MISSION_SET_CURRENT": self._on_set_current,
            "MISSION_WRITE_PARTIAL_LIST": self._on_partial,
            "MISSION_ACK": self._on_ack,
        }

    def take(self, message: Message, station: Station, now_s: float) -> bool:
        """Take a message of the protocol; False if it is none."""
        handler = self._handlers.get(message.get_type())
        if handler is not None:
            handler(message, station, now_s)
        return handler is not None

    def tick(self, now_s: float) -> None:
        """Ask for what is missing."""
        upload = self._upload
        if upload is None:
            return
        self.replies += upload.ask(now_s)
        if upload.hopeless:
            self._end(upload, mavlink.MAV_MISSION_OPERATION_CANCELLED)
            self.complaints.append(f"mission given up: item {len(upload.items)} never came")

    def start(self, station: int, seq: int) -> bool:
        """Order to sail from an item on; False if there is none to sail to."""
        way = self.mission.rest(seq)
        if not way:
            return False
        self.mission.current = way[0].seq
        self.orders.append(Sail(station, way))
        return True

    def _on_count(self, message: Message, station: Station, now_s: float) -> None:
        if not self._may_change(message, station):
            return
        count, most = message.count, self._settings.most_items
        if self._upload is not None and self._upload.station != station:
            self._acknowledge(station, mavlink.MAV_MISSION_DENIED)
        elif count > most:
            self._acknowledge(station, mavlink.MAV_MISSION_NO_SPACE)
            self.complaints.append(f"mission refused: {count} items, at most {most} are kept")
        elif count == 0:
            self._clear(station)
            self._acknowledge(station, mavlink.MAV_MISSION_ACCEPTED)
        else:
            self._upload = Upload(station, count)
            self.tick(now_s)

    def _on_item(self, message: Message, station: Station, now_s: float) -> None:
        if not self._may_change(message, station):
            return
        upload = self._upload
        item = item_of(message)
        if message.current == GUIDED:
            self._go(station, item)
            return
        if upload is None or upload.station != station:
            self._answer_late(station, message.seq)
            return
        if upload.take(message.seq, item):
            fault = self.mission.fault(message.seq, item)
            if fault is not None:
                self._refuse(upload, message.seq, fault)
            elif upload.whole:
                self._complete(upload)
        self.tick(now_s)

    def _go(self, station: Station, item: Item) -> None:
        """Take an item that is a goal by itself: how stations steered ArduPilot before commands."""
        place = item.place(self._chart)
        if isinstance(place, Fault):
            self._acknowledge(station, place.result)
            self.complaints.append(f"goal refused: {place.words}")
            return
        north, east = place.tolist()
        self.orders.append(GoTo(station[0], north, east))
        self._acknowledge(station, mavlink.MAV_MISSION_ACCEPTED)

    def _complete(self, upload: Upload) -> None:
        fault = self.mission.keep(tuple(upload.items))
        if fault is not None:
            self._refuse(upload, 0, fault)
            return
        self._accepted = (upload.station, upload.count)
        self._end(upload, mavlink.MAV_MISSION_ACCEPTED)
        if not self.mission.way:
            self.orders.append(Halt(upload.station[0]))
        elif self._settings.start == "upload":
            self.start(upload.station[0], 0)

    def _answer_late(self, station: Station, seq: int) -> None:
        """Answer an item that nobody asked for; our word that the mission is there may be lost."""
        again = self._accepted == (station, seq + 1)
        accepted, out_of_order = mavlink.MAV_MISSION_ACCEPTED, mavlink.MAV_MISSION_INVALID_SEQUENCE
        self._acknowledge(station, accepted if again else out_of_order)

    def _on_request(self, message: Message, station: Station, _now_s: float) -> None:
        self.replies.append(download(message, self.mission, station))

    def _on_clear(self, message: Message, station: Station, _now_s: float) -> None:
        kind = kind_of(message)
        if not self._permits(station[0]):
            self._acknowledge(station, mavlink.MAV_MISSION_DENIED, kind)
        elif kind not in (MISSION, ALL):
            self._acknowledge(station, mavlink.MAV_MISSION_UNSUPPORTED, kind)
        else:
            self._clear(station)
            self._acknowledge(station, mavlink.MAV_MISSION_ACCEPTED, kind)

    def _on_set_current(self, message: Message, station: Station, _now_s: float) -> None:
        if not self._permits(station[0]):
            return
        if not self.start(station[0], message.seq):
            self.complaints.append(f"mission has no item {message.seq} to sail to")
        self.replies.append(self.mission.told())

    def _on_partial(self, message: Message, station: Station, _now_s: float) -> None:
        self._acknowledge(station, mavlink.MAV_MISSION_UNSUPPORTED, kind_of(message))

    def _on_ack(self, message: Message, station: Station, _now_s: float) -> None:
        """Take a station's word: that its download is complete, or that it gives its upload up."""
        upload = self._upload
        if upload is not None and upload.station == station and message.type != 0:
            self._upload = None

    def _clear(self, station: Station) -> None:
        self._upload = self._accepted = None
        self.mission.keep(())
        self.orders.append(Halt(station[0]))

    def _may_change(self, message: Message, station: Station) -> bool:
        """Whether the station may change the mission; it is answered if not."""
        kind = kind_of(message)
        if not self._permits(station[0]):
            self._acknowledge(station, mavlink.MAV_MISSION_DENIED, kind)
            return False
        if kind != MISSION:
            self._acknowledge(station, mavlink.MAV_MISSION_UNSUPPORTED, kind)
            return False
        return True

    def _refuse(self, upload: Upload, seq: int, fault: Fault) -> None:
        self._end(upload, fault.result)
        self.complaints.append(f"mission refused: item {seq}: {fault.words}")

    def _end(self, upload: Upload, result: int) -> None:
        self._upload = None
        self._acknowledge(upload.station, result)

    def _acknowledge(self, station: Station, result: int, kind: int = MISSION) -> None:
        self.replies.append(acknowledgement(station, result, kind))
