"""Who starts where and goes where, among which buoys and quays, in which sea.

North and east are counted from a corner of the map. Scenarios are data (config/scenarios): either
drawn at random as the paper's, or written out.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from dataclasses import replace as changed
from pathlib import Path
from typing import Any

import numpy as np
from msgspec.structs import replace

from twinscrew.hil_sim import random_scenario
from twinscrew.hil_sim.random_scenario import Coordinate, RandomSettings, from_quays
from twinscrew.hil_sim.traffic import TrafficEntry
from twinscrew.runtime.errors import ConfigError
from twinscrew.runtime.messages.types import Float64
from twinscrew.runtime.settings import NonNegative, Positive, Settings, load, shipped
from twinscrew.runtime.vessel.hull_settings import goal_radius
from twinscrew.runtime.vessel.trial import room_m
from twinscrew.runtime.vessel_description import DEFAULT, load_vessel

Point = tuple[Coordinate, Coordinate]


@dataclass(frozen=True, slots=True, kw_only=True)
class Scenario:
    """One episode's beginning."""

    name: str
    names: tuple[str, ...]
    """(V,) The vessels' names: wamv1, wamv2, ..."""
    types: tuple[str, ...]
    """(V,) What each is: names in config/vessels, or files."""
    starts: Float64
    """[m, rad] [N] (V, 3) North, east, heading."""
    goals: Float64
    """[m] [N] (V, 2) North, east."""
    thrust_limits: Float64
    """[N] (V,) The most either propeller gives, ahead or astern; infinite for a sound vessel."""
    buoys: Float64
    """[m] [N] (B, 3) North, east, collision radius."""
    quays: Float64
    """[m, rad] [N] (Q, 6) North, east of the centre; length, width, height; heading."""
    map_size: tuple[float, float]
    """[m] North, east: what a picture shows. It is no wall."""
    sea: str
    """Name or file of the sea (config/sea)."""
    time_limit_s: float
    """[s] A vessel under way longer than this has failed."""
    goal_radius: float
    """[m] A vessel whose origin is this near its goal has arrived."""
    traffic: tuple[TrafficEntry, ...] = ()
    """(T,) Scripted ships, which give way to nobody."""

    @property
    def vessels(self) -> int:
        """[-] How many vessels."""
        return len(self.names)


class VesselEntry(Settings, frozen=True, kw_only=True):
    """A vessel of a scenario that is written out."""

    type: str = DEFAULT
    """A name in config/vessels, or a file."""
    start_m: Point
    """[m] [N] North, east."""
    heading_deg: float
    """[deg] [N] Clockwise from north."""
    goal_m: Point
    """[m] [N] North, east."""
    thrust_limit_n: Positive = math.inf
    """[N] The most either propeller gives: a vessel with weak engines is slow."""


class BuoyEntry(Settings, frozen=True, kw_only=True):
    """A buoy."""

    centre_m: Point
    """[m] [N] North, east."""
    radius_m: NonNegative = 0.75
    """[m] Collision radius."""


class QuayEntry(Settings, frozen=True, kw_only=True):
    """A quay or a moored barge: a fixed box that stands in the water."""

    centre_m: Point
    """[m] [N] North, east."""
    size_m: tuple[Positive, Positive, Positive]
    """[m] Length, width, height over the water at rest."""
    heading_deg: float = 0.0
    """[deg] [N] Of its length, clockwise from north."""


class ScenarioFile(Settings, frozen=True, kw_only=True):
    """A scenario as people write it: `random`, or vessels one by one."""

    map_size_m: tuple[Positive, Positive] = (55.0, 55.0)
    sea: str = "paper"
    time_limit_s: Positive = 90.0
    goal_radius_m: Positive | None = None
    """[m] None: 0.4 of the longest vessel's length, at least 0.5 m."""
    random: RandomSettings | None = None
    vessel: tuple[VesselEntry, ...] = ()
    buoy: tuple[BuoyEntry, ...] = ()
    quay: tuple[QuayEntry, ...] = ()
    traffic: tuple[TrafficEntry, ...] = ()


def load_scenario(
    name: str | Path,
    vessels: int | None = None,
    buoys: int | None = None,
    seed: int = 0,
    types: Sequence[str] = (),
) -> Scenario:
    """Read a scenario: the name of a shipped one, or the path of a file.

    Parameters
    ----------
    name : str or Path
        As "random", "head_on", or "my/scenario.toml".
    vessels, buoys : int, optional
        How many; the file says it if not given. A scenario that is written out has as many as it
        has.
    seed : int
        What a random scenario is drawn from.
    types : sequence of str
        What sails, in turn, whatever the file says: names in config/vessels, or files.

    Raises
    ------
    ConfigError
        No such scenario, a file that cannot be used, or a request that cannot be met.
    """
    path = shipped("scenarios", name)
    file = load(path, ScenarioFile)
    try:
        scenario = _make(path.stem, file, vessels, buoys, seed, types)
        _require_water(scenario)
    except ConfigError as error:
        raise ConfigError(str(error), file=path) from error
    return scenario


