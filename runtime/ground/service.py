"""Carries out what ground stations order, and tells them how it goes and what the vessel does.

Goals come from anywhere: the configuration, the goal and route topics, ground stations. The last
one counts, and replaces all before it. A mission that another goal has replaced is kept, and may
be started again.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Protocol

import numpy as np
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from twinscrew.runtime.geometry import rotation_2d
from twinscrew.runtime.ground.orders import FollowRoute, GoTo, Order, Pause, Relative, Waypoint
from twinscrew.runtime.ground.report import GroundReport
from twinscrew.runtime.ground.stations import Stations
from twinscrew.runtime.mavlink import Message
from twinscrew.runtime.messages import cdr
from twinscrew.runtime.messages.types import Float64, Goal, Odometry, Severity, Station

Feed = Callable[[str, bytes], None]
"""Takes a topic and a payload: hands them to the core, and keeps them for a replay."""
SAME_M = 0.01
"""[m] A goal this near the last one is the same one, sent again."""


class Progress(Protocol):
    """The goals that the vessel heads for, whoever ordered them."""

    orders: int
    """[-] Counts the orders."""

    @property
    def reached(self) -> int:
        """[-] How many goals of the last order have been reached."""


class GroundLink(Protocol):
    """The way to ground stations and back; the autopilot's connection is one."""

    @property
    def stations(self) -> Stations | None:
        """What stations have said; None: nobody may order anything this way."""

    def tell(self, messages: Iterable[Message]) -> None:
        """Send MAVLink messages to the stations, when there is room on the line."""

    def say(self, text: str, severity: Severity) -> None:
        """Send a text that an operator reads."""


