"""A route: from here to the goal around everything that is fixed, and the point on it to steer for.

The native planner divides the water into square cells, the finer the nearer to what is fixed, and
searches them with A*; its legs are straight lines at any angle. Every leg keeps a least clearance
from what is fixed. A greater clearance is preferred: a metre at the least clearance costs twice as
much as one in open water, and a wall to leeward counts as nearer than it is. docs/charts.md
explains it; the laws that a route keeps are in tests/property/test_route.py.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any, Final, NamedTuple

import numpy as np

from twinscrew.runtime._native import RoutePlanner, legs_clearance
from twinscrew.runtime.charts.static_map import StaticMap
from twinscrew.runtime.messages.types import NANOSECONDS_PER_SECOND, Float64
from twinscrew.runtime.settings import NonNegative, Positive, Settings
from twinscrew.runtime.vessel_description import VesselDescription, load_vessel

NO_WALLS: Final = np.empty((0, 2, 2))
"""Walls, if there are none."""
STILL: Final = (0.0, 0.0)
"""[m/s] No drift."""
LEAST_BEAMS: Final = 0.62
"""[-] The least clearance in beams: half a beam is the hull, the rest is for how exactly it is
steered. A gap of 1.6 beams leaves 0.18 beams on either side for the legs' own choice."""
FINEST_SHARE: Final = 0.4
"""[-] Side of the smallest cells, in least clearances: 0.25 of the beam, so that legs fit into the
0.36 beams that a gap of 1.6 leaves them."""
WHOLE_M: Final = 1500.0
"""[m] A map that is no larger is searched as a whole; of a larger one a part first."""
MOST_CELLS: Final = 100_000
"""[-] With more, cells are made twice as large. So the search for a goal that cannot be reached,
among 150 rocks within a fence of 50 km, ends after 2 s, and not after a minute."""
MOST_WINDOWS: Final = 64
"""[-] So many parts of a map are remembered for which cells had to be larger."""
SAMPLES: Final = 24
"""[-] So many places of the route ahead are looked at for the one to steer for."""
SIGHT_SHARE: Final = 0.9
"""[-] The straight way to that place keeps this share of the route's own clearance."""


def _least_m(vessel: VesselDescription) -> float:
    return round(LEAST_BEAMS * vessel.beam_m, 3)


class RouteSettings(Settings, frozen=True, kw_only=True):
    """How far from everything fixed a route keeps, and when it is found anew."""

    enabled: bool = True
    """Whether goals behind land are reached by a route; else they are headed for straight."""
    learnt: bool = True
    """Whether walls that the LiDAR has learnt are gone around too."""
    least_clearance_m: Positive = _least_m(load_vessel())
    """[m] No leg comes nearer to what is fixed: 0.62 of the beam."""
    clearance_m: Positive = load_vessel().length_m
    """[m] From here on nearness costs nothing: a hull's length, room to turn."""
    nearness: NonNegative = 1.0
    """[-] A metre at the least clearance costs 1 + this times a metre in open water."""
    drift_s: NonNegative = 2.0
    """[s] What wind and current push the vessel towards counts as nearer by the way that it drifts
    in this time."""
    escape_m: Positive = 4.0 * load_vessel().length_m
    """[m] From nearer than the least clearance, or from where it is forbidden (it was pushed there,
    or a fence came), the vessel leaves for water that is no farther away than this."""
    again_s: Positive = 2.0
    """[s] So long after the last search another one is made at the soonest, but for a new goal."""
    drift_change_mps: Positive = 0.2
    """[m/s] A drift that differs by more from that of the last search asks for another."""

    def __post_init__(self) -> None:
        """Refuse clearances that contradict each other."""
        if self.clearance_m <= self.least_clearance_m:
            raise ValueError("clearance_m must be greater than least_clearance_m")


