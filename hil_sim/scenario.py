"""Who starts where and goes where, among what, in which sea and current.

North and east are counted from a corner of the map. Scenarios are data (config/scenarios): drawn at
random as the paper's, drawn as a harbour (`training.harbours`), or written out.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from dataclasses import replace as changed
from pathlib import Path
from typing import Annotated, Any, NamedTuple, get_args

import numpy as np
from msgspec import Meta
from msgspec.structs import replace

from twinscrew.hil_sim import random_scenario
from twinscrew.hil_sim.random_scenario import Coordinate, RandomSettings, from_quays
from twinscrew.hil_sim.traffic import TrafficEntry
from twinscrew.runtime.charts.static_map import Area, Disc, Feature, Outline, StaticMap
from twinscrew.runtime.errors import ConfigError, one_of
from twinscrew.runtime.messages.types import Float64
from twinscrew.runtime.settings import NonNegative, Positive, Settings, load, shipped
from twinscrew.runtime.vessel.hull_settings import goal_radius
from twinscrew.runtime.vessel.trial import room_m
from twinscrew.runtime.vessel_description import DEFAULT, load_vessel
from twinscrew.training import encounters
from twinscrew.training.harbours import (
    STILL,
    CurrentField,
    HarbourSettings,
    Kind,
    draw_harbour,
)

Point = tuple[Coordinate, Coordinate]


class Land(NamedTuple):
    """A polygon of land, or of a quay that is no box."""

    outline: Float64
    """[m] [N] (M, 2) Its corners, in either direction."""
    height_m: float
    """[m] Over the water at rest; a LiDAR sees its walls, and its top from above."""
    name: str = ""


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
    land: tuple[Land, ...] = ()
    """What a LiDAR sees as walls, and a chart as land."""
    piles: Float64 = field(default_factory=lambda: np.empty((0, 4)))
    """[m] [N] (P, 4) North, east, radius, height over the water: posts, which no chart shows."""
    charted: tuple[Feature, ...] = ()
    """Keep-out areas, depths, hazards and fences: no sensor sees them, a chart shows them."""
    current: CurrentField = STILL
    """Beside the sea's steady current."""
    kind: str = ""
    """What was drawn, where a scenario is one of several kinds."""

    @property
    def chart(self) -> StaticMap:
        """Everything that a chart shows: land, quays, and what is `charted`."""
        quays = [Area(kind="land", outline=corners_of(box), name="quay") for box in self.quays]
        return StaticMap.of([*land_areas(self.land), *quays, *self.charted])

    @property
    def outlines(self) -> tuple[Outline, ...]:
        """What a picture shows of land and of what is charted, whatever its depth; no quays."""
        features = [*land_areas(self.land), *self.charted]
        return StaticMap.of(features, safety_depth_m=math.inf).polygons

    def flow(self, most: int) -> Float64:
        """Give arrows of the current at the beginning: (K, 4) [m, m/s] north, east and velocity.

        At most `most` of them along the longer side of the map; none in still water.
        """
        if not (self.current.mean.any() or self.current.vortex.any()):
            return np.empty((0, 4))
        step = max(self.map_size) / most
        north, east = (np.arange(0.5 * step, side, step) for side in self.map_size)
        places = np.stack(np.meshgrid(north, east, indexing="ij"), axis=-1).reshape(-1, 2)
        return np.column_stack([places, self.current.velocity(places, 0.0)])

    @property
    def circles(self) -> Float64:
        """[m] [N] (B + P, 3) North, east, radius of buoys, then piles."""
        return np.concatenate([self.buoys, self.piles[:, :3]])

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


Corners = Annotated[tuple[Point, ...], Meta(min_length=3)]
"""[m] [N] North, east of a polygon's corners; the last is joined to the first."""


class LandEntry(Settings, frozen=True, kw_only=True):
    """Land, or a quay of any outline."""

    outline_m: Corners
    height_m: Positive = 2.0
    """[m] Over the water at rest."""
    name: str = ""


class KeepOutEntry(Settings, frozen=True, kw_only=True):
    """An area that nobody may enter and no sensor sees."""

    outline_m: Corners
    name: str = ""


class DepthEntry(Settings, frozen=True, kw_only=True):
    """An area of water of a depth: a vessel of more draught runs aground there."""

    outline_m: Corners
    depth_m: Coordinate
    """[m] Least depth of water; negative where it dries."""
    name: str = ""


class HazardEntry(Settings, frozen=True, kw_only=True):
    """A rock or wreck under water: charted, and seen by no sensor."""

    centre_m: Point
    radius_m: Positive
    name: str = ""