def on_trial(scenario: Scenario, trial: str, time_s: float) -> Scenario:
    """Give open water for a scenario's vessels to sail a trial in, each far from the others.

    Sea and vessels stay; buoys, quays and goals are gone. Every vessel heads north.

    Parameters
    ----------
    trial
        As "zigzag": how much water each one needs.
    time_s
        [s] How long the trial may last; the scenario's limit is a minute more, to brake.
    """
    room = max(room_m(trial, load_vessel(kind)) for kind in scenario.types)
    starts = np.zeros((scenario.vessels, 3))
    starts[:, 0] = room
    starts[:, 1] = room + 8.0 * room * np.arange(scenario.vessels)
    return changed(
        scenario,
        name=f"trial {trial}",
        starts=starts,
        goals=starts[:, :2].copy(),
        buoys=np.empty((0, 3)),
        quays=np.empty((0, 6)),
        traffic=(),
        map_size=(2.0 * room, float(starts[-1, 1]) + room),
        time_limit_s=time_s + 60.0,
    )


def _make(
    name: str,
    file: ScenarioFile,
    vessels: int | None,
    buoys: int | None,
    seed: int,
    types: Sequence[str],
) -> Scenario:
    if (file.random is None) == (not file.vessel):
        raise ConfigError("give either [random], or at least one [[vessel]]")
    _require_sea(file.sea)
    if file.random is None:
        _require_count("vessels", vessels, len(file.vessel))
        _require_count("buoys", buoys, len(file.buoy))
        return _written(name, file, types or [vessel.type for vessel in file.vessel])
    return _random(name, file, file.random, vessels, buoys, seed, types or [DEFAULT])


def _require_sea(sea: str) -> None:
    try:
        shipped("sea", sea)
    except ConfigError as error:
        raise ConfigError(str(error), key="sea") from error


def _require_water(scenario: Scenario) -> None:
    """Refuse vessels that begin, or are to go, where a quay stands."""
    places = {"start": scenario.starts[:, :2], "goal": scenario.goals}
    for what, places_N in places.items():
        for vessel, quay in np.argwhere(from_quays(places_N, scenario.quays) == 0.0):
            raise ConfigError(
                f"the {what} of {scenario.names[vessel]} lies within quay {quay + 1}", key="quay"
            )


def _require_count(what: str, asked: int | None, there: int) -> None:
    if asked is not None and asked != there:
        raise ConfigError(f"this scenario has {there} {what}, not {asked}", key=what)


def _random(
    name: str,
    file: ScenarioFile,
    settings: RandomSettings,
    vessels: int | None,
    buoys: int | None,
    seed: int,
    types: Sequence[str],
) -> Scenario:
    if file.buoy:
        raise ConfigError("a random scenario draws its buoys: remove [[buoy]]", key="buoy")
    vessels = settings.vessels if vessels is None else vessels
    buoys = settings.buoys if buoys is None else buoys
    for what, count, least in (("vessels", vessels, 1), ("buoys", buoys, 0), ("seed", seed, 0)):
        if count < least:
            raise ConfigError(f"must be at least {least}, got {count}", key=what)
    half_m = max(load_vessel(kind).length_m for kind in types) / 2
    settings = replace(settings, quay_gap_m=max(settings.quay_gap_m, half_m))
    starts, goals, buoy_rows = random_scenario.draw(
        settings, vessels, buoys, np.random.default_rng(seed), _quays(file)
    )
    limits = np.full(vessels, math.inf)
    arrays = {"starts": starts, "goals": goals, "buoys": buoy_rows}
    return _scenario(name, file, types, limits=limits, **arrays)


def _written(name: str, file: ScenarioFile, types: Sequence[str]) -> Scenario:
    return _scenario(
        name,
        file,
        types,
        starts=_rows([(*v.start_m, math.radians(v.heading_deg)) for v in file.vessel], 3),
        goals=_rows([v.goal_m for v in file.vessel], 2),
        limits=np.array([v.thrust_limit_n for v in file.vessel]),
        buoys=_rows([(*b.centre_m, b.radius_m) for b in file.buoy], 3),
    )


def _scenario(
    name: str, file: ScenarioFile, types: Sequence[str], *, limits: Float64, **arrays: Any
) -> Scenario:
    each = tuple(types[i % len(types)] for i in range(len(limits)))
    longest = max(load_vessel(kind).length_m for kind in each)
    return Scenario(
        name=name,
        names=tuple(f"wamv{i + 1}" for i in range(len(limits))),
        types=each,
        thrust_limits=limits,
        quays=_quays(file),
        traffic=file.traffic,
        map_size=file.map_size_m,
        sea=file.sea,
        time_limit_s=file.time_limit_s,
        goal_radius=file.goal_radius_m or goal_radius(longest),
        **arrays,
    )


def _quays(file: ScenarioFile) -> Float64:
    return _rows([(*q.centre_m, *q.size_m, math.radians(q.heading_deg)) for q in file.quay], 6)


def _rows(rows: Sequence[tuple[float, ...]], width: int) -> Float64:
    return np.array(rows, dtype=np.float64).reshape(-1, width)
