"""Charts of other formats become a boat's GeoJSON: shapefiles and S-57 cells, read through GDAL.

GDAL (pyogrio) and PROJ (pyproj) are the extra `chart`; a boat carries neither. What is written is
what `runtime.charts.geojson` reads, and is read back with it before anybody gets it.
"""

from __future__ import annotations

import json
import math
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np

from twinscrew.runtime.charts.geojson import CLASSES, WGS84, ChartFile, read_geojson
from twinscrew.runtime.charts.static_map import KINDS, StaticMap
from twinscrew.runtime.datum import Datum, positions_N, to_degrees
from twinscrew.runtime.errors import ConfigError, TwinscrewError, one_of
from twinscrew.runtime.messages.types import Float64

MOST_BYTES: Final = 100_000_000
"""[B] A larger file is no chart of a harbour; it is refused before it is read."""
MOST_FEATURES: Final = 200_000
"""[-] Of all layers that count together."""
KEPT: Final = ("OBJNAM", "DRVAL1", "DRVAL2", "VALSOU", "RESTRN", "twinscrew", "class", "layer",
               "name", "depth_m", "radius_m", "width_m", "keep_in")  # fmt: skip
"""Attributes that are kept, where a file has them."""
LINE_WIDTH_M: Final = 1.0
"""[m] Of a line that says no width."""
COUNTS: Final = frozenset(CLASSES) | {"RESARE"}
"""Layers of an S-57 cell that are read; others forbid nothing."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Imported:
    """A chart that was made."""

    root: dict[str, Any]
    """The GeoJSON file's content."""
    chart: ChartFile
    """The same as a boat reads it, about `datum`."""
    datum: Datum
    """The middle of it."""
    places_before: int
    """[-] Before it was simplified."""
    places: int
    skipped: Mapping[str, int]
    """[-] Features of layers that forbid nothing."""


def import_chart(
    file: Path, *, kind: str = "", crs: str = "", simplify_m: float = 0.0, repair: bool = False
) -> Imported:
    """Read a chart, and make a boat's of it.

    Parameters
    ----------
    file
        GeoJSON, a shapefile, an S-57 cell, or whatever else GDAL reads.
    kind
        What all of it is, "land" for instance; empty: as its features say by their attributes
        `twinscrew`, `class` or `layer`, or their layer by its name.
    crs
        Its coordinate system, where the file does not say: "EPSG:4326".
    simplify_m
        [m] Outlines may grow by so much, and twice that at most, to have fewer places; what is
        forbidden stays forbidden. Points stay as they are.
    repair
        Whether outlines that cross themselves are repaired, not refused.

    Raises
    ------
    ConfigError
        It cannot be used; what in it, and what is allowed.
    TwinscrewError
        The extra `chart` is not installed.
    """
    if kind and kind not in KINDS:
        raise ConfigError(one_of(kind, KINDS), key="--as")
    skipped: Counter[str] = Counter()
    features = list(_features(file, kind, crs, skipped))
    if not features:
        left = ", ".join(sorted(skipped)) or "nothing at all"
        raise ConfigError(
            f"an empty chart: it holds {left}; --as says what all of it is", file=file
        )
    datum = _middle(features, file)
    before = sum(_count(one["geometry"]) for one in features)
    if simplify_m > 0.0:
        features = [_simplified(one, datum, simplify_m) for one in features]
    root = {"type": "FeatureCollection", "features": features}
    chart = read_geojson(json.dumps(root).encode(), file, datum, repair=repair)
    StaticMap.of(chart.features)
    if chart.repaired:
        root["features"] = features = [_repaired(one) for one in features]
    return Imported(
        root=root,
        chart=chart,
        datum=datum,
        places_before=before,
        places=sum(_count(one["geometry"]) for one in features),
        skipped=skipped,
    )


# -- Reading.


