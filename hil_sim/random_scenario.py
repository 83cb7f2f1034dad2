"""Random starts, goals and buoys, as the paper's generator draws them, in a bounded time."""

from __future__ import annotations

import math
from typing import Annotated

import numpy as np
from msgspec import Meta
from numpy.random import Generator
from numpy.typing import NDArray

from twinscrew.hil_sim.contacts import distance_to_box
from twinscrew.runtime.charts.static_map import StaticMap
from twinscrew.runtime.errors import ConfigError
from twinscrew.runtime.messages.types import Float64
from twinscrew.runtime.settings import NonNegative, Settings

Coordinate = Annotated[float, Meta(ge=-1e7, le=1e7)]
"""[m] North or east of the origin; beyond a quarter of the earth nobody believes an odometry."""
Interval = tuple[Coordinate, Coordinate]

Vessels = Annotated[int, Meta(ge=1, le=20)]
Buoys = Annotated[int, Meta(ge=0, le=50)]
"""[-] As many as `sitl` takes; of very many, no layout is found in any bearable time."""

CANDIDATES = 512
"""[-] Tries for one vessel or buoy before everything is drawn afresh."""
LAYOUTS = 100
"""[-] Fresh starts before the request is called impossible."""
NO_QUAYS = np.empty((0, 6))


class RandomSettings(Settings, frozen=True, kw_only=True):
    """How scenarios are drawn. The defaults are the paper's, or else its public code's."""

    vessels: Vessels = 3
    """[-] How many vessels, unless asked for otherwise."""
    buoys: Buoys = 0
    """[-] How many buoys, unless asked for otherwise."""
    vessel_area_m: Interval = (2.0, 53.0)
    """[m] Starts and goals lie between these, north and east."""
    buoy_area_m: Interval = (5.0, 50.0)
    """[m] Centres of buoys lie between these, north and east."""
    start_gap_m: NonNegative = 10.0
    """[m] Least distance between two starts."""
    goal_gap_m: NonNegative = 10.0
    """[m] Least distance between two goals."""
    start_to_other_goals_m: NonNegative = 0.0
    """[m] Least distance of a start from the others' goals; none, as published."""
    min_distance_m: Annotated[tuple[NonNegative, ...], Meta(min_length=1)] = (30, 30, 30, 35, 40)
    """[m] Least distance from start to goal with 1, 2, ... vessels; the last holds for more."""
    buoy_radius_m: NonNegative = 0.75
    """[m] Collision radius of a buoy: 0.75 in the experiments, 1.0 in training."""
    buoy_gap_m: NonNegative = 10.0
    """[m] Least distance from a buoy's edge to every start and goal."""
    quay_gap_m: NonNegative = 5.0
    """[m] Least distance from a quay to every start and goal; at least half the longest hull."""

    def __post_init__(self) -> None:
        """Refuse an area without extent."""
        for low, high in (self.vessel_area_m, self.buoy_area_m):
            if not low < high:
                raise ValueError(f"an area must go from low to high, not from {low} to {high}")


class _NoPlaceError(Exception):
    """Nothing fits beside what was drawn before."""


def draw(
    settings: RandomSettings,
    vessels: int,
    buoys: int,
    rng: Generator,
    quays: Float64 = NO_QUAYS,
    fixed: StaticMap | None = None,
) -> tuple[Float64, Float64, Float64]:
    """Draw starts (V, 3), goals (V, 2) and buoys (B, 3): north, east [m], heading or radius.

    Quays are given as a scenario has them, (Q, 6); `fixed` is land and what else is forbidden:
    nothing is placed on them, and no vessel nearer to them than `quay_gap_m`. Everything is uniform
    where it may lie, headings too. If one thing finds no place beside those drawn before, all are
    drawn afresh: without that, five vessels often leave no place for buoys.

    Raises
    ------
    ConfigError
        No layout was found: too many for the map.
    """
    shores = _Shores(quays, fixed or StaticMap.empty())
    for _ in range(LAYOUTS):
        try:
            starts, goals = _draw_vessels(settings, vessels, rng, shores)
            centres = _draw_buoys(settings, buoys, np.concatenate([starts, goals]), rng, shores)
        except _NoPlaceError:
            continue
        headings = rng.uniform(-math.pi, math.pi, vessels)
        radii = np.full(buoys, settings.buoy_radius_m)
        return np.column_stack([starts, headings]), goals, np.column_stack([centres, radii])
    low, high = settings.vessel_area_m
    ashore = f", {settings.quay_gap_m:g} m from every quay" if shores.any else ""
    raise ConfigError(
        f"no place found for {vessels} vessels and {buoys} buoys: starts {settings.start_gap_m:g} m"
        f" and goals {settings.goal_gap_m:g} m apart, {_min_distance(settings, vessels):g} m from "
        f"start to goal{ashore}, all between {low:g} and {high:g} m; ask for fewer, or allow less "
        "distance"
    )