class FenceEntry(Settings, frozen=True, kw_only=True):
    """A fence as an autopilot has it: a polygon, or a circle; to stay out of it, or within it."""

    outline_m: Corners | None = None
    centre_m: Point | None = None
    radius_m: Positive | None = None
    keep_in: bool = False
    """True: the vessels must stay within it."""
    name: str = ""

    def __post_init__(self) -> None:
        """Refuse what is neither a polygon nor a circle, or both."""
        circle = (self.centre_m is not None, self.radius_m is not None)
        if circle[0] != circle[1] or circle[0] == (self.outline_m is not None):
            raise ValueError("give either outline_m, or centre_m and radius_m")


class PileEntry(Settings, frozen=True, kw_only=True):
    """A post that stands in the water; no chart shows it."""

    centre_m: Point
    radius_m: Positive = 0.3
    height_m: Positive = 2.5
    """[m] Over the water at rest."""


class VortexEntry(Settings, frozen=True, kw_only=True):
    """Water that turns around a place."""

    centre_m: Point
    core_m: Positive
    """[m] It is fastest so far from the centre."""
    peak_mps: float
    """[m/s] There; clockwise seen from above if positive."""


class CurrentTable(Settings, frozen=True, kw_only=True):
    """Currents; they add up. See `training.harbours.CurrentField`."""

    mean_mps: tuple[float, float] = (0.0, 0.0)
    """[m/s] [N] Towards north and east."""
    centre_m: Point = (0.0, 0.0)
    """[m] [N] A sheared current has its mean on the line through this place;"""
    shear: Annotated[float, Meta(ge=-1.0, le=1.0)] = 0.0
    """[-] to starboard of it, looking downstream, it is faster by up to this part."""
    shear_width_m: Positive = 10.0
    """[m] From the line to where three quarters of the change are reached."""
    tide_period_s: Positive | None = None
    """[s] The mean swings as a cosine of this period; None: steady."""
    tide_phase_deg: float = 0.0
    """[deg] Of the cosine when the scenario begins."""
    vortex: tuple[VortexEntry, ...] = ()

    def field(self) -> CurrentField:
        """Give the field."""
        return CurrentField.of(
            self.mean_mps,
            centre=self.centre_m,
            shear=self.shear,
            width=self.shear_width_m,
            period=self.tide_period_s or math.inf,
            phase=math.radians(self.tide_phase_deg),
            vortex=[(*v.centre_m, v.core_m, v.peak_mps) for v in self.vortex],
        )


class ScenarioFile(Settings, frozen=True, kw_only=True):
    """A scenario as people write it: `random`, `harbour`, or vessels one by one."""

    map_size_m: tuple[Positive, Positive] = (55.0, 55.0)
    sea: str = "paper"
    time_limit_s: Positive = 90.0
    goal_radius_m: Positive | None = None
    """[m] None: 0.4 of the longest vessel's length, at least 0.5 m."""
    random: RandomSettings | None = None
    harbour: HarbourSettings | None = None
    """A harbour drawn from the seed, sized for the longest vessel (its `length_m`, `beam_m` and
    `vessels` are those of what sails); its size takes the place of `map_size_m`."""
    current_share: NonNegative | None = None
    """[-] With `harbour`: the drawn current's speed over the slowest vessel's top speed."""
    vessel: tuple[VesselEntry, ...] = ()
    buoy: tuple[BuoyEntry, ...] = ()
    quay: tuple[QuayEntry, ...] = ()
    traffic: tuple[TrafficEntry, ...] = ()
    land: tuple[LandEntry, ...] = ()
    keep_out: tuple[KeepOutEntry, ...] = ()
    depth: tuple[DepthEntry, ...] = ()
    hazard: tuple[HazardEntry, ...] = ()
    fence: tuple[FenceEntry, ...] = ()
    pile: tuple[PileEntry, ...] = ()
    current: CurrentTable = CurrentTable()


FIXED = ("buoy", "quay", "land", "keep_out", "depth", "hazard", "fence", "pile")
"""Tables of a `ScenarioFile` that say what is fixed."""


def harbour_of(case: str, seed: int) -> ScenarioFile:  # noqa: ARG001  (other series use the seed)
    """Give `harbour:KIND`: the shipped harbours, of one kind only."""
    kinds = get_args(Kind)
    if case not in kinds:
        raise ConfigError(one_of(case, kinds), key="harbour")
    file = load(shipped("scenarios", "harbour"), ScenarioFile)
    return replace(file, harbour=replace(file.harbour or HarbourSettings(), kinds=(case,)))