def _features(file: Path, kind: str, crs: str, skipped: Counter[str]) -> Iterator[dict[str, Any]]:
    """Give every feature that may forbid something, as GeoJSON in WGS 84."""
    pyogrio, pyproj = _libraries()
    try:
        size = file.stat().st_size
    except OSError as error:
        raise ConfigError(error.strerror or str(error), file=file) from error
    if size > MOST_BYTES:
        raise ConfigError(
            f"has {size / 1e6:.0f} MB; allowed are at most {MOST_BYTES / 1e6:g} MB: a cell of this "
            "scale is not for a harbour",
            file=file,
        )
    try:
        layers = [str(name) for name, _ in pyogrio.list_layers(file)]
        infos = {name: pyogrio.read_info(file, layer=name) for name in layers}
    except (pyogrio.errors.DataSourceError, pyogrio.errors.DataLayerError) as error:
        raise ConfigError(f"GDAL cannot read it: {error}", file=file) from error
    is_cell = any(name == "DSID" for name in layers)
    wanted = [name for name in layers if not is_cell or name.upper() in COUNTS]
    for name in layers:
        if name not in wanted:
            skipped[name] += max(1, infos[name]["features"])
    total = sum(infos[name]["features"] for name in wanted)
    if total > MOST_FEATURES:
        raise ConfigError(f"{total} features; at most {MOST_FEATURES} are read", file=file)
    for name in wanted:
        yield from _layer(file, name, kind, crs, pyogrio, pyproj)


def _layer(
    file: Path, layer: str, kind: str, crs: str, pyogrio: Any, pyproj: Any
) -> Iterator[dict[str, Any]]:
    from shapely import from_wkb, get_coordinates, is_missing, set_coordinates
    from shapely.geometry import mapping

    try:
        meta, _, wkb, columns = pyogrio.raw.read(file, layer=layer)
    except (pyogrio.errors.DataSourceError, pyogrio.errors.DataLayerError) as error:
        raise ConfigError(f"layer {layer}: GDAL cannot read it: {error}", file=file) from error
    if wkb is None or not len(wkb):
        return
    shapes = from_wkb(wkb)
    there = ~is_missing(shapes)
    told = crs or meta["crs"]
    if told is None:
        raise ConfigError(
            f"layer {layer} does not say its coordinate system: --crs EPSG:4326 if it is WGS 84",
            file=file,
        )
    shapes = shapes[there]
    if not WGS84.search(str(told)):
        try:
            turn = pyproj.Transformer.from_crs(told, "EPSG:4326", always_xy=True)
        except pyproj.exceptions.CRSError as error:
            raise ConfigError(f"its coordinate system {told!r}: {error}", file=file) from error
        places = get_coordinates(shapes)
        set_coordinates(shapes, np.stack(turn.transform(*places.T), axis=1))
    names = [str(name) for name in meta["fields"]]
    rows = zip(*(column[there] for column in columns), strict=True) if len(columns) else None
    for shape in shapes.tolist():
        values = dict(zip(names, next(rows), strict=True)) if rows is not None else {}
        properties = {key: _plain(values[key]) for key in KEPT if key in values}
        properties = {key: value for key, value in properties.items() if value not in (None, "")}
        if kind:
            properties["twinscrew"] = kind
        elif not {"twinscrew", "class", "layer"} & set(properties):
            properties["class"] = layer.upper()
        if shape.geom_type == "GeometryCollection":
            continue
        yield {"type": "Feature", "properties": properties, "geometry": _listed(mapping(shape))}


def _libraries() -> tuple[Any, Any]:
    try:
        import pyogrio
        import pyproj
    except ImportError as error:
        raise TwinscrewError(
            f"{error.name} is missing; it comes with the extra: pip install 'twinscrew[chart]'"
        ) from error
    return pyogrio, pyproj


def _plain(value: Any) -> Any:
    """Give a value as JSON has it; NaN, of an attribute that is not there, is None."""
    if isinstance(value, np.ndarray):
        return [_plain(one) for one in value.tolist()]
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


def _listed(geometry: Any) -> dict[str, Any]:
    """Turn tuples into lists, and leave heights out: what JSON would read back."""

    def flat(value: Any) -> Any:
        if value and isinstance(value[0], int | float):
            return [float(value[0]), float(value[1])]
        return [flat(one) for one in value]

    return {"type": geometry["type"], "coordinates": flat(geometry["coordinates"])}


def _count(geometry: Any) -> int:
    def places(value: Any) -> int:
        return 1 if isinstance(value[0], float) else sum(map(places, value))

    return places(geometry["coordinates"]) if geometry["coordinates"] else 0


