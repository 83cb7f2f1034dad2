"""Drawing scenarios for many episodes at once.

Rejection sampling as the paper's generator (parameters.md, Training environment): start and goal of
a vessel are drawn together, uniformly, until they keep their distances from those placed before.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from twinscrew.runtime.errors import ConfigError
from twinscrew.training.scenarios import MapSettings, Mask, Points, Scenarios, ScenarioSettings

CANDIDATES = 32
"""[-] Drawn at a time for one vessel or buoy."""
ROUNDS = 32
"""[-] So many times, before the whole episode is drawn anew."""
REDRAWS = 8
"""[-] So many times, before the request counts as impossible."""


def sample(
    rows: Sequence[ScenarioSettings],
    row: NDArray[np.intp],
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
    )
    distance = np.array([rows[k].min_distance_m for k in row])
    todo = np.arange(count)
    for _ in range(REDRAWS):
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
    episodes: NDArray[np.intp],
    distance: NDArray[np.float64],
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
    episodes: NDArray[np.intp],
    vessel: int,
    uniform: NDArray[np.float64],
    distance: NDArray[np.float64],
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
    into: Scenarios,
    episodes: NDArray[np.intp],
    buoy: int,
    uniform: NDArray[np.float64],
    area: MapSettings,
) -> Mask:
    """Place a buoy at the first candidate that fits, if one does."""
    centre = _points(uniform[..., 0:2], area.buoy_margin_m, area.size_m)
    clearance = area.buoy_radius_m + area.buoy_clearance_m
    fits = _apart(centre, into.buoy[episodes, :buoy], 2 * area.buoy_radius_m)
    there = into.vessel[episodes]
    for ends in (into.start, into.goal):
        fits &= _apart(centre, np.where(there, ends[episodes], np.inf), clearance)
    return _take_first(fits, episodes, buoy, ((into.buoy, centre),))


def _points(uniform: NDArray[np.float64], margin: float, size: float) -> Points:
    """Spread pairs of uniform numbers over the square [margin, size - margin]^2."""
    spread = margin + (size - 2 * margin) * uniform
    points: Points = spread[..., 0] + 1j * spread[..., 1]
    return points


def _apart(candidates: Points, placed: Points, distance: float) -> Mask:
    """Tell which candidates, (n, C), keep a distance from all those placed, (n, k)."""
    gaps = np.abs(candidates[:, :, None] - placed[:, None, :])
    return np.asarray((gaps >= distance).all(axis=2))


def _take_first(
    fits: Mask,
    episodes: NDArray[np.intp],
    column: int,
    assignments: Sequence[tuple[Points, Points]],
) -> Mask:
    """Write the first fitting candidate of each episode into its column; tell who had one."""
    first = fits.argmax(axis=1)
    found = np.asarray(np.take_along_axis(fits, first[:, None], axis=1)[:, 0])
    for into, candidates in assignments:
        into[episodes[found], column] = candidates[found, first[found]]
    return found