class _Shores:
    """Quays, and what else is fixed."""

    def __init__(self, quays: Float64, fixed: StaticMap) -> None:
        self._quays, self._fixed = quays, fixed
        self.any = bool(len(quays)) or not fixed.is_empty

    def distance_m(self, places_N: Float64) -> Float64:
        """Give how far places, (n, 2), are from the nearest shore, (n,) [m]; 0 on it."""
        quays = from_quays(places_N, self._quays).min(axis=1, initial=np.inf)
        return np.asarray(np.minimum(quays, self._fixed.distance_m(places_N)))


def _draw_vessels(
    settings: RandomSettings, count: int, rng: Generator, shores: _Shores
) -> tuple[Float64, Float64]:
    (low, high), starts, goals = settings.vessel_area_m, np.empty((0, 2)), np.empty((0, 2))
    for _ in range(count):
        candidates = rng.uniform(low, high, (CANDIDATES, 2, 2))
        start, goal = candidates[:, 0], candidates[:, 1]
        fits = np.hypot(*(goal - start).T) >= _min_distance(settings, count)
        fits &= _clear(start, starts, settings.start_gap_m)
        fits &= _clear(goal, goals, settings.goal_gap_m)
        fits &= _clear(start, goals, settings.start_to_other_goals_m)
        fits &= _clear(goal, starts, settings.start_to_other_goals_m)
        for place in (start, goal):
            if shores.any:
                fits &= shores.distance_m(place) >= settings.quay_gap_m
        first = _first(fits)
        starts, goals = np.vstack([starts, start[first]]), np.vstack([goals, goal[first]])
    return starts, goals


def _draw_buoys(
    settings: RandomSettings, count: int, ports: Float64, rng: Generator, shores: _Shores
) -> Float64:
    (low, high), centres, radius = settings.buoy_area_m, np.empty((0, 2)), settings.buoy_radius_m
    for _ in range(count):
        candidates = rng.uniform(low, high, (CANDIDATES, 2))
        fits = _clear(candidates, ports, radius + settings.buoy_gap_m)
        fits &= _clear(candidates, centres, 2 * radius)
        if shores.any:
            fits &= shores.distance_m(candidates) >= radius
        centres = np.vstack([centres, candidates[_first(fits)]])
    return centres


def from_quays(places_N: Float64, quays: Float64) -> Float64:
    """Give how far places, (n, 2), are from quays, (Q, 6), as (n, Q) [m]; 0 on them."""
    none = np.empty((len(places_N), 0))
    return np.column_stack([none, *(distance_to_box(places_N, quay) for quay in quays)])


def _min_distance(settings: RandomSettings, vessels: int) -> float:
    distances = settings.min_distance_m
    return distances[min(vessels, len(distances)) - 1]


def _clear(candidates: Float64, others: Float64, gap: float) -> NDArray[np.bool_]:
    """Tell which candidates, (n, 2), lie at least `gap` from all others, (m, 2)."""
    offset = candidates[:, None] - others[None]
    crowded: NDArray[np.bool_] = np.hypot(offset[..., 0], offset[..., 1]) < gap
    clear: NDArray[np.bool_] = np.logical_not(crowded.any(axis=1))
    return clear


def _first(fits: NDArray[np.bool_]) -> int:
    if not fits.any():
        raise _NoPlaceError
    return int(np.argmax(fits))