def _middle(features: list[dict[str, Any]], file: Path) -> Datum:
    """Give the middle of everything; a `ConfigError` if places are no degrees."""
    from shapely import get_coordinates
    from shapely.geometry import shape

    places = np.concatenate([get_coordinates(shape(one["geometry"])) for one in features])
    if not len(places):
        raise ConfigError("an empty chart: its features have no places", file=file)
    low, high = places.min(axis=0), places.max(axis=0)
    if not ((low >= (-180.0, -90.0)).all() and (high <= (180.0, 90.0)).all()):
        raise ConfigError(
            f"its coordinates are no degrees (from {low.tolist()} to {high.tolist()}): --crs says "
            "which coordinate system it is in",
            file=file,
        )
    longitude, latitude = ((low + high) / 2.0).tolist()
    return Datum(latitude_deg=min(max(latitude, -89.0), 89.0), longitude_deg=longitude)


# -- Fewer places.


def _simplified(feature: dict[str, Any], datum: Datum, most_m: float) -> dict[str, Any]:
    """Let a feature have fewer places: it grows by at most twice `most_m`, and shrinks nowhere.

    Points and inclusion fences stay as they are; lines become wider by what they may be off.
    """
    from shapely import transform
    from shapely.geometry import mapping, shape

    properties, geometry = feature["properties"], shape(feature["geometry"])
    if "Point" in geometry.geom_type or properties.get("keep_in") or not geometry.is_valid:
        return feature
    flat = transform(geometry, lambda p: positions_N(datum, p[:, ::-1]))
    if "Line" in geometry.geom_type:
        flat = flat.simplify(most_m)
        width_m = float(properties.get("width_m", LINE_WIDTH_M)) + 2.0 * most_m
        properties = {**properties, "width_m": width_m}
    else:
        flat = flat.buffer(most_m, join_style="mitre").simplify(0.99 * most_m)

    def back(places: Float64) -> Float64:
        degrees = [to_degrees(datum, place) for place in places]
        return np.array([(longitude, latitude) for latitude, longitude in degrees])

    return {
        "type": "Feature",
        "properties": properties,
        "geometry": _listed(mapping(transform(flat, back))),
    }


def _repaired(feature: dict[str, Any]) -> dict[str, Any]:
    """Keep what an outline that crosses itself encloses."""
    from shapely import MultiPolygon, get_parts, is_valid, make_valid
    from shapely.geometry import mapping, shape

    geometry = shape(feature["geometry"])
    if is_valid(geometry):
        return feature
    made = get_parts(get_parts(make_valid(geometry))).tolist()
    polygons = MultiPolygon([part for part in made if part.geom_type == "Polygon"])
    return {**feature, "geometry": _listed(mapping(polygons))}


# -- A picture.

COLOURS: Final = {
    "land": "#e8d9a0",
    "keep_out": "#d89ac0",
    "depth": "#a9cfe0",
    "hazard": "#c0392b",
    "fence": "#7d5fa8",
}
"""Of each kind, after the colours of paper charts."""


def draw_chart(imported: Imported, path: Path, *, safety_depth_m: float = math.inf) -> None:
    """Draw a chart as a boat sees it, north up; deep water is left blue-white.

    Parameters
    ----------
    imported
        The chart.
    path
        The picture's file; its end says its format.
    safety_depth_m
        [m] Areas of less depth are drawn as forbidden; without it all of them.
    """
    from matplotlib.figure import Figure
    from matplotlib.patches import PathPatch
    from matplotlib.path import Path as Outline

    figure = Figure(figsize=(8.0, 8.0), layout="constrained")
    axes = figure.add_subplot()
    seen = set()
    for polygon in StaticMap.of(imported.chart.features, safety_depth_m=safety_depth_m).polygons:
        rings = [ring[:, ::-1] for ring in (polygon.ring, *polygon.holes)]
        outline = Outline.make_compound_path(*(Outline(ring, closed=True) for ring in rings))
        label = None if polygon.kind in seen else polygon.kind.replace("_", "-")
        seen.add(polygon.kind)
        colour = COLOURS[polygon.kind]
        fill = "none" if polygon.keep_in else colour
        patch = PathPatch(outline, facecolor=fill, edgecolor=colour, linewidth=0.8, label=label)
        axes.add_patch(patch)
    axes.autoscale_view()
    axes.set_aspect("equal")
    axes.set_facecolor("#eef6fa")
    middle = imported.datum
    where = f"{middle.latitude_deg:.5f}, {middle.longitude_deg:.5f}"
    axes.set_xlabel(f"east of {where} [m]")
    axes.set_ylabel("north [m]")
    if seen:
        axes.legend(loc="best")
    figure.savefig(path, dpi=120)
