"""The chart of a boat: its settings, what they make a map of, and its message.

A chart is a GeoJSON file, or areas written straight into the configuration, or both. Fences come
over MAVLink (`ground.fences`) and join them.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from pathlib import Path
from typing import Annotated, Final

import numpy as np
from msgspec import Meta

from twinscrew.runtime.charts.geojson import MOST_BYTES, SMALLER, ChartFile, read_geojson
from twinscrew.runtime.charts.static_map import Area, Disc, Feature, StaticMap
from twinscrew.runtime.datum import Datum
from twinscrew.runtime.errors import ConfigError, MessageError
from twinscrew.runtime.files import read_file
from twinscrew.runtime.messages.types import Chart, ChartFeature
from twinscrew.runtime.settings import NonNegative, Positive, Settings

UNDER_KEEL_M: Final = 0.5
"""[m] Of water under what is described of the hull, where no safety depth is set: the blades of the
propellers, waves, and the error of a charted depth."""
Ring = Annotated[tuple[tuple[float, float], ...], Meta(min_length=3)]
"""[m] [N] Places, each (north, east)."""


class AreaTable(Settings, frozen=True):
    """An area in frame N."""

    outline_m: Ring
    """[m] [N] Its corners, each (north, east)."""
    holes_m: tuple[Ring, ...] = ()
    """[m] [N] What is cut out of it."""
    name: str = ""
    """What people call it; for messages."""


class DepthTable(AreaTable, frozen=True):
    """Water of a depth."""

    depth_m: float | None = None
    """[m] The least depth in it; none: not known, it is forbidden."""


class HazardTable(Settings, frozen=True):
    """A rock, a buoy or a pile."""

    north_m: float
    """[m] [N]"""
    east_m: float
    """[m] [N]"""
    radius_m: Positive
    """[m]"""
    name: str = ""
    """What people call it; for messages."""


class ChartSettings(Settings, frozen=True):
    """What is fixed around the boat (docs/charts.md)."""

    file: str = ""
    """A GeoJSON file (RFC 7946), as `twinscrew chart import` writes; empty: none. It needs a datum,
    as [autopilot] has it."""
    safety_depth_m: NonNegative | None = None
    """[m] Charted water of less depth is forbidden; none: the hull's draught and 0.5 m."""
    hazard_radius_m: Positive = 3.0
    """[m] Of the file's point hazards that do not say theirs: rocks, wrecks, piles, buoys."""
    line_width_m: Positive = 1.0
    """[m] Of the file's lines that do not say theirs: quay walls, coast lines."""
    repair: bool = False
    """Whether the file's outlines that cross themselves are repaired, not refused."""
    autopilot_fences: bool = True
    """Whether the fences that the autopilot holds count; those that a ground station uploads to the
    companion always do. They need a datum."""
    from_scenario: bool = True
    """In a simulation: whether the scenario's land, keep-out areas, depths and hazards are charted;
    if not, the vessels meet them unprepared."""
    land: tuple[AreaTable, ...] = ()
    """Land, quays, islands."""
    keep_out: tuple[AreaTable, ...] = ()
    """Areas that nobody may enter."""
    depth: tuple[DepthTable, ...] = ()
    """Water of known depth."""
    hazard: tuple[HazardTable, ...] = ()
    """Points that nobody may come near."""


def safety_depth_m(settings: ChartSettings, draught_m: float) -> float:
    """[m] Charted water of less depth is forbidden."""
    if settings.safety_depth_m is not None:
        return settings.safety_depth_m
    return draught_m + UNDER_KEEL_M


def read_chart(settings: ChartSettings, datum: Datum | None) -> ChartFile:
    """Read what a configuration says is fixed: its file and its own areas.

    Raises
    ------
    ConfigError
        The file cannot be used, or there is no datum.
    """
    written = tuple(_written(settings))
    if not settings.file:
        return ChartFile(written)
    file = Path(settings.file)
    if datum is None:
        raise ConfigError(
            "needs the place of frame N on the earth: [autopilot.datum]", key="chart.file"
        )
    try:
        content = read_file(file, MOST_BYTES)
    except OSError as error:
        raise ConfigError(error.strerror or str(error), file=file, key="chart.file") from error
    except ConfigError as error:
        raise ConfigError(f"{error}; {SMALLER}", key="chart.file") from error
    read = read_geojson(
        content,
        file,
        datum,
        hazard_radius_m=settings.hazard_radius_m,
        line_width_m=settings.line_width_m,
        repair=settings.repair,
    )
    return ChartFile((*read.features, *written), read.ignored, read.far, read.repaired)


def _written(settings: ChartSettings) -> Iterable[Feature]:
    """Give the areas and points of a configuration."""
    for kind, tables in (("land", settings.land), ("keep_out", settings.keep_out)):
        for table in tables:
            yield _area(kind, table)
    for table in settings.depth:
        yield _area("depth", table, -math.inf if table.depth_m is None else table.depth_m)
    for hazard in settings.hazard:
        place = (hazard.north_m, hazard.east_m)
        yield Disc(kind="hazard", centre=place, radius_m=hazard.radius_m, name=hazard.name)


def _area(kind: str, table: AreaTable, depth_m: float = -math.inf) -> Area:
    return Area(
        kind=kind,  # type: ignore[arg-type]
        outline=np.array(table.outline_m),
        holes=tuple(np.array(hole) for hole in table.holes_m),
        depth_m=depth_m,
        name=table.name,
    )


# -- The map as a message: recorded when it changes, so that a replay has the same one.


def as_message(chart: StaticMap, stamp_ns: int) -> Chart:
    """Give the message that holds a map."""
    features = tuple(
        ChartFeature(
            kind=feature.kind,
            keep_in=feature.keep_in,
            depth_m=feature.depth_m,
            radius_m=feature.radius_m if isinstance(feature, Disc) else 0.0,
            name=feature.name,
            outline_N=np.array([feature.centre]) if isinstance(feature, Disc) else feature.outline,
            holes_N=() if isinstance(feature, Disc) else feature.holes,
        )
        for feature in chart.features
    )
    return Chart(stamp_ns=stamp_ns, safety_depth_m=chart.safety_depth_m, features=features)


def as_map(message: Chart) -> StaticMap:
    """Give the map that a message holds.

    Raises
    ------
    MessageError
        No map can be made of it.
    """
    try:
        features = map(_feature, message.features)
        return StaticMap.of(features, safety_depth_m=message.safety_depth_m)
    except ConfigError as error:
        raise MessageError(f"not a chart: {error}") from error


def _feature(given: ChartFeature) -> Feature:
    if given.radius_m == 0.0:
        return Area(
            kind=given.kind,  # type: ignore[arg-type]
            outline=given.outline_N,
            holes=given.holes_N,
            keep_in=given.keep_in,
            depth_m=given.depth_m,
            name=given.name,
        )
    if len(given.outline_N) != 1:
        raise MessageError(f"not a chart: a circle with {len(given.outline_N)} centres")
    north, east = given.outline_N[0].tolist()
    return Disc(
        kind=given.kind,  # type: ignore[arg-type]
        centre=(north, east),
        radius_m=given.radius_m,
        keep_in=given.keep_in,
        depth_m=given.depth_m,
        name=given.name,
    )
