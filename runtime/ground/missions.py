"""The mission protocol of MAVLink: items, upload and download, and the mission that is stored."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final, TypeAlias

import numpy as np
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from twinscrew.runtime.charts.static_map import Feature
from twinscrew.runtime.ground.fences import FENCE, FenceItem, Misfit, features_of, read_item
from twinscrew.runtime.ground.orders import (
    DEGREES_PER_UNIT,
    LOCAL,
    METRES_PER_UNIT,
    NO_WAITING,
    NOT_SAILED,
    ON_EARTH,
    Fault,
    FollowRoute,
    GoalFrames,
    GoTo,
    Order,
    OrderSettings,
    Pause,
    Waypoint,
)
from twinscrew.runtime.mavlink import Message
from twinscrew.runtime.messages.types import Float64

# -- One line of a mission, as a ground station sends it and gets it back.


WAYPOINT = int(mavlink.MAV_CMD_NAV_WAYPOINT)
HOLD = int(mavlink.MAV_CMD_NAV_LOITER_UNLIM)
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

    def place(self, frames: GoalFrames) -> Float64 | Fault:
        """Give where it is, (2,) [m] [N], or why it cannot be sailed."""
        if self.command not in (WAYPOINT, HOLD):
            return NOT_SAILED
        if self.command == WAYPOINT and self.params[0] > 0.0:
            return NO_WAITING
        return frames.place_of_integers(self.frame, self.x, self.y)

    @property
    def holds(self) -> bool:
        """Whether the vessel is to stay there."""
        return self.command == HOLD

    @property
    def heading(self) -> float | None:
        """[rad] Where its bow is to point while it stays: param 4 [deg]; None for 0 or NaN."""
        yaw_deg = self.params[3]
        told = self.holds and math.isfinite(yaw_deg) and yaw_deg != 0.0
        return math.radians(yaw_deg) if told else None

    def message(
        self, station: tuple[int, int], seq: int, *, current: bool = False, kind: int = 0
    ) -> Message:
        """Give the message that tells it to a station, as part of a mission of a type."""
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
            kind,
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


# -- The one mission that is kept: its items as they came, and what of them is sailed.

UNKNOWN_TOTAL = 65_535
"""[-] MISSION_CURRENT's word for a mission that is not there."""


class StoredMission:
    """Keeps a mission that can be sailed, or none."""

    def __init__(self, settings: OrderSettings, frames: GoalFrames) -> None:
        self.items: tuple[Item, ...] = ()
        self.way: tuple[Waypoint, ...] = ()
        """What of the items is sailed: all, or all but home."""
        self.current = 0
        """[-] The item that is headed for, or would be."""
        self.state = int(mavlink.MISSION_STATE_NO_MISSION)
        """MISSION_STATE."""
        self._settings = settings
        self._frames = frames

    def fault(self, seq: int, item: Item) -> Fault | None:
        """Tell what is wrong with an item as it comes, if anything.

        Whether the first one is home is known only when all are there, unless it is settled.
        """
        if seq == 0 and self._settings.home != "none":
            return None
        place = item.place(self._frames)
        return place if isinstance(place, Fault) else None

    def keep(self, items: tuple[Item, ...]) -> Fault | None:
        """Take a whole mission in the place of the one before; or tell what is wrong with item 0.

        The other items have passed `fault`.
        """
        first = 1 if items and self._is_home(items) else 0
        way = []
        for seq, item in enumerate(items[first:], first):
            place = item.place(self._frames)
            if isinstance(place, Fault):
                return place
            north, east = place.tolist()
            way.append(Waypoint(seq, north, east, item.holds, item.heading))
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


class StoredFence:
    """Keeps the fences that stations have uploaded, where somebody honours them."""

    def __init__(self, frames: GoalFrames) -> None:
        self.items: tuple[Item, ...] = ()
        self.honour: Callable[[tuple[Feature, ...]], str] = lambda _: ""
        """Takes fences in place of those before; gives why they cannot be kept, empty if they
        can."""
        self._frames = frames

    def read(self, item: Item) -> FenceItem | Fault:
        """Read an item as it comes."""
        command, param1 = item.command, item.params[0]
        return read_item(command, item.frame, param1, item.x, item.y, self._frames)

    def keep(self, items: tuple[Item, ...]) -> Misfit | None:
        """Take fences in place of those before; or tell which item is wrong, and why."""
        read = []
        for seq, item in enumerate(items):
            one = self.read(item)
            if isinstance(one, Fault):
                return Misfit(seq, one)
            read.append(one)
        features = features_of(read)
        if isinstance(features, Misfit):
            return features
        words = self.honour(features)
        if words:
            return Misfit(0, Fault(mavlink.MAV_MISSION_DENIED, words))
        self.items = items
        return None