def current_of(case: str, seed: int) -> ScenarioFile:  # noqa: ARG001
    """Give `current:SHARE`: the shipped currents, at this part of the vessels' top speed."""
    try:
        share = float(case)
    except ValueError:
        share = math.nan
    if not 0.0 <= share < 1.0:
        raise ConfigError(f"current:{case}: a number from 0 to below 1, as current:0.3")
    return replace(load(shipped("scenarios", "current"), ScenarioFile), current_share=share)


MEETING_UNIT_M, MEETING_UNIT_MPS = 40.0, 2.5
"""[m], [m/s] The scale of `dnv:CASE`: the own way in 15 minutes there is 8 lengths of the default
vessel here, as in Imazu's encounters, and the own speed there about its speed here."""


class _Situation(Settings, frozen=True, kw_only=True):
    name: str
    others: Annotated[
        tuple[tuple[float, float, float, Annotated[float, Meta(gt=0.0)]], ...], Meta(min_length=1)
    ]
    """North, east of the own vessel, course [deg], speed; in units of the own way and speed."""


class _Situations(Settings, frozen=True, kw_only=True):
    situation: Annotated[tuple[_Situation, ...], Meta(min_length=1)]


def dnv_situations() -> tuple[str, ...]:
    """Give the names of the 55 base situations, in order: `dnv:1` is the first."""
    return tuple(one.name for one in _dnv())


def _dnv() -> tuple[_Situation, ...]:
    return load(shipped("meetings", "dnv"), _Situations).situation


def dnv_of(case: str, seed: int) -> ScenarioFile:  # noqa: ARG001  (the situations are fixed)
    """Give `dnv:CASE`: a base situation of DNV's trafficgen (config/meetings/dnv.toml)."""
    situation = _dnv()[_number("dnv", case, len(_dnv())) - 1]
    others = [
        encounters.Other(
            (MEETING_UNIT_M * north, MEETING_UNIT_M * east),
            course,
            MEETING_UNIT_MPS * speed,
            5.0,
            2.5,
        )
        for north, east, course, speed in situation.others
    ]
    own = encounters.Own((0.0, 0.0), 0.0, (2.0 * MEETING_UNIT_M, 0.0))
    return _meeting(encounters.Encounter(own, tuple(others)))


def imazu_of(case: str, seed: int) -> ScenarioFile:  # noqa: ARG001
    """Give `imazu:CASE`: one of Imazu's 22 encounters (`training.encounters`)."""
    return _meeting(encounters.imazu(_number("imazu", case, len(encounters.IMAZU))))


def traffic_of(case: str, seed: int) -> ScenarioFile:
    """Give `traffic:SET`: an episode drawn as `twinscrew evaluate --traffic SET` draws them."""
    return _meeting(encounters.draw_traffic(case, 1, seed).episodes[0])


def _number(series: str, case: str, most: int) -> int:
    if not case.isdecimal() or not 1 <= int(case) <= most:
        raise ConfigError(f"{series}:{case}: a number from 1 to {most}, as {series}:1")
    return int(case)


def _meeting(encounter: encounters.Encounter) -> ScenarioFile:
    """Give a scenario of one own vessel among ships that hold course and speed."""
    own = encounter.own
    ends = np.array([own.start_m, own.goal_m])
    corner = ends.min(axis=0) - MEETING_MARGIN_M
    size = np.ptp(ends, axis=0) + 2.0 * MEETING_MARGIN_M

    def place(there: tuple[float, float]) -> Point:
        north, east = (np.array(there) - corner).tolist()
        return north, east

    return ScenarioFile(
        map_size_m=(float(size[0]), float(size[1])),
        vessel=(
            VesselEntry(
                start_m=place(own.start_m), heading_deg=own.heading_deg, goal_m=place(own.goal_m)
            ),
        ),
        traffic=tuple(
            TrafficEntry(
                start_m=place(other.start_m),
                course_deg=other.course_deg,
                speed_mps=other.speed_mps,
                length_m=other.length_m,
                beam_m=other.beam_m,
            )
            for other in encounter.others
        ),
    )


MEETING_MARGIN_M = 15.0
"""[m] Of water that a picture shows around the own way of a meeting."""