def settings_for(vessel: VesselDescription) -> dict[str, Any]:
    """Give what of the settings follows from a hull."""
    return {
        "least_clearance_m": _least_m(vessel),
        "clearance_m": max(vessel.length_m, 1.1 * _least_m(vessel)),
        "escape_m": 4.0 * vessel.length_m,
    }


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Route:
    """A way that was found, or why there is none."""

    places_N: Float64 = field(default_factory=lambda: np.empty((0, 2)))
    """[m] [N] (M, 2) From the start to the goal; empty if there is no way."""
    cost_m: float = math.inf
    """[m] What it costs: its length, and what nearness adds."""
    reason: str = ""
    """Why there is no way, in plain words; empty if there is one."""

    @property
    def length_m(self) -> float:
        """[m] How long it is."""
        steps = np.diff(self.places_N, axis=0)
        return float(np.hypot(steps[:, 0], steps[:, 1]).sum())


SHUT_IN: Final = "the vessel is shut in"
_ENDS: Final = (
    "",
    SHUT_IN,
    "the goal is shut in",
    "no way leads to the goal",
)


class Router:
    """Finds routes on one map. It keeps the planner's memory: one serves one thread at a time.

    Parameters
    ----------
    settings
        Clearances.
    static_map
        What is fixed.
    walls : (S, 2, 2) float64
        [m] [N] Segments that are fixed too, with water on both sides: what the LiDAR has learnt.
    """

    def __init__(
        self,
        settings: RouteSettings | None = None,
        static_map: StaticMap | None = None,
        walls: Float64 = NO_WALLS,
    ) -> None:
        self.settings = settings or RouteSettings()
        self.static_map = static_map or StaticMap.empty()
        self.walls = walls
        self.is_free = not len(walls) and self.static_map.is_empty
        """Whether nothing is fixed."""
        places = np.concatenate([self.static_map.edges.reshape(-1, 2), walls.reshape(-1, 2)])
        self._low = places.min(axis=0, initial=np.inf)
        self._high = places.max(axis=0, initial=-np.inf)
        self._finest_m: dict[tuple[float, float, float], float] = {}
        self._planner: RoutePlanner | None = None
        self._window: tuple[float, float, float] | None = None

    def route(self, start_N: Float64, goal_N: Float64, drift_N: Float64 | None = None) -> Route:
        """Find the way from a place to another.

        Parameters
        ----------
        start_N, goal_N : (2,) float64
            [m] [N]
        drift_N : (2,) float64, optional
            [m/s] [N] How wind and current together push the vessel.

        Returns
        -------
        Route
            With a reason in its place if nothing leads there. A start or goal that is nearer to
            what is fixed than the least clearance is joined to the nearest water in sight; a start
            where it is forbidden leaves by the shortest way.
        """
        start, goal = _pair(start_N), _pair(goal_N)
        if self.is_free:
            places = np.array([start, goal])
            return Route(places_N=places, cost_m=math.dist(start, goal))
        why = self.static_map.why(np.array(goal))
        if why or not self.static_map.leaves_water:
            return Route(reason=f"the goal is {why}" if why else "the map leaves no water")
        drift = STILL if drift_N is None else _pair(drift_N)
        end = 0
        for window in self._windows(start, goal):
            end, places_N, cost_m = self._found(window, start, goal, drift)
            if end == 0:
                return Route(places_N=places_N, cost_m=cost_m)
        return Route(reason=_ENDS[end])

    def clearance(self, a_N: Float64, b_N: Float64) -> float:
        """[m] Give the least distance from a straight way to what is fixed; 0 if it meets any.

        Infinite if nothing is fixed. Both ends must be near the last route (`covers`).
        """
        return (
            math.inf if self._planner is None else self._planner.clearance(_pair(a_N), _pair(b_N))
        )

    def covers(self, place_N: Float64) -> bool:
        """Tell whether a place is in the part of the map that was searched last."""
        return self._planner is not None and self._planner.covers(_pair(place_N))

    def _windows(
        self, start: tuple[float, float], goal: tuple[float, float]
    ) -> Iterator[tuple[float, float, float]]:
        """Give squares to search, one after another: north and east of a corner, side [m].

        Corners and sides are whole multiples of a length, so that a vessel under way stays in one
        square.
        """
        margin = 8.0 * self.settings.clearance_m
        ends = np.array([start, goal])
        low = np.minimum(self._low, ends.min(axis=0)) - margin
        high = np.maximum(self._high, ends.max(axis=0)) + margin
        whole = _square(low, high)
        away = math.dist(start, goal)
        for reach in (max(300.0, 0.5 * away), max(1200.0, 2.0 * away)):
            window = _square(ends.min(axis=0) - reach, ends.max(axis=0) + reach)
            if whole[2] > max(WHOLE_M, window[2]):
                yield window
        yield whole

    def _found(
        self,
        window: tuple[float, float, float],
        start: tuple[float, float],
        goal: tuple[float, float],
        drift: tuple[float, float],
    ) -> tuple[int, Float64, float]:
        """Search a part of the map; its cells grow until there are not too many."""
        finest_m = FINEST_SHARE * self.settings.least_clearance_m
        finest_m = self._finest_m.get(window, finest_m)
        if window != self._window or self._planner is None:
            self._window, self._planner = window, self._divided(window, finest_m)
        while True:
            end, places_N, cost_m, _ = self._planner.find(start, goal, drift)
            if end < len(_ENDS):
                return end, places_N, cost_m
            finest_m *= 2.0
            if len(self._finest_m) >= MOST_WINDOWS:
                self._finest_m.clear()
            self._finest_m[window] = finest_m
            self._planner = self._divided(window, finest_m)

    def _divided(self, window: tuple[float, float, float], finest_m: float) -> RoutePlanner:
        """Make a planner for a part of the map, with cells of this size [m] at least."""
        settings = self.settings
        planner = RoutePlanner(
            least=settings.least_clearance_m,
            wanted=settings.clearance_m,
            nearness=settings.nearness,
            finest=finest_m,
            coarsest=max(2.0 * settings.clearance_m, finest_m),
            drift_s=settings.drift_s,
            escape=settings.escape_m,
            most=MOST_CELLS,
        )
        planner.divide(self.static_map.edges, self.walls, window[:2], window[2])
        return planner


