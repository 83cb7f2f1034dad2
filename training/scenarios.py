"""Scenarios: who starts where, who wants to go where, where buoys lie; drawn for many episodes.

Rejection sampling as the paper's generator (parameters.md, Training environment): start and goal of
a vessel are drawn together, uniformly, until they keep their distances from those placed before.
Positions are complex numbers, north + i east [m].
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import lru_cache
from typing import Annotated, NamedTuple

import numpy as np
from msgspec import Meta
from numpy.random import Generator
from numpy.typing import NDArray

from twinscrew.runtime.errors import ConfigError
from twinscrew.runtime.messages.types import Float64
from twinscrew.runtime.settings import (
    Count,
    Fraction,
    NonNegative,
    Positive,
    Settings,
    load,
    shipped,
)
from twinscrew.training.harbours import Harbour, Kind

Points = NDArray[np.complex128]
Index = NDArray[np.intp]
Mask = NDArray[np.bool_]

CANDIDATES = 32
"""[-] Drawn at a time for one vessel or buoy."""
ROUNDS = 32
"""[-] So many times, before the whole episode is drawn anew."""
REDRAWS = 8
"""[-] So many times, before the request counts as impossible."""
MOST_PILES = 16
"""[-] In a harbour."""


class ScenarioSettings(Settings, frozen=True):
    """How crowded an episode is: one row of the paper's schedule (table I)."""

    robots: Count = 3
    """[-] Vessels."""
    buoys: Annotated[int, Meta(ge=0, le=50)] = 0
    """[-] Static obstacles. Of very many, no layout is found in any bearable time."""
    min_distance_m: NonNegative = 30.0
    """[m] At least this far from each start to its goal."""
    strangers: Annotated[int, Meta(ge=0, le=8)] = 0
    """[-] Up to so many vessels that give no way (`StrangerSettings`)."""
    harbour: tuple[Kind, ...] = ()
    """Harbours of these kinds in place of open water (`LandSettings`): they bring their own piles,
    starts, goals and ways; buoys and strangers are not for them."""
    weight: NonNegative = 1.0
    """[-] How often this row is drawn, relative to the others of a mixture."""


class MapSettings(Settings, frozen=True):
    """The water (the authors' code)."""

    size_m: Positive = 55.0
    """[m] The map is a square."""
    margin_m: NonNegative = 2.0
    """[m] Starts and goals keep this far from its edge."""
    clearance_m: NonNegative = 10.0
    """[m] Between any two starts, and between any two goals."""
    goals_on_starts: bool = True
    """Whether a start may lie on another vessel's goal; False keeps the clearance there too."""
    buoy_margin_m: NonNegative = 5.0
    """[m] Buoys' centres keep this far from the map's edge."""
    buoy_clearance_m: NonNegative = 10.0
    """[m] From a buoy's edge to any start or goal."""
    buoy_radius_m: Positive = 1.0
    """[m] VRX's light buoys have 0.75."""

    @property
    def side_m(self) -> float:
        """[m] Of the square in which starts and goals lie."""
        return self.size_m - 2 * self.margin_m


class StrangerKind(NamedTuple):
    """What strangers of a kind are like; ranges are (least, greatest)."""

    weight: float
    most: int
    length_m: tuple[float, float]
    speed_mps: tuple[float, float]


KINDS = (
    StrangerKind(2.0, 4, (2.0, 8.0), (0.3, 2.7)),  # of the own size
    StrangerKind(3.0, 4, (2.0, 12.0), (2.3, 6.0)),  # faster than the own vessel
    StrangerKind(2.5, 3, (8.0, 26.0), (0.3, 4.5)),  # ships
    StrangerKind(1.0, 5, (1.0, 16.0), (0.0, 0.0)),  # at anchor
    StrangerKind(1.5, 5, (1.0, 26.0), (0.0, 6.0)),  # anything
)


class StrangerSettings(Settings, frozen=True):
    """Vessels that give no way: they hold course and speed, or turn as they like."""

    outlined: Fraction = 0.5
    """[-] Share of the episodes in which their outlines are seen; else the circles around them."""
    turning: Fraction = 0.25
    """[-] Share of them that turn all the time,"""
    turn_rate_radps: NonNegative = 0.06
    """[rad/s] up to so fast."""
    spread_m: NonNegative = 3.0
    """[m] Standard deviation, along and across, of where they meet a vessel's straight way."""
    far_range_m: Positive = 60.0
    """[m] Each episode's range of sight lies anywhere between the environment's and this."""


