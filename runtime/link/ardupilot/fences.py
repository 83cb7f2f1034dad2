"""Reads the fences that the autopilot holds, again and again: it does not say when they change."""

from __future__ import annotations

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from twinscrew.runtime.charts.static_map import Feature
from twinscrew.runtime.ground.fences import FENCE, FenceItem, Misfit, features_of, read_item
from twinscrew.runtime.ground.missions import Item, Upload, acknowledgement, item_of, kind_of
from twinscrew.runtime.ground.orders import NO_DATUM, Fault, GoalFrames
from twinscrew.runtime.link.ardupilot.settings import AutopilotSettings
from twinscrew.runtime.mavlink import Message

READ_EVERY_S = 20.0
"""[s] Between two readings: 50 items are 3.5 kB."""
ASK_AGAIN_S = 2.0
"""[s] After an unanswered question for how many there are."""
MOST_ITEMS = 1000
"""[-] Of an autopilot's fences; ArduPilot has room for fewer."""
REACH_M = 100_000.0
"""[m] From the origin of frame N: fences may lie farther away than goals."""


class FenceReader:
    """The client's side of MAVLink's mission protocol, for fences.

    Parameters
    ----------
    settings
        Who the autopilot is, and where frame N lies on the earth.
    """

    def __init__(self, settings: AutopilotSettings) -> None:
        self._autopilot = (settings.system_id, int(mavlink.MAV_COMP_ID_AUTOPILOT1))
        self._us = (settings.system_id, settings.component_id)
        self._frames = GoalFrames(settings.datum, REACH_M)
        self._next_s = float("-inf")
        self._upload: Upload | None = None
        self._items: tuple[Item, ...] | None = None
        self._refused = ""
        self._news: tuple[Feature, ...] | str | None = None
        self._reply: list[Message] = []

    def take(self, message: Message, now_s: float) -> None:
        """Take a message of the autopilot; most are about something else."""
        kind = message.get_type()
        if kind not in ("MISSION_COUNT", "MISSION_ITEM_INT", "MISSION_ACK"):
            return
        target = (message.target_system, message.target_component)
        if kind_of(message) != FENCE or target != self._us:
            return
        if kind == "MISSION_COUNT":
            self._count(message.count, now_s)
        elif kind == "MISSION_ITEM_INT" and self._upload is not None:
            if self._upload.take(message.seq, item_of(message)) and self._upload.whole:
                self._end(tuple(self._upload.items), now_s)
        elif kind == "MISSION_ACK":  # it has none, or they changed while we read
            self._upload, self._next_s = None, now_s + READ_EVERY_S

    def ask(self, now_s: float) -> list[Message]:
        """Give what is to be asked now."""
        replies, self._reply = self._reply, []
        if self._upload is not None:
            replies += self._upload.ask(now_s)
            if self._upload.hopeless:
                self._upload, self._next_s = None, now_s + READ_EVERY_S
        elif now_s >= self._next_s:
            self._next_s = now_s + ASK_AGAIN_S
            replies.append(mavlink.MAVLink_mission_request_list_message(*self._autopilot, FENCE))
        return replies

    def news(self) -> tuple[Feature, ...] | str | None:
        """Give all fences if they have changed, or why they cannot be placed; else None."""
        news, self._news = self._news, None
        return news

    def _count(self, count: int, now_s: float) -> None:
        self._next_s = now_s + READ_EVERY_S
        if count == 0:
            self._end((), now_s)
        elif self._frames.datum is None:
            self._refuse(f"{count} items of fences: {NO_DATUM.words}")
        elif count > MOST_ITEMS:
            self._refuse(f"{count} items of fences; at most {MOST_ITEMS} are read")
        else:
            self._upload = Upload(self._autopilot, count, FENCE)

    def _refuse(self, words: str) -> None:
        if words != self._refused:
            self._refused = self._news = words
        self._items = None

    def _end(self, items: tuple[Item, ...], now_s: float) -> None:
        """Take a complete reading; one that is as the last one is no news."""
        if items:
            accepted = mavlink.MAV_MISSION_ACCEPTED
            self._reply.append(acknowledgement(self._autopilot, accepted, FENCE))
        self._upload, self._next_s = None, now_s + READ_EVERY_S
        if items == self._items:
            return
        is_first = self._items is None and not self._refused
        self._items, self._refused = items, ""
        if items or not is_first:
            self._news = self._features(items)

    def _features(self, items: tuple[Item, ...]) -> tuple[Feature, ...] | str:
        read: list[FenceItem] = []
        for seq, item in enumerate(items):
            one = read_item(item.command, item.frame, item.params[0], item.x, item.y, self._frames)
            if isinstance(one, Fault):
                return f"item {seq}: {one.words}"
            read.append(one)
        features = features_of(read)
        if isinstance(features, Misfit):
            return f"item {features.seq}: {features.fault.words}"
        return features