# -- What is stored, told to whoever asks.

MISSION = int(mavlink.MAV_MISSION_TYPE_MISSION)
KINDS: Final = {MISSION: "mission", FENCE: "fence"}
"""What is kept, by MAV_MISSION_TYPE, and its word."""


def download(
    message: Message, items: Sequence[Item], station: tuple[int, int], current: int = -1
) -> Message:
    """Answer MISSION_REQUEST_LIST, MISSION_REQUEST or MISSION_REQUEST_INT.

    Parameters
    ----------
    message
        The request.
    items
        What is kept of the type that is asked for.
    station
        Who asks.
    current
        [-] The item that is headed for.
    """
    kind = kind_of(message)
    if message.get_type() == "MISSION_REQUEST_LIST":
        return mavlink.MAVLink_mission_count_message(*station, len(items), kind)
    seq = message.seq
    if seq >= len(items):
        return acknowledgement(station, mavlink.MAV_MISSION_INVALID_SEQUENCE, kind)
    return items[seq].message(station, seq, current=seq == current, kind=kind)


def acknowledgement(station: tuple[int, int], result: int, kind: int = MISSION) -> Message:
    """Make MISSION_ACK."""
    return mavlink.MAVLink_mission_ack_message(*station, int(result), kind)


def kind_of(message: Message) -> int:
    """Give the MAV_MISSION_TYPE that a message is about."""
    return int(getattr(message, "mission_type", MISSION))