class Strangers(NamedTuple):
    """N episodes with room for T strangers each."""

    place: Points
    """(N, T) [m]"""
    velocity: Points
    """(N, T) [m/s]"""
    half: Float64
    """(N, T, 2) [m] Half of length and beam; 0 where there is none."""
    heading: Float64
    """(N, T) [rad]"""
    turn: Float64
    """(N, T) [rad/s]"""
    outlined: Mask
    """(N, T)"""
    range_m: Float64
    """(N,) [m] How far is seen."""


class Scenarios(NamedTuple):
    """N episodes with room for V vessels and M buoys each."""

    start: Points
    """(N, V) [m]."""
    goal: Points
    """(N, V) [m]."""
    heading: Float64
    """(N, V) [rad]."""
    vessel: Mask
    """(N, V) Whether there is such a vessel."""
    buoy: Points
    """(N, M) [m]."""
    buoy_there: Mask
    """(N, M) Whether there is such a buoy."""
    buoy_radius: Float64
    """(N, M) [m]"""
    harbour: Index
    """(N, 2) Which row of the mixture draws its harbour, and the harbour's number; -1: none."""
    strangers: Strangers | None = None
    """Vessels that give no way, where any are asked for."""


class _Table(Settings, frozen=True):
    scenarios: tuple[ScenarioSettings, ...]


@lru_cache(maxsize=1)
def six_settings() -> tuple[ScenarioSettings, ...]:
    """Give the rows of the paper's table I (config/experiments/settings.toml)."""
    return load(shipped("experiments", "settings"), _Table).scenarios


def published_distance_m(robots: int) -> float:
    """Give the least distance [m] from start to goal that the paper uses with so many vessels."""
    rows = sorted(six_settings(), key=lambda row: row.robots)
    enough = (row.min_distance_m for row in rows if row.robots >= robots)
    return next(enough, rows[-1].min_distance_m)


def check(rows: Sequence[ScenarioSettings], area: MapSettings) -> None:
    """Refuse what can never be placed; raise `ConfigError` saying what is allowed."""
    if not rows or sum(row.weight for row in rows) <= 0.0:
        raise ConfigError("at least one scenario must have a positive weight", key="scenarios")
    if area.side_m <= 0.0 or area.size_m <= 2 * area.buoy_margin_m:
        raise ConfigError(f"the margins leave nothing of {area.size_m} m", key="map.size_m")
    diagonal = math.sqrt(2.0) * area.side_m
    # Discs of the clearance's diameter cannot be packed denser than pi / sqrt(12) (Thue).
    room = (area.side_m + area.clearance_m) ** 2 * math.pi / math.sqrt(12.0)
    each = math.pi * (area.clearance_m / 2) ** 2
    most = int(room / each) if each > 0.0 else None
    for row in rows:
        if row.harbour:
            if row.buoys or row.strangers:
                raise ConfigError("a harbour has piles of its own and no strangers", key="harbour")
            continue
        if row.min_distance_m > diagonal:
            raise ConfigError(
                f"{row.min_distance_m} m does not fit the map; allowed: up to {diagonal:.1f} m",
                key="min_distance_m",
            )
        if most is not None and row.robots > most:
            raise ConfigError(
                f"{row.robots} vessels {area.clearance_m} m apart do not fit a map of "
                f"{area.size_m} m; allowed: fewer than {most + 1}",
                key="robots",
            )


def sample(
    rows: Sequence[ScenarioSettings],
    row: Index,
    area: MapSettings,
    generators: Sequence[Generator],
    shape: tuple[int, int],
) -> Scenarios:
    """Draw one scenario a generator.

    Parameters
    ----------
    rows
        The mixture.
    row : (N,) int
        Which of them each episode follows.
    area
        The map.
    generators
        N of them; each episode uses its own only.
    shape
        V and M: how many vessels and buoys the arrays have room for.

    Raises
    ------
    ConfigError
        The vessels or buoys do not fit.
    """
    vessels, buoys = shape
    count = len(generators)
    result = Scenarios(
        start=np.zeros((count, vessels), complex),
        goal=np.zeros((count, vessels), complex),
        heading=np.zeros((count, vessels)),
        vessel=np.arange(vessels) < np.array([rows[k].robots for k in row])[:, None],
        buoy=np.zeros((count, buoys), complex),
        buoy_there=np.arange(buoys) < np.array([rows[k].buoys for k in row])[:, None],
        buoy_radius=np.full((count, buoys), area.buoy_radius_m),
        harbour=np.full((count, 2), -1),
    )
    distance = np.array([rows[k].min_distance_m for k in row])
    todo = np.flatnonzero([not rows[k].harbour for k in row])
    for _ in range(REDRAWS):
        if not todo.size:
            return result
        todo = todo[~_place(result, todo, distance, area, generators)]
        if not todo.size:
            return result
    worst = rows[row[todo[0]]]
    raise ConfigError(
        f"{worst.robots} vessels at least {worst.min_distance_m} m from their goals and "
        f"{worst.buoys} buoys do not fit a map of {area.size_m} m; ask for fewer",
        key="robots",
    )


