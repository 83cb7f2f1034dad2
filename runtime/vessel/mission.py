"""The mission: goals that the vessel heads for, one after another, and the place where it stays."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final, Literal

import numpy as np

from twinscrew.runtime.errors import ConfigError
from twinscrew.runtime.messages.types import (
    Berth,
    Float64,
    Goal,
    HealthEvent,
    Odometry,
    Station,
)
from twinscrew.runtime.safety.events import (
    BERTH_SET,
    GOAL_MISSING,
    GOAL_REACHED,
    GOAL_SET,
    STATION_HELD,
    STATION_LEFT,
    STATION_SET,
    WAYPOINT_REACHED,
)
from twinscrew.runtime.settings import Positive, Settings

KEPT_RADII: Final = 2.5
"""[-] Within so many goal radii of its station a vessel keeps it; outside the policy drives there,
as to a goal. Once there, it keeps it up to twice as far off."""


class MissionSettings(Settings, frozen=True):
    """Where to go."""

    waypoints_m: tuple[tuple[float, float], ...] = ()
    """[m] [N] Goals in order, each (north, east); more may come over the topics."""
    goal_radius_m: Positive = 2.0
    """[m] A goal is reached within this distance (parameters.md: 2.0 m)."""
    hold_station: bool = False
    """Head for the last goal again when the vessel has drifted twice the radius away from it."""
    on_arrival: Literal["stop", "hold"] = "stop"
    """What the vessel does at its last goal: propellers at rest, or hold the place. "hold" is also
    how it then keeps its place outside its operational envelope."""


class Mission:
    """Holds the goals of the last order, and notes which of them are reached."""

    def __init__(self, settings: MissionSettings | None = None) -> None:
        self._settings = settings or MissionSettings()
        for north_east in self._settings.waypoints_m:
            if not all(math.isfinite(value) for value in north_east):
                raise ConfigError(f"not finite: {north_east!r}", key="mission.waypoints_m")
        self._goals = _goals(self._settings.waypoints_m, 0)
        self._index = 0
        self.orders = 0
        """[-] Counts the orders: whoever gave the last one knows by it whether it still holds."""
        self.arrived = False
        """Whether the last goal is reached."""
        self._was_missing = False
        self._held: Goal | None = None
        self._off_place = False
        self._station: Station | None = None
        self.berth: Berth | None = None
        """A face to lie at, if that is the last order."""
        self.line_up_N: Float64 | None = None
        """[m] [N] (2,) Where the way in to the berth begins: whoever finds it says so."""
        self.berthed = False
        """Whether the vessel lies at its berth, or did: whoever brings it there says so."""
        self._keeps = self._was_held = False

    @property
    def goal(self) -> Goal | None:
        """The goal to head for, reached or not; None if there is none."""
        if self._held is not None:
            return self._held
        if self.berth is not None:
            place_N = self.berth.face_N.mean(axis=0) if self.line_up_N is None else self.line_up_N
            return Goal(stamp_ns=self.berth.stamp_ns, position_N=place_N)
        if self._station is not None:
            return Goal(stamp_ns=self._station.stamp_ns, position_N=self._station.position_N)
        return self._goals[self._index] if self._goals else None

    @property
    def target(self) -> Goal | None:
        """The goal that is not reached yet; None if there is none."""
        if self.berth is not None and self._held is None:
            return None if self._keeps else self.goal
        if self._place is not None:
            return None if self._keeps else self.goal
        if self._held is not None:
            return self._held if self._off_place else None
        return None if self.arrived else self.goal

    @property
    def station(self) -> Station | None:
        """The place to keep now; None if there is none, or the vessel is still on its way there."""
        return self._place if self._keeps else None

    @property
    def berths(self) -> bool:
        """Whether the vessel is near enough to its berth to come in."""
        return self.berth is not None and self._held is None and self._keeps

    @property
    def ahead_N(self) -> Float64:
        """[m] [N] (K, 2) The goals that are not reached yet, in their order."""
        ahead = [] if self.arrived else self._goals[self._index :]
        if self.berth is not None:
            goal = self.goal
            return np.empty((0, 2)) if goal is None else goal.position_N.reshape(1, 2)
        if self._station is not None:
            return self._station.position_N.reshape(1, 2)
        return np.array([goal.position_N for goal in ahead]).reshape(-1, 2)

    @property
    def bound_N(self) -> Float64:
        """[m] [N] (K, 2) The same, and the last goal where the vessel stays at it."""
        stays = self._settings.on_arrival == "hold" or self._settings.hold_station
        if self.arrived and stays and self._goals:
            return self._goals[-1].position_N.reshape(1, 2)
        return self.ahead_N

    @property
    def radius_m(self) -> float:
        """[m] A goal is reached within this distance."""
        return self._settings.goal_radius_m

    @property
    def reached(self) -> int:
        """[-] How many goals of the last order have been reached."""
        return self._index + (self.arrived if self._station is None else self._was_held)

    def set_goal(self, goal: Goal) -> HealthEvent:
        """Replace all goals by one."""
        self._begin([goal])
        north, east = goal.position_N
        return GOAL_SET.at(goal.stamp_ns, f"north {north:.1f} m, east {east:.1f} m")

    def set_route(self, places_N: Float64, stamp_ns: int) -> HealthEvent:
        """Replace all goals by these, (K, 2) [m] [N]; by none at all to stop."""
        self._begin(_goals(places_N.tolist(), stamp_ns))
        if not self._goals:
            return GOAL_SET.at(stamp_ns, "none: all were taken back")
        north, east = self._goals[-1].position_N
        where = f"the last at north {north:.1f} m, east {east:.1f} m"
        return GOAL_SET.at(stamp_ns, f"{len(self._goals)} in a row, {where}")

    def set_station(self, station: Station) -> HealthEvent:
        """Replace all goals by a place to stay at."""
        self._begin([])
        self._station = station
        north, east = station.position_N
        bow = "into wind and current"
        if station.heading is not None:
            bow = f"{math.degrees(station.heading) % 360.0:.0f} deg"
        words = f"north {north:.1f} m, east {east:.1f} m, bow {bow}"
        return STATION_SET.at(station.stamp_ns, words)

    def set_berth(self, berth: Berth) -> HealthEvent:
        """Replace all goals by a face to lie at."""
        self._begin([])
        self.berth = berth
        (north, east), (north_2, east_2) = berth.face_N.tolist()
        words = f"from north {north:.1f} m, east {east:.1f} m to north {north_2:.1f} m, "
        return BERTH_SET.at(berth.stamp_ns, f"{words}east {east_2:.1f} m")

    def hold(self, odometry: Odometry) -> None:
        """Keep the place where the vessel is, whatever the goals; they are kept for `resume`."""
        self._held = Goal(stamp_ns=odometry.stamp_ns, position_N=odometry.position_N[:2].copy())
        self._off_place = False
        self._keeps = True

    @property
    def holds(self) -> bool:
        """Whether a place is kept, instead of heading for the goals."""
        return self._held is not None

    def resume(self) -> None:
        """Head for the goals again."""
        if self._held is not None:
            self._held, self._keeps = None, False

    @property
    def _place(self) -> Station | None:
        """The place to stay at, if there is one, however far off."""
        stays = self._settings.on_arrival == "hold"
        if self._held is not None:
            kept = self._held if stays else None
        elif self._station is not None:
            return self._station
        else:
            kept = self._goals[-1] if stays and self.arrived and self._goals else None
        if kept is None:
            return None
        return Station(stamp_ns=kept.stamp_ns, position_N=kept.position_N)

    def _stay(self, odometry: Odometry, place: Station) -> HealthEvent | None:
        """Note whether the place can be kept from here, and say when it is held, or left."""
        radius = self._settings.goal_radius_m
        off_m = float(np.hypot(*(place.position_N - odometry.position_N[:2])))
        self._keeps = off_m <= (2.0 if self._keeps else 1.0) * KEPT_RADII * radius
        if self._held is not None:
            return None  # nothing is said of a place that nobody ordered
        was_held = self._was_held
        self._was_held = off_m <= (2.0 if was_held else 1.0) * radius
        if self._station is None or was_held == self._was_held:
            return None
        kind = STATION_HELD if self._was_held else STATION_LEFT
        return kind.at(odometry.stamp_ns, f"{off_m:.2f} m off")

    def step(self, odometry: Odometry) -> HealthEvent | None:
        """Look where the vessel is; give an event when it reaches a goal, or has none any more."""
        if self.berth is not None and self._held is None:
            self._was_missing = False
            if self.line_up_N is not None:
                radii = KEPT_RADII * self._settings.goal_radius_m
                off_m = float(np.hypot(*(self.line_up_N - odometry.position_N[:2])))
                way_m = float(np.hypot(*(self.line_up_N - self.berth.face_N.mean(axis=0))))
                most_m = max(8.0 * radii, 2.0 * way_m)  # the way in, and room to stand off
                self._keeps = self.berthed or off_m <= (most_m if self._keeps else radii)
            return None
        place = self._place
        if place is not None:
            self._was_missing = False
            return self._stay(odometry, place)
        if self._held is not None:
            off_m = float(np.hypot(*(self._held.position_N - odometry.position_N[:2])))
            drifted = off_m > 2.0 * self._settings.goal_radius_m
            self._off_place = drifted or (self._off_place and off_m > self._settings.goal_radius_m)
            return None
        goal, was_missing = self.goal, self._was_missing
        self._was_missing = goal is None
        if goal is None:
            return None if was_missing else GOAL_MISSING.at(odometry.stamp_ns)
        distance = float(np.hypot(*(goal.position_N - odometry.position_N[:2])))
        radius = self._settings.goal_radius_m
        if self.arrived:
            drifted = self._settings.hold_station and distance > 2.0 * radius
            self.arrived = not drifted
            return None
        if distance > radius:
            return None
        detail = f"goal {self._index + 1} of {len(self._goals)}, {distance:.2f} m away"
        if self._index + 1 < len(self._goals):
            self._index += 1
            return WAYPOINT_REACHED.at(odometry.stamp_ns, detail)
        self.arrived = self._keeps = True
        return GOAL_REACHED.at(odometry.stamp_ns, detail)

    def _begin(self, goals: list[Goal]) -> None:
        self._goals, self._index, self.arrived = goals, 0, False
        self.berth, self.line_up_N, self.berthed = None, None, False
        self._station, self._keeps, self._was_held = None, False, False
        self.orders += 1


def _goals(places: Sequence[Sequence[float]], stamp_ns: int) -> list[Goal]:
    return [Goal(stamp_ns=stamp_ns, position_N=np.array(place)) for place in places]
