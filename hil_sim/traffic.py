"""Scripted ships: other traffic that does not run our software, of any size and speed.

A ship of `[[traffic]]` keeps its course and speed, or does what its behaviour says; it gives way to
nobody. It lies at its start until the first vessel is released, so that an encounter does not
depend on how long autopilots take to arm. LiDARs see a hull of its size with a deckhouse; whoever
touches its rectangle has collided.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np
from msgspec import Meta

from twinscrew.hil_sim.random_scenario import Coordinate
from twinscrew.hil_sim.shapes import Shape, boxes_shape
from twinscrew.runtime.geometry import wrap
from twinscrew.runtime.messages.types import Float64
from twinscrew.runtime.settings import NonNegative, Positive, Settings

Point = tuple[Coordinate, Coordinate]
TURN_SHARE = 0.15
"""[-] A ship turns within about this share of its speed a length, or at"""
LEAST_TURN_RADPS = math.radians(1.0)
"""[rad/s] this at least."""
STOP_MPS2 = 0.1
"""[m/s2] A ship that stops loses this much of its speed a second: crash stops are rarer."""
DRAUGHT_SHARE = 0.25
"""[-] Of the beam: how deep a hull goes."""


class TrafficEntry(Settings, frozen=True, kw_only=True):
    """A scripted ship of a scenario."""

    start_m: Point
    """[m] [N] North, east of its middle."""
    course_deg: float
    """[deg] [N] Where it goes, clockwise from north."""
    speed_mps: Annotated[float, Meta(ge=0.0, le=40.0)]
    """[m/s] Over ground."""
    length_m: Annotated[float, Meta(gt=0.5, le=500.0)]
    """[m] Of its hull,"""
    beam_m: Annotated[float, Meta(gt=0.3, le=80.0)]
    """[m] which is this wide."""
    height_m: Positive | None = None
    """[m] Of the hull over the water; none: 0.15 of its length, from 0.5 to 8 m."""
    waypoints: tuple[Point, ...] = ()
    """[m] [N] Places that it goes to one after the other; after the last it keeps its course."""
    behaviour: Literal["hold", "manoeuvre", "stop", "drift"] = "hold"
    """hold: keeps course and speed. manoeuvre: alters course by `turn_deg` after `after_s`. stop:
    loses its way after `after_s`. drift: goes along its course with its bow at `heading_deg`."""
    after_s: NonNegative = 10.0
    """[s] After the first vessel was released."""
    turn_deg: float = 60.0
    """[deg] To starboard; negative: to port."""
    heading_deg: float = 90.0
    """[deg] [N] Of what drifts."""
    ais: Literal["none", "A", "B"] = "A"
    """Whose reports it sends where the simulator has AIS."""
    mmsi: Annotated[int, Meta(ge=0, le=999_999_999)] = 0
    """Its number; 0: 257000001 and so on, in order."""
    name: str = ""
    """As it reports itself; empty: TRAFFIC 1 and so on."""

    def __post_init__(self) -> None:
        """Refuse a ship that is wider than long."""
        if self.beam_m > self.length_m:
            raise ValueError("beam_m must be at most length_m")


@dataclass(slots=True)
class _Ship:
    """Where one ship is."""

    p_N: Float64
    course: float
    speed: float
    waypoint: int = 0


class Traffic:
    """All scripted ships of a scenario; its time begins with the first `step`."""

    def __init__(self, entries: Sequence[TrafficEntry]) -> None:
        self.entries = tuple(entries)
        self.time_s = 0.0
        """[s] Since the ships got under way."""
        self._ships = [
            _Ship(np.array(e.start_m, np.float64), math.radians(e.course_deg), e.speed_mps)
            for e in self.entries
        ]
        self._moves = False

    def __len__(self) -> int:
        """Give the number of ships."""
        return len(self._ships)

    @property
    def position_N(self) -> Float64:
        """[m] [N] (T, 2) North, east of their middles."""
        return np.array([ship.p_N for ship in self._ships]).reshape(-1, 2)

    @property
    def velocity_N(self) -> Float64:
        """[m/s] [N] (T, 2) Over ground."""
        if not self._moves:
            return np.zeros((len(self), 2))
        rows = [(s.speed * math.cos(s.course), s.speed * math.sin(s.course)) for s in self._ships]
        return np.array(rows).reshape(-1, 2)

    @property
    def heading(self) -> Float64:
        """[rad] [N] (T,) Where their bows point."""
        return np.array(
            [
                math.radians(entry.heading_deg) if entry.behaviour == "drift" else ship.course
                for entry, ship in zip(self.entries, self._ships, strict=True)
            ],
            np.float64,
        )

    @property
    def pose_N(self) -> Float64:
        """[m, m, rad] [N] (T, 3) North, east of their middles, heading."""
        return np.column_stack([self.position_N, self.heading])

    @property
    def boxes(self) -> Float64:
        """[m, rad] [N] (T, 6) North, east, length, beam, height, heading: as quays are told."""
        rows = [(e.length_m, e.beam_m, hull_height_m(e)) for e in self.entries]
        sizes = np.array(rows, np.float64).reshape(-1, 3)
        return np.column_stack([self.position_N, sizes, self.heading])

    def step(self, dt: float) -> None:
        """Let time [s] pass."""
        self._moves = True
        for entry, ship in zip(self.entries, self._ships, strict=True):
            self._steer(entry, ship, dt)
            way = ship.speed * dt
            ship.p_N = ship.p_N + way * np.array([math.cos(ship.course), math.sin(ship.course)])
        self.time_s += dt

    def _steer(self, entry: TrafficEntry, ship: _Ship, dt: float) -> None:
        wanted = ship.course
        if ship.waypoint < len(entry.waypoints):
            d = np.array(entry.waypoints[ship.waypoint]) - ship.p_N
            if float(np.hypot(*d)) <= max(0.5 * entry.length_m, ship.speed):
                ship.waypoint += 1
            else:
                wanted = math.atan2(d[1], d[0])
        late = self.time_s >= entry.after_s
        if entry.behaviour == "manoeuvre" and late:
            wanted = math.radians(entry.course_deg + entry.turn_deg)
        elif entry.behaviour == "stop" and late:
            ship.speed = max(ship.speed - STOP_MPS2 * dt, 0.0)
        rate = max(TURN_SHARE * ship.speed / entry.length_m * 2.0, LEAST_TURN_RADPS)
        turn = float(wrap(wanted - ship.course))
        ship.course = float(wrap(ship.course + min(max(turn, -rate * dt), rate * dt)))


def hull_height_m(entry: TrafficEntry) -> float:
    """[m] Give how high a hull stands over the water."""
    return entry.height_m or min(max(0.15 * entry.length_m, 0.5), 8.0)


def shape_of(entry: TrafficEntry) -> Shape:
    """Give what a ship looks like, its origin at the water: a hull, and a deckhouse aft."""
    length, beam, height = entry.length_m, entry.beam_m, hull_height_m(entry)
    draught = DRAUGHT_SHARE * beam + 1.0
    house = (0.25 * length, 0.7 * beam, 0.8 * height)
    return boxes_shape(
        np.array([[0.0, 0.0, (draught - height) / 2], [-0.25 * length, 0.0, -1.4 * height]]),
        np.array([[length, beam, height + draught], house]),
        np.zeros(2),
    )