def _place(
    into: Scenarios,
    episodes: Index,
    distance: Float64,
    area: MapSettings,
    generators: Sequence[Generator],
) -> Mask:
    """Draw these episodes, vessel by vessel, then buoy by buoy; tell which could be finished."""
    vessels, buoys = into.start.shape[1], into.buoy.shape[1]
    size = vessels + (vessels + buoys) * CANDIDATES * 4
    uniform = np.stack([generators[k].random(size) for k in episodes])
    into.heading[episodes] = (2 * uniform[:, :vessels] - 1) * np.pi
    first = uniform[:, vessels:].reshape(len(episodes), vessels + buoys, CANDIDATES, 4)
    good = np.ones(len(episodes), bool)
    for thing in range(vessels + buoys):
        there = into.vessel[:, thing] if thing < vessels else into.buoy_there[:, thing - vessels]
        todo = np.flatnonzero(good & there[episodes])
        draw = first[todo, thing]
        for _ in range(ROUNDS):
            if thing < vessels:
                found = _try_vessels(into, episodes[todo], thing, draw, distance, area)
            else:
                found = _try_buoys(into, episodes[todo], thing - vessels, draw, area)
            todo = todo[~found]
            if not todo.size:
                break
            draw = np.stack([generators[k].random((CANDIDATES, 4)) for k in episodes[todo]])
        good[todo] = False
    return good


def _try_vessels(
    into: Scenarios,
    episodes: Index,
    vessel: int,
    uniform: Float64,
    distance: Float64,
    area: MapSettings,
) -> Mask:
    """Place a vessel at the first candidate, (n, C, 4) in [0, 1), that fits, if one does."""
    start = _points(uniform[..., 0:2], area.margin_m, area.size_m)
    goal = _points(uniform[..., 2:4], area.margin_m, area.size_m)
    starts, goals = into.start[episodes, :vessel], into.goal[episodes, :vessel]
    fits = np.abs(start - goal) >= distance[episodes, None]
    fits &= _apart(start, starts, area.clearance_m) & _apart(goal, goals, area.clearance_m)
    if not area.goals_on_starts:
        fits &= _apart(start, goals, area.clearance_m) & _apart(goal, starts, area.clearance_m)
    return _take_first(fits, episodes, vessel, ((into.start, start), (into.goal, goal)))


def _try_buoys(
    into: Scenarios, episodes: Index, buoy: int, uniform: Float64, area: MapSettings
) -> Mask:
    """Place a buoy at the first candidate that fits, if one does."""
    centre = _points(uniform[..., 0:2], area.buoy_margin_m, area.size_m)
    clearance = area.buoy_radius_m + area.buoy_clearance_m
    fits = _apart(centre, into.buoy[episodes, :buoy], 2 * area.buoy_radius_m)
    there = into.vessel[episodes]
    for ends in (into.start, into.goal):
        fits &= _apart(centre, np.where(there, ends[episodes], np.inf), clearance)
    return _take_first(fits, episodes, buoy, ((into.buoy, centre),))


def _points(uniform: Float64, margin: float, size: float) -> Points:
    """Spread pairs of uniform numbers over the square [margin, size - margin]^2."""
    spread = margin + (size - 2 * margin) * uniform
    points: Points = spread[..., 0] + 1j * spread[..., 1]
    return points


def _apart(candidates: Points, placed: Points, distance: float) -> Mask:
    """Tell which candidates, (n, C), keep a distance from all those placed, (n, k)."""
    gaps = np.abs(candidates[:, :, None] - placed[:, None, :])
    return np.asarray((gaps >= distance).all(axis=2))


def _take_first(
    fits: Mask, episodes: Index, column: int, assignments: Sequence[tuple[Points, Points]]
) -> Mask:
    """Write the first fitting candidate of each episode into its column; tell who had one."""
    first = fits.argmax(axis=1)
    found = np.asarray(np.take_along_axis(fits, first[:, None], axis=1)[:, 0])
    for into, candidates in assignments:
        into[episodes[found], column] = candidates[found, first[found]]
    return found