# -- One mission on its way from a ground station: asked for item by item, until it is whole.

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
    kind
        MAV_MISSION_TYPE.
    """

    def __init__(self, station: tuple[int, int], count: int, kind: int = MISSION) -> None:
        self.station = station
        self.count = count
        self.kind = kind
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
        seq = len(self.items)
        return [mavlink.MAVLink_mission_request_int_message(*self.station, seq, self.kind)]


# -- MAVLink's mission protocol, the vehicle's side: a mission and fences are kept, and given back.
#
# https://mavlink.io/en/services/mission.html. A mission that cannot be sailed as it stands is
# refused whole, at the item that is wrong, and the one before it stays.

ALL = int(mavlink.MAV_MISSION_TYPE_ALL)
GUIDED = 2
"""[-] `current` of an item that is no part of a mission, but a goal."""
Station: TypeAlias = tuple[int, int]
"""System and component."""


class MissionServer:
    """Answers stations; `replies`, `orders` and `complaints` are for the owner to take.

    Parameters
    ----------
    settings, frames
        How long a mission may be, when it starts, and where its places lie.
    permits
        Tells whether a system may change the mission; anybody may read it.
    """

    def __init__(
        self, settings: OrderSettings, frames: GoalFrames, permits: Callable[[int], bool]
    ) -> None:
        self.mission = StoredMission(settings, frames)
        self.fence = StoredFence(frames)
        self.replies: list[Message] = []
        self.orders: list[Order] = []
        self.complaints: list[str] = []
        """What was refused and why, in plain words."""
        self._settings = settings
        self._frames = frames
        self._permits = permits
        self._upload: Upload | None = None
        self._accepted: tuple[Station, int, int] | None = None
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
            what = KINDS[upload.kind]
            self.complaints.append(f"{what} given up: item {len(upload.items)} never came")

    def start(self, station: int, seq: int) -> bool:
        """Order to sail from an item on; False if there is none to sail to."""
        way = self.mission.rest(seq)
        if not way:
            return False
        for waypoint in way:  # the chart or a fence may have changed since it was uploaded
            why = self._frames.chart.why(np.array([waypoint.north_m, waypoint.east_m]))
            if why:
                self.complaints.append(f"mission not started: item {waypoint.seq} is {why}")
                return False
        self.mission.current = way[0].seq
        self.orders.append(FollowRoute(station, way))
        return True

    def _on_count(self, message: Message, station: Station, now_s: float) -> None:
        if not self._may_change(message, station):
            return
        count, most, kind = message.count, self._settings.most_items, kind_of(message)
        if self._upload is not None and self._upload.station != station:
            self._acknowledge(station, mavlink.MAV_MISSION_DENIED, kind)
        elif count > most:
            self._acknowledge(station, mavlink.MAV_MISSION_NO_SPACE, kind)
            self.complaints.append(f"{KINDS[kind]} refused: {count} items, at most {most} are kept")
        elif count == 0:
            self._clear(station, kind)
            self._acknowledge(station, mavlink.MAV_MISSION_ACCEPTED, kind)
        else:
            self._upload = Upload(station, count, kind)
            self.tick(now_s)

    def _on_item(self, message: Message, station: Station, now_s: float) -> None:
        if not self._may_change(message, station):
            return
        upload, kind = self._upload, kind_of(message)
        item = item_of(message)
        if message.current == GUIDED and kind == MISSION:
            self._go(station, item)
            return
        if upload is None or (upload.station, upload.kind) != (station, kind):
            self._answer_late(station, message.seq, kind)
            return
        if upload.take(message.seq, item):
            fault = self._fault(kind, message.seq, item)
            if fault is not None:
                self._refuse(upload, message.seq, fault)
            elif upload.whole:
                self._complete(upload)
        self.tick(now_s)

    def _fault(self, kind: int, seq: int, item: Item) -> Fault | None:
        """Tell what is wrong with an item as it comes, if anything."""
        if kind == MISSION:
            return self.mission.fault(seq, item)
        read = self.fence.read(item)
        return read if isinstance(read, Fault) else None

    def _go(self, station: Station, item: Item) -> None:
        """Take an item that is a goal by itself: how stations steered ArduPilot before commands."""
        place = item.place(self._frames)
        if isinstance(place, Fault):
            self._acknowledge(station, place.result)
            self.complaints.append(f"goal refused: {place.words}")
            return
        north, east = place.tolist()
        goal = GoTo(station[0], north, east, holds=item.holds, heading=item.heading)
        self.orders.append(goal)
        self._acknowledge(station, mavlink.MAV_MISSION_ACCEPTED)

    def _complete(self, upload: Upload) -> None:
        items = tuple(upload.items)
        if upload.kind == FENCE:
            misfit = self.fence.keep(items)
        else:
            fault = self.mission.keep(items)
            misfit = None if fault is None else Misfit(0, fault)
        if misfit is not None:
            self._refuse(upload, *misfit)
            return
        self._accepted = (upload.station, upload.count, upload.kind)
        self._end(upload, mavlink.MAV_MISSION_ACCEPTED)
        if upload.kind == FENCE:
            return
        if not self.mission.way:
            self.orders.append(Pause(upload.station[0]))
        elif self._settings.start == "upload":
            self.start(upload.station[0], 0)

    def _answer_late(self, station: Station, seq: int, kind: int) -> None:
        """Answer an item that nobody asked for; our word that all are there may be lost."""
        again = self._accepted == (station, seq + 1, kind)
        accepted, out_of_order = mavlink.MAV_MISSION_ACCEPTED, mavlink.MAV_MISSION_INVALID_SEQUENCE
        self._acknowledge(station, accepted if again else out_of_order, kind)

    def _on_request(self, message: Message, station: Station, _now_s: float) -> None:
        kind, mission = kind_of(message), self.mission
        if kind == MISSION:
            self.replies.append(download(message, mission.items, station, mission.current))
        elif kind == FENCE:
            self.replies.append(download(message, self.fence.items, station))
        else:
            self._acknowledge(station, mavlink.MAV_MISSION_UNSUPPORTED, kind)

    def _on_clear(self, message: Message, station: Station, _now_s: float) -> None:
        kind = kind_of(message)
        if not self._permits(station[0]):
            self._acknowledge(station, mavlink.MAV_MISSION_DENIED, kind)
        elif kind not in (*KINDS, ALL):
            self._acknowledge(station, mavlink.MAV_MISSION_UNSUPPORTED, kind)
        else:
            self._clear(station, kind)
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

    def _clear(self, station: Station, kind: int) -> None:
        self._upload = self._accepted = None
        if kind in (FENCE, ALL):
            self.fence.keep(())
        if kind in (MISSION, ALL):
            self.mission.keep(())
            self.orders.append(Pause(station[0]))

    def _may_change(self, message: Message, station: Station) -> bool:
        """Whether the station may change the mission; it is answered if not."""
        kind = kind_of(message)
        if not self._permits(station[0]):
            self._acknowledge(station, mavlink.MAV_MISSION_DENIED, kind)
            return False
        if kind not in KINDS:
            self._acknowledge(station, mavlink.MAV_MISSION_UNSUPPORTED, kind)
            return False
        return True

    def _refuse(self, upload: Upload, seq: int, fault: Fault) -> None:
        self._end(upload, fault.result)
        self.complaints.append(f"{KINDS[upload.kind]} refused: item {seq}: {fault.words}")

    def _end(self, upload: Upload, result: int) -> None:
        self._upload = None
        self._acknowledge(upload.station, result, upload.kind)

    def _acknowledge(self, station: Station, result: int, kind: int = MISSION) -> None:
        self.replies.append(acknowledgement(station, result, kind))