SERIES: dict[str, Callable[[str, int], ScenarioFile]] = {
    "dnv": dnv_of,
    "imazu": imazu_of,
    "traffic": traffic_of,
    "harbour": harbour_of,
    "current": current_of,
}
"""Scenarios that are named SERIES:CASE, as `harbour:gap`: from case and seed to a scenario."""


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
        As "random", "head_on", "harbour:gap" (`SERIES`), or "my/scenario.toml".
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
    series, _, case = str(name).partition(":")
    if case and series in SERIES:
        path, file, called = Path(str(name)), SERIES[series](case, seed), str(name)
    else:
        path = shipped("scenarios", name)
        file, called = load(path, ScenarioFile), path.stem
    try:
        scenario = _make(called, file, vessels, buoys, seed, types)
        _require_water(scenario)
    except ConfigError as error:
        raise ConfigError(str(error), file=path) from error
    return scenario


def on_trial(scenario: Scenario, trial: str, time_s: float) -> Scenario:
    """Give open water for a scenario's vessels to sail a trial in, each far from the others.

    Sea, current and vessels stay; all that is fixed, and goals, are gone. Every vessel heads north.

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
        land=(),
        piles=np.empty((0, 4)),
        charted=(),
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
    ways = (file.random is not None, file.harbour is not None, bool(file.vessel))
    if sum(ways) != 1:
        raise ConfigError("give either [random], or [harbour], or at least one [[vessel]]")
    _require_sea(file.sea)
    if file.current_share is not None and file.harbour is None:
        raise ConfigError("only with [harbour]; else [current]", key="current_share")
    if file.harbour is not None:
        return _harbour(name, file, file.harbour, vessels, buoys, seed, types or [DEFAULT])
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
    """Refuse vessels that begin, or are to go, where a quay stands, or where no vessel may be."""
    chart = scenario.chart
    places = {"start": scenario.starts[:, :2], "goal": scenario.goals}
    for what, places_N in places.items():
        for vessel, quay in np.argwhere(from_quays(places_N, scenario.quays) == 0.0):
            raise ConfigError(
                f"the {what} of {scenario.names[vessel]} lies within quay {quay + 1}", key="quay"
            )
        for vessel in np.flatnonzero(chart.forbidden(places_N)):
            why = chart.why(places_N[vessel])
            raise ConfigError(f"the {what} of {scenario.names[vessel]} lies {why}", key=what)


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
    fixed = StaticMap.of([*land_areas(_land(file)), *_charted(file)])
    starts, goals, buoy_rows = random_scenario.draw(
        settings, vessels, buoys, np.random.default_rng(seed), _quays(file), fixed
    )
    limits = np.full(vessels, math.inf)
    arrays = {"starts": starts, "goals": goals, "buoys": buoy_rows}
    return _scenario(name, file, types, limits=limits, **arrays)


def _harbour(
    name: str,
    file: ScenarioFile,
    settings: HarbourSettings,
    vessels: int | None,
    buoys: int | None,
    seed: int,
    types: Sequence[str],
) -> Scenario:
    """Draw a harbour that fits the longest hull."""
    for table in FIXED:
        if getattr(file, table):
            raise ConfigError(f"a drawn harbour has its own: remove [[{table}]]", key=table)
    if buoys:
        raise ConfigError("a drawn harbour has piles instead of buoys", key="buoys")
    count = settings.vessels if vessels is None else vessels
    hulls = [load_vessel(kind) for kind in types]
    longest = max(hulls, key=lambda hull: hull.length_m)
    settings = replace(
        settings,
        vessels=count,
        length_m=longest.length_m,
        beam_m=max(hull.beam_m for hull in hulls),
    )
    if file.current_share is not None:
        speed = file.current_share * min(hull.top_speed_mps for hull in hulls)
        settings = replace(settings, current_mps=(speed, speed))
    drawn = draw_harbour(np.random.default_rng(seed), settings)
    areas = [Area(kind="keep_out", outline=ring) for ring in drawn.keep_out]
    if drawn.fence is not None:
        areas.append(Area(kind="fence", outline=drawn.fence, keep_in=True))
    heights = np.full(len(drawn.piles), drawn.height_m)
    scenario = _scenario(
        name,
        file,
        types,
        limits=np.full(count, math.inf),
        starts=drawn.starts,
        goals=drawn.goals,
        buoys=np.empty((0, 3)),
    )
    return changed(
        scenario,
        land=tuple(Land(ring, drawn.height_m) for ring in drawn.land),
        piles=np.column_stack([drawn.piles, heights]),
        charted=tuple(areas),
        current=drawn.current,
        map_size=drawn.size_m,
        kind=drawn.kind,
    )


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
        land=_land(file),
        piles=_rows([(*pile.centre_m, pile.radius_m, pile.height_m) for pile in file.pile], 4),
        charted=_charted(file),
        current=file.current.field(),
        **arrays,
    )


def _land(file: ScenarioFile) -> tuple[Land, ...]:
    return tuple(Land(np.array(e.outline_m), e.height_m, e.name) for e in file.land)


def _charted(file: ScenarioFile) -> tuple[Feature, ...]:
    """Give what only a chart shows."""
    found: list[Feature] = [
        Area(kind="keep_out", outline=np.array(e.outline_m), name=e.name) for e in file.keep_out
    ]
    found += [
        Area(kind="depth", outline=np.array(e.outline_m), depth_m=e.depth_m, name=e.name)
        for e in file.depth
    ]
    found += [
        Disc(kind="hazard", centre=e.centre_m, radius_m=e.radius_m, name=e.name)
        for e in file.hazard
    ]
    for e in file.fence:
        if e.outline_m is not None:
            outline = np.array(e.outline_m)
            found.append(Area(kind="fence", outline=outline, keep_in=e.keep_in, name=e.name))
        elif e.centre_m is not None and e.radius_m is not None:
            circle = Disc(
                kind="fence",
                centre=e.centre_m,
                radius_m=e.radius_m,
                keep_in=e.keep_in,
                name=e.name,
            )
            found.append(circle)
    return tuple(found)


AROUND_M = 300.0
"""[m] What an inclusion fence forbids is given to the vessels as far as this around the map."""


def as_chart(scenario: Scenario) -> dict[str, Any]:
    """Give a scenario's chart as the table `[chart]` of a vessel's configuration.

    Circles are polygons there; what lies outside of an inclusion fence is a keep-out area with the
    fence as its hole.
    """
    quays = [{"outline_m": _plain(corners_of(box)), "name": "quay"} for box in scenario.quays]
    land = [{"outline_m": _plain(each.outline), "name": each.name} for each in scenario.land]
    found: dict[str, Any] = {"land": [*land, *quays], "keep_out": [], "depth": [], "hazard": []}
    for feature in scenario.charted:
        if feature.kind == "hazard" and isinstance(feature, Disc):
            north, east = feature.centre
            found["hazard"].append(
                {
                    "north_m": north,
                    "east_m": east,
                    "radius_m": feature.radius_m,
                    "name": feature.name,
                }
            )
            continue
        outline = _plain(_outline(feature))
        if feature.kind == "depth" and isinstance(feature, Area):
            row = {"outline_m": outline, "depth_m": feature.depth_m, "name": feature.name}
            found["depth"].append(row)
        elif feature.keep_in:
            far = corners_of(
                np.array(
                    [
                        *(0.5 * np.array(scenario.map_size)),
                        *(np.array(scenario.map_size) + 2.0 * AROUND_M),
                        0.0,
                        0.0,
                    ]
                )
            )
            name = feature.name or "fence"
            found["keep_out"].append({"outline_m": _plain(far), "holes_m": [outline], "name": name})
        else:
            found["keep_out"].append({"outline_m": outline, "name": feature.name})
    return found


def _outline(feature: Feature) -> Float64:
    """Give a feature's polygon: of a forbidden circle around it, of an inclusion fence within."""
    if isinstance(feature, Area):
        return feature.outline
    turn = np.arange(32) * (2.0 * np.pi / 32)
    radius = feature.radius_m / (1.0 if feature.keep_in else math.cos(np.pi / 32))
    return np.asarray(feature.centre + radius * np.column_stack([np.cos(turn), np.sin(turn)]))


def _plain(ring: Float64) -> list[list[float]]:
    return [[float(north), float(east)] for north, east in ring]


def land_areas(land: Sequence[Land]) -> list[Area]:
    """Give land as a chart has it."""
    return [Area(kind="land", outline=each.outline, name=each.name) for each in land]


def corners_of(box: Float64) -> Float64:
    """Give the corners, (4, 2) [m], of a quay as `Scenario.quays` has it."""
    north, east, length, width, _, heading = (float(value) for value in box)
    c, s = math.cos(heading), math.sin(heading)
    local = np.array([(1, 1), (1, -1), (-1, -1), (-1, 1)]) * (length / 2, width / 2)
    return np.asarray(local @ np.array([[c, s], [-s, c]]) + (north, east))


def _quays(file: ScenarioFile) -> Float64:
    return _rows([(*q.centre_m, *q.size_m, math.radians(q.heading_deg)) for q in file.quay], 6)


def _rows(rows: Sequence[tuple[float, ...]], width: int) -> Float64:
    return np.array(rows, dtype=np.float64).reshape(-1, width)