def place_in_harbour(into: Scenarios, episode: int, row: int, number: int, one: Harbour) -> None:
    """Let an episode happen in a harbour, which is number `number` of a row of the mixture.

    Raises
    ------
    ConfigError
        It has more piles than there is room for.
    """
    count, piles = len(one.starts), len(one.piles)
    if piles > into.buoy.shape[1]:
        raise ConfigError(f"{piles} piles; allowed: up to {into.buoy.shape[1]}", key="harbour")
    into.start[episode, :count] = one.starts[:, 0] + 1j * one.starts[:, 1]
    into.heading[episode, :count] = one.starts[:, 2]
    into.goal[episode, :count] = one.goals[:, 0] + 1j * one.goals[:, 1]
    into.buoy[episode, :piles] = one.piles[:, 0] + 1j * one.piles[:, 1]
    into.buoy_there[episode] = np.arange(into.buoy.shape[1]) < piles
    into.buoy_radius[episode, :piles] = one.piles[:, 2]
    into.harbour[episode] = row, number


def draw_strangers(
    scenario: Scenarios,
    most: Index,
    settings: StrangerSettings,
    range_m: float,
    generators: Sequence[Generator],
    room: int,
) -> Strangers:
    """Draw vessels that give no way, aimed to meet the others on their ways.

    Parameters
    ----------
    scenario
        N episodes.
    most : (N,) int
        How many there are at most.
    settings
        What they are like.
    range_m
        [m] The environment's range of sight.
    generators
        N of them; each episode uses its own only.
    room
        T.
    """
    count = len(generators)
    found = Strangers(
        place=np.zeros((count, room), complex),
        velocity=np.zeros((count, room), complex),
        half=np.zeros((count, room, 2)),
        heading=np.zeros((count, room)),
        turn=np.zeros((count, room)),
        outlined=np.zeros((count, room), bool),
        range_m=np.full(count, range_m),
    )
    weights = np.cumsum([kind.weight for kind in KINDS])
    for n in np.flatnonzero(most > 0).tolist():
        g = generators[n]
        dice = g.random(4)
        kind = KINDS[int(np.searchsorted(weights, dice[0] * weights[-1], side="right"))]
        wanted = 1 + int(dice[1] * min(kind.most, most[n]))
        found.outlined[n] = dice[2] < settings.outlined
        found.range_m[n] += dice[3] * max(settings.far_range_m - range_m, 0.0)
        there = scenario.vessel[n]
        ways = scenario.start[n, there], scenario.goal[n, there]
        for t in range(wanted):
            _place_stranger(found, n, t, kind, settings, ways, g)
    return found


CLEAR_M, CLEAR_S = 9.0, 2.5
"""[m], [s] A stranger begins at least so far from every vessel, and as far as it sails in this."""
USUAL_MPS = 2.5
"""[m/s] About a vessel's mean speed on its way: when it is where a stranger is aimed."""


def _place_stranger(
    into: Strangers,
    n: int,
    t: int,
    kind: StrangerKind,
    settings: StrangerSettings,
    ways: tuple[Points, Points],
    g: Generator,
) -> None:
    """Place one stranger, unless no place is found in a few tries."""
    start, goal = ways
    u = g.random(6)
    length = kind.length_m[0] * (kind.length_m[1] / kind.length_m[0]) ** u[0]
    half = np.array([length, length * (0.2 + 0.4 * u[1])]) / 2
    speed = kind.speed_mps[0] + (kind.speed_mps[1] - kind.speed_mps[0]) * u[2]
    around = float(np.hypot(*half))
    turn = (2 * u[4] - 1) * settings.turn_rate_radps if u[3] < settings.turning and speed else 0.0
    for _ in range(8):
        u, spread = g.random(6), g.normal(0.0, settings.spread_m, 2)
        who = int(u[0] * len(start))
        way = goal[who] - start[who]
        meet = start[who] + u[1] * way + complex(*spread)
        after_s = 1.5 + u[1] * abs(way) / (USUAL_MPS * (0.75 + 0.5 * u[2]))
        course = 2 * np.pi * u[3]
        if u[4] < 0.25:  # head-on
            course = float(np.angle(-way)) + 0.3 * (u[3] - 0.5)
        elif u[4] < 0.35:  # overtaking or overtaken
            course = float(np.angle(way)) + 0.5 * (u[3] - 0.5)
        velocity = speed * np.exp(1j * course)
        if turn:  # sail the arc back
            place = meet - velocity * (1 - np.exp(-1j * turn * after_s)) / (1j * turn)
            course -= turn * after_s
            velocity = speed * np.exp(1j * course)
        else:
            place = meet - velocity * after_s
        clear = np.abs(start - place).min() - around
        if clear < CLEAR_M + CLEAR_S * speed:
            continue
        if speed < 0.2 and np.abs(goal - place).min() - around < CLEAR_M:
            continue
        into.place[n, t], into.velocity[n, t] = place, velocity
        into.half[n, t], into.heading[n, t], into.turn[n, t] = half, course, turn
        return