class StationGoals:
    """Hands orders to the core, and watches the mission that they began."""

    def __init__(
        self, stations: Stations, goals: Progress, odometry: Callable[[], Odometry | None]
    ) -> None:
        self._stations = stations
        self._goals = goals
        self._odometry = odometry
        self._sailing: FollowRoute | None = None
        self._order = -1
        self._reached = 0
        self._news: list[Message] = []
        self._going: tuple[Float64, GoTo] | None = None
        self._leg: tuple[Waypoint, ...] = ()
        self._then: tuple[Waypoint, ...] = ()

    def carry_out(self, feed: Feed, stamp_ns: int) -> None:
        """Feed the core what was ordered since the last call."""
        goes_on = self._then and self._is_ours and self._reached == len(self._leg)
        if goes_on and not self._sail(self._then, feed, stamp_ns):
            self._then = ()
            self._interrupt()
        for order in self._stations.orders():
            self._one(order, feed, stamp_ns)

    def progress(self) -> list[Message]:
        """Give what stations are to be told of the mission since the last call."""
        if self._sailing is not None:
            if self._is_ours:
                self._follow(self._leg)
            else:
                self._interrupt()
        news, self._news = self._news, []
        return news

    @property
    def _is_ours(self) -> bool:
        """Whether the last order that the core took is the one that we gave."""
        return self._goals.orders == self._order

    def _follow(self, way: tuple[Waypoint, ...]) -> None:
        """Note which places were reached."""
        mission, reached = self._stations.server.mission, self._goals.reached
        new, self._reached = way[self._reached : reached], reached
        if not new:
            return
        mission.current = way[min(reached, len(way) - 1)].seq
        over = reached == len(way) and not self._then and not way[-1].holds
        states = mavlink.MISSION_STATE_ACTIVE, mavlink.MISSION_STATE_COMPLETE
        mission.state = int(states[over])
        self._news += [mavlink.MAVLink_mission_item_reached_message(place.seq) for place in new]
        self._news.append(mission.told())

    def _one(self, order: Order, feed: Feed, stamp_ns: int) -> None:
        if isinstance(order, GoTo):
            self._go_to(order, feed, stamp_ns)
        elif isinstance(order, FollowRoute):
            if not self._sail(order.way, feed, stamp_ns):
                return
            self._sailing, self._going = order, None
            self._stations.server.mission.state = int(mavlink.MISSION_STATE_ACTIVE)
        elif isinstance(order, Pause) and self._sailing is not None and self._is_ours:
            self._give("route", self._path(np.empty((0, 2)), stamp_ns), feed)
            self._going = None
            self._interrupt()

    def _sail(self, way: tuple[Waypoint, ...], feed: Feed, stamp_ns: int) -> bool:
        """Sail up to the first place at which the vessel is to stay, or stay there; if it may."""
        count = next((k for k, place in enumerate(way) if place.holds), len(way))
        leg, then = way[: max(count, 1)], way[count:] if count else ()
        places = np.array([(place.north_m, place.east_m) for place in leg])
        if count:
            taken = self._give("route", self._path(places, stamp_ns), feed)
        else:
            taken = self._hold(places[0], way[0].heading, feed, stamp_ns)
        if taken:
            self._leg, self._then, self._reached = leg, then, 0
        return taken

    def _hold(self, place_N: Float64, heading: float | None, feed: Feed, stamp_ns: int) -> bool:
        station = Station(
            stamp_ns=stamp_ns, position_N=place_N, heading=heading, frame_id=self._frame_id
        )
        return self._give("hold", cdr.encode_station(station), feed)

    def _go_to(self, order: GoTo, feed: Feed, stamp_ns: int) -> None:
        place_N = self._place_N(order)
        if place_N is None:
            self._stations.server.complaints.append("goal refused: where the boat is is unknown")
            return
        if self._is_ours and self._going is not None:
            going_N, last = self._going
            alike = (order.holds, order.heading) == (last.holds, last.heading)
            if alike and _apart_m(place_N, going_N) < SAME_M:
                return
        if order.holds:
            taken = self._hold(place_N, order.heading, feed, stamp_ns)
        else:
            goal = Goal(stamp_ns=stamp_ns, position_N=place_N)
            taken = self._give("goal", cdr.encode_goal(goal, frame_id=self._frame_id), feed)
        if taken:
            self._going = place_N, order
            self._interrupt()

    @property
    def _frame_id(self) -> str:
        """What the odometry calls its frame, in which all places of stations are."""
        odometry = self._odometry()
        return "" if odometry is None else odometry.frame_id

    def _path(self, places_N: Float64, stamp_ns: int) -> bytes:
        return cdr.encode_path(places_N, stamp_ns=stamp_ns, frame_id=self._frame_id)

    def _interrupt(self) -> None:
        """Note that the mission is sailed no further."""
        mission = self._stations.server.mission
        if self._sailing is not None and mission.state == mavlink.MISSION_STATE_ACTIVE:
            mission.state = int(mavlink.MISSION_STATE_PAUSED)
            self._news.append(mission.told())
        self._sailing = None

    def _place_N(self, order: GoTo) -> Float64 | None:
        place = np.array([order.x_m, order.y_m])
        if order.relative is Relative.ORIGIN:
            return place
        odometry = self._odometry()
        if odometry is None:
            return None
        if order.relative is Relative.BOW:
            place = rotation_2d(odometry.heading) @ place
        here: Float64 = odometry.position_N[:2] + place
        return here

    def _give(self, topic: str, payload: bytes, feed: Feed) -> bool:
        """Hand the core an order; False if it refuses it, and goes on with the one before."""
        before = self._goals.orders
        feed(topic, payload)
        if self._goals.orders == before:
            return False
        self._order = self._goals.orders
        return True


class GroundService:
    """Serves ground stations through the link of one vessel.

    Parameters
    ----------
    link
        Carries what stations say, and what they are told.
    report
        What they are told.
    mission
        The goals that the vessel heads for.
    odometry
        Gives the vessel's last odometry; None if there is none.
    """

    def __init__(
        self,
        link: GroundLink,
        report: GroundReport,
        mission: Progress,
        odometry: Callable[[], Odometry | None],
    ) -> None:
        self.report = report
        self._link = link
        self._stations = link.stations
        self._goals = (
            None if self._stations is None else StationGoals(self._stations, mission, odometry)
        )

    def serve(self, feed: Feed, stamp_ns: int, now_s: float) -> None:
        """Carry out what was ordered, and hand the link what is to be told."""
        if self._stations is not None and self._goals is not None:
            self._goals.carry_out(feed, stamp_ns)
            self._link.tell(self._goals.progress())
            self.report.complain(self._stations.complaints())
        self._link.tell(self.report.due(now_s))
        for text, severity in self.report.texts():
            self._link.say(text, severity)


def _apart_m(a: Float64, b: Float64) -> float:
    return float(np.hypot(*(a - b)))