def _square(low: Float64, high: Float64) -> tuple[float, float, float]:
    """Give the square of whole multiples of 64 m, or of a sixteenth of it, that holds a box."""
    side = float(np.max(high - low))
    unit = max(64.0, 2.0 ** math.floor(math.log2(max(side, 1.0) / 16.0)))
    north, east = (math.floor(value / unit) * unit for value in low.tolist())
    tops = high.tolist()
    side = max(tops[0] - north, tops[1] - east)
    return north, east, math.ceil(side / unit) * unit


def _pair(place: Float64) -> tuple[float, float]:
    return float(place[0]), float(place[1])


class Aim(NamedTuple):
    """What to steer for."""

    place_N: Float64 | None
    """[m] [N] (2,) The goal itself, or a place on the way there; None: nowhere, hold."""
    news: str = ""
    """What there is to tell of the route: it was found, or found anew, in plain words."""
    trouble: str = ""
    """Why no route leads to the goal; told when that begins, and for each new goal."""


class Guidance:
    """Follows a route: gives the farthest place on it that is in sight, and finds it anew.

    It is found anew for another goal, another map, learnt walls in its way, another drift, and when
    the vessel has left it. No clock and no randomness: time comes with the stamps.

    Parameters
    ----------
    settings
        Clearances.
    reach_m
        [m] The place to steer for is no farther away along the route: what a policy is shown.
    """

    def __init__(self, settings: RouteSettings | None = None, reach_m: float = 55.0) -> None:
        self.settings = settings or RouteSettings()
        self.reach_m = reach_m
        self._map = StaticMap.empty()
        self.reset()

    def reset(self) -> None:
        """Forget the route."""
        self._goal_N: tuple[float, float] | None = None
        self.route: Route | None = None
        """The last one that was looked for; None while the way to the goal is straight."""
        self._router = Router(self.settings, self._map)
        self._legs = np.empty((0, 2, 2))
        self._clear_m: list[float] = []
        self._along_m: Float64 = np.zeros(1)
        self._drift_N = np.zeros(2)
        self._walls: Float64 = NO_WALLS
        self._searched_ns = 0
        self._searched_N = np.zeros(2)
        self._at_leg = 0

    @property
    def ahead_N(self) -> Float64:
        """[m] [N] (M, 2) The places of the route that are still ahead, the goal last."""
        return self._legs[self._at_leg :, 1]

    def step(
        self,
        stamp_ns: int,
        place_N: Float64,
        goal_N: Float64,
        static_map: StaticMap,
        walls: Float64 = NO_WALLS,
        drift_N: Float64 | None = None,
    ) -> Aim:
        """Give what to steer for now.

        Parameters
        ----------
        stamp_ns
            [ns] Now.
        place_N, goal_N : (2,) float64
            [m] [N] Where the vessel is, and where it is to go.
        static_map
            What is fixed.
        walls : (S, 2, 2) float64
            [m] [N] What the LiDAR has learnt; the same array as long as nothing has changed.
        drift_N : (2,) float64, optional
            [m/s] [N] How wind and current push the vessel.

        Returns
        -------
        Aim
            The goal itself where nothing is fixed, and where only learnt walls are and none stands
            in the straight way: then the policy finds its way alone, as it was trained to.
        """
        if not self.settings.enabled or (static_map.is_empty and not len(walls)):
            self._leave(static_map)
            return Aim(goal_N)
        if static_map.is_empty and self._is_straight(place_N, goal_N, walls):
            self._leave(static_map)
            return Aim(goal_N)
        drift_N = np.zeros(2) if drift_N is None else drift_N
        since_s = (stamp_ns - self._searched_ns) / NANOSECONDS_PER_SECOND
        is_new = self._goal_N != _pair(goal_N) or self._map.version != static_map.version
        is_due = not 0.0 <= since_s < self.settings.again_s
        news = trouble = ""
        if is_new or (is_due and self._is_outdated(place_N, walls, drift_N)):
            was_found = not is_new and self.route is not None and not self.route.reason
            self._search(stamp_ns, place_N, goal_N, static_map, walls, drift_N)
            news, trouble = self._told(is_new=is_new, was_found=was_found)
        if self.route is None or self.route.reason:
            return Aim(None, news, trouble)
        return Aim(self._ahead(place_N, goal_N), news, trouble)

    # -- The route.

    def _leave(self, static_map: StaticMap) -> None:
        """Forget the route: the way is straight."""
        self._map = static_map
        if self._goal_N is not None:
            self.reset()

    def _is_straight(self, place_N: Float64, goal_N: Float64, walls: Float64) -> bool:
        """Tell whether the straight way to the goal keeps the least clearance from the walls."""
        leg = np.array([[place_N, goal_N]])
        return float(legs_clearance(leg, walls)[0]) >= self.settings.least_clearance_m

    def _search(
        self,
        stamp_ns: int,
        place_N: Float64,
        goal_N: Float64,
        static_map: StaticMap,
        walls: Float64,
        drift_N: Float64,
    ) -> None:
        if static_map.version != self._map.version or walls is not self._walls:
            self._map, self._walls = static_map, walls
            self._router = Router(self.settings, static_map, walls)
        self._goal_N, self._drift_N, self._searched_ns = _pair(goal_N), drift_N, stamp_ns
        self._searched_N = place_N.copy()
        self.route = self._router.route(place_N, goal_N, drift_N)
        places = self.route.places_N
        self._legs, self._at_leg = np.stack([places[:-1], places[1:]], axis=1), 0
        self._clear_m = [self._router.clearance(a, b) for a, b in self._legs]
        lengths = np.hypot(*(self._legs[:, 1] - self._legs[:, 0]).T)
        self._along_m = np.concatenate([[0.0], np.cumsum(lengths)])

    def _is_outdated(self, place_N: Float64, walls: Float64, drift_N: Float64) -> bool:
        """Tell whether the route is to be found anew."""
        settings = self.settings
        if self.route is None or self.route.reason == SHUT_IN:
            return True
        if self.route.reason:  # to find that out takes longest, and would give the same again
            moved_m = float(np.hypot(*(place_N - self._searched_N)))
            return walls is not self._walls or moved_m > settings.clearance_m
        if not self._router.covers(place_N):
            return True
        if float(np.hypot(*(drift_N - self._drift_N))) > settings.drift_change_mps:
            return True
        if walls is not self._walls and len(walls):
            ahead = self._legs[self._at_leg :]
            clear = legs_clearance(ahead, walls)
            if (clear < 0.95 * np.minimum(settings.least_clearance_m, self._clear_ahead)).any():
                return True
        _, off_m = self._nearest(place_N)
        return off_m > 2.0 * settings.clearance_m or self._in_sight(place_N) is None

    @property
    def _clear_ahead(self) -> Float64:
        return np.array(self._clear_m[self._at_leg :])

    def _told(self, *, is_new: bool, was_found: bool) -> tuple[str, str]:
        """Say what the search gave, if that is news."""
        assert self.route is not None  # noqa: S101  (it was just looked for)
        if self.route.reason:
            return "", self.route.reason if is_new or was_found else ""
        if len(self._legs) == 1 and (is_new or was_found):
            return "", ""
        words = f"{self.route.length_m:.0f} m in {len(self._legs)} legs"
        return f"{words}, found anew" if was_found else words, ""

    # -- The place to steer for.

    def _ahead(self, place_N: Float64, goal_N: Float64) -> Float64:
        found = self._in_sight(place_N)
        if found is None:
            found = self._legs[self._at_leg, 1]
        at_goal = _pair(found) == self._goal_N
        return goal_N if at_goal else found

    def _in_sight(self, place_N: Float64) -> Float64 | None:
        """Give the farthest place of the route within reach that is in sight; None if none is.

        In sight is what lies at the end of a straight way with nearly the clearance that the
        route itself keeps up to there. Close to a wall, as after a push, it is the next corner.
        """
        settings, router = self.settings, self._router
        done_m, _ = self._nearest(place_N)
        own_m = router.clearance(place_N, place_N)
        least_m = settings.least_clearance_m
        corner: Float64 = self._legs[self._at_leg, 1]
        if own_m < least_m and self._clear_m[self._at_leg] < least_m:
            return corner  # out of where it is too near
        last_m = min(done_m + self.reach_m, float(self._along_m[-1]))
        corners = self._along_m[(self._along_m > done_m) & (self._along_m < last_m)]
        samples = np.linspace(last_m, done_m, SAMPLES, endpoint=False)
        for along_m in sorted({*samples.tolist(), *corners.tolist()}, reverse=True):
            leg = min(int(np.searchsorted(self._along_m, along_m)), len(self._legs)) - 1
            route_m = min(self._clear_m[self._at_leg : leg + 1])
            wanted_m = SIGHT_SHARE * min(settings.clearance_m, own_m, route_m)
            place = self._place(leg, along_m)
            clear_m = router.clearance(place_N, place)
            if clear_m > 0.0 and clear_m >= wanted_m:
                return place
        return None

    def _place(self, leg: int, along_m: float) -> Float64:
        """Give the place on a leg that is so far along the route."""
        begin, end = self._along_m[leg], self._along_m[leg + 1]
        share = min((along_m - begin) / max(end - begin, 1e-9), 1.0)
        if share >= 1.0:
            last: Float64 = self._legs[leg, 1]
            return last
        place: Float64 = self._legs[leg, 0] + share * (self._legs[leg, 1] - self._legs[leg, 0])
        return place

    def _nearest(self, place_N: Float64) -> tuple[float, float]:
        """Give how far along the route the vessel is [m], and how far off it [m].

        It never goes back to a leg that it has left.
        """
        legs = self._legs[self._at_leg :]
        way = legs[:, 1] - legs[:, 0]
        length2 = np.maximum((way**2).sum(axis=1), 1e-12)
        share = np.clip(((place_N - legs[:, 0]) * way).sum(axis=1) / length2, 0.0, 1.0)
        off = np.hypot(*(legs[:, 0] + share[:, None] * way - place_N).T)
        k = int(off.argmin())
        self._at_leg += k
        along = self._along_m[self._at_leg] + float(share[k]) * math.sqrt(float(length2[k]))
        return float(along), float(off[k])
