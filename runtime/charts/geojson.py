"""Charts as GeoJSON (RFC 7946): places on the earth become features in frame N.

What a feature is says its property `twinscrew` (land, keep_out, depth, hazard, fence, ignore), or
its class by the names of S-57, the standard of electronic charts, in `class` or `layer` (LNDARE,
DEPARE, UWTROC, ...). Nothing is repaired in silence: what cannot be meant is refused, and the error
names the file, the feature, counted from 1, and the ring.

Sources: RFC 7946; IHO S-57 edition 3.1, appendix A, for classes and attributes.
"""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

import msgspec
import numpy as np

from twinscrew.runtime.charts.static_map import (
    FARTHEST_M,
    KINDS,
    MOST_VERTICES,
    Area,
    Disc,
    Feature,
    Kind,
)
from twinscrew.runtime.datum import Datum, positions_N, to_degrees
from twinscrew.runtime.errors import NOT_THE_FORMAT, ConfigError, one_of
from twinscrew.runtime.messages.types import Float64

MOST_BYTES: Final = 16_000_000
"""[B] Of a chart on a boat."""
FAR_M: Final = 50_000.0
"""[m] A chart of which nothing is nearer to the datum is not a chart of this place; features that
far away are left out."""
SMALLER: Final = "make it smaller: twinscrew chart import FILE --out map.geojson --simplify-m 1"

CLASSES: Final[Mapping[str, Kind]] = {
    # Land, and what is built on it or into the water.
    **dict.fromkeys(
        ("LNDARE", "COALNE", "SLCONS", "FLODOC", "PONTON", "HULKES", "DAMCON", "GATCON",
         "DYKCON", "CAUSWY", "PYLONS", "DRYDOC", "ICEARE"), "land"
    ),
    # Water of a depth.
    **dict.fromkeys(("DEPARE", "DRGARE", "UNSARE"), "depth"),
    # What one can run into.
    **dict.fromkeys(
        ("OBSTRN", "UWTROC", "WRECKS", "PILPNT", "MORFAC", "OFSPLF", "FSHFAC", "LITFLT", "LITVES",
         "BOYCAR", "BOYINB", "BOYISD", "BOYLAT", "BOYSAW", "BOYSPP",
         "BCNCAR", "BCNISD", "BCNLAT", "BCNSAW", "BCNSPP", "CRANES", "FNCLNE", "LOGPON"), "hazard"
    ),
    "MARCUL": "keep_out",
}  # fmt: skip
"""What becomes of the classes of S-57; all other classes forbid nothing."""
ENTRY_PROHIBITED: Final = 7
"""Attribute RESTRN of a restricted area, RESARE: nobody may enter."""
SOUNDED: Final = frozenset({"OBSTRN", "UWTROC", "WRECKS"})
"""Classes whose attribute VALSOU is the depth of water over them."""
_CLASS = re.compile(r"[A-Za-z_$]{6}")
WGS84: Final = re.compile(r"(CRS:?84|EPSG:{1,2}4326)$")
"""Ends the names of the one coordinate system that GeoJSON has."""


@dataclass(frozen=True, slots=True)
class ChartFile:
    """What was read of a chart."""

    features: tuple[Feature, ...]
    ignored: Mapping[str, int] = field(default_factory=dict)
    """[-] How many features of each class forbid nothing."""
    far: int = 0
    """[-] How many features lie farther than `FAR_M` from the datum and were left out."""
    repaired: int = 0
    """[-] How many outlines crossed themselves and were repaired, where that was asked for."""


def read_geojson(
    content: bytes,
    file: Path,
    datum: Datum,
    *,
    hazard_radius_m: float = 3.0,
    line_width_m: float = 1.0,
    repair: bool = False,
) -> ChartFile:
    """Read a chart.

    Parameters
    ----------
    content, file
        What is in the file, and its name for errors.
    datum
        Where frame N lies on the earth.
    hazard_radius_m
        [m] Of points that do not say their `radius_m`.
    line_width_m
        [m] Of lines that do not say their `width_m`.
    repair
        Whether outlines that cross themselves are repaired (the area that is enclosed stays)
        instead of refused.

    Raises
    ------
    ConfigError
        It is no GeoJSON, too large, of another place or coordinate system, empty, or a feature
        cannot be meant.
    """
    features = features_of(content, file)
    read = _Reader(file, datum, hazard_radius_m, line_width_m, repair=repair)
    _check_place(features, file, datum)
    found = tuple(one for number, given in enumerate(features, 1) for one in read(given, number))
    if not found:
        ignored = ", ".join(sorted(read.ignored)) or "nothing at all"
        allowed = f"{', '.join(KINDS)}, or classes of S-57 as LNDARE, DEPARE"
        raise ConfigError(
            f"an empty chart: it holds {ignored}; what counts is {allowed}", file=file
        )
    return ChartFile(found, dict(read.ignored), read.far, read.repaired)


def features_of(content: bytes, file: Path) -> list[Any]:
    """Give the features of a GeoJSON file as plain values, their number and places counted.

    Raises
    ------
    ConfigError
        It is none, or holds more than a boat's chart may.
    """
    try:
        root = msgspec.json.decode(content)
    except (*NOT_THE_FORMAT, msgspec.DecodeError) as error:
        raise ConfigError(f"not GeoJSON: {error}", file=file) from error
    if not isinstance(root, dict) or root.get("type") not in ("FeatureCollection", "Feature"):
        found = root.get("type") if isinstance(root, dict) else type(root).__name__
        raise ConfigError(
            f"not a chart: {one_of(found, ('FeatureCollection', 'Feature'))}", file=file, key="type"
        )
    _check_crs(root, file)
    features = root.get("features") if root["type"] == "FeatureCollection" else [root]
    if not isinstance(features, list):
        raise ConfigError("expected a list", file=file, key="features")
    places = sum(_count(one.get("geometry")) for one in features if isinstance(one, dict))
    if places > MOST_VERTICES:
        raise ConfigError(
            f"{places} places; allowed are at most {MOST_VERTICES}: {SMALLER}", file=file
        )
    return features


def _check_crs(root: dict[str, Any], file: Path) -> None:
    """Refuse what GeoJSON of 2008 could have: another coordinate system."""
    crs = root.get("crs")
    if crs is None:
        return
    properties = crs.get("properties") if isinstance(crs, dict) else None
    name = properties.get("name") if isinstance(properties, dict) else None
    if not (isinstance(name, str) and WGS84.search(name)):
        raise ConfigError(
            f"its coordinate system is {name!r}; allowed is WGS 84, longitude and latitude in "
            "degrees (RFC 7946): convert it with twinscrew chart import",
            file=file,
            key="crs",
        )


def _count(geometry: object) -> int:
    """Count a geometry's places, without recursion: a file may nest deeper than functions can."""
    if not isinstance(geometry, dict):
        return 0
    places, pending = 0, [geometry.get("coordinates")]
    while pending:
        value = pending.pop()
        if isinstance(value, list) and value:
            if isinstance(value[0], list):
                pending += value
            else:
                places += 1
    return places


def _float(value: float) -> float:
    """Give a number of JSON, which has integers that are too large, as one that can be checked."""
    try:
        return float(value)
    except OverflowError:
        return math.inf


def _places(geometry: object) -> Iterator[tuple[float, float]]:
    """Give latitude and longitude of every place of a geometry that is one."""
    pending = [geometry.get("coordinates")] if isinstance(geometry, dict) else []
    while pending:
        value = pending.pop()
        if isinstance(value, list) and value:
            if isinstance(value[0], list):
                pending += value
            elif len(value) >= 2 and all(isinstance(v, int | float) for v in value[:2]):
                yield _float(value[1]), _float(value[0])


def _check_place(features: list[Any], file: Path, datum: Datum) -> None:
    """Refuse a chart of another place, whose coordinates are no degrees, or are exchanged."""
    geometries = (one.get("geometry") for one in features if isinstance(one, dict))
    degrees = np.array([place for one in geometries for place in _places(one)]).reshape(-1, 2)
    if not len(degrees):
        return
    nearest_m = _nearest_m(datum, degrees)
    if nearest_m <= FAR_M:
        return
    here = f"autopilot.datum (latitude {datum.latitude_deg:g}, longitude {datum.longitude_deg:g})"
    if _nearest_m(datum, degrees[:, ::-1]) <= FAR_M:
        raise ConfigError(
            f"latitude and longitude are exchanged: read the other way round it lies at {here}; "
            "RFC 7946 has the longitude first",
            file=file,
        )
    if not math.isfinite(nearest_m):
        latitude, longitude = degrees[0].tolist()
        raise ConfigError(
            f"its coordinates are no degrees (the first are {longitude:g}, {latitude:g}): is it in "
            "another coordinate system? Convert it with twinscrew chart import",
            file=file,
        )
    raise ConfigError(
        f"nothing of it is within {FAR_M / 1e3:g} km of {here}: the nearest place is "
        f"{nearest_m / 1e3:.0f} km away",
        file=file,
    )


def _nearest_m(datum: Datum, degrees: Float64) -> float:
    """[m] Of the nearest place; infinite if none is on the earth."""
    on_earth = degrees[(np.abs(degrees) <= (90.0, 180.0)).all(axis=1)]
    if not len(on_earth):
        return math.inf
    return float(np.hypot(*positions_N(datum, on_earth).T).min())


class _Reader:
    """Reads one feature after another, and counts what it left out."""

    def __init__(
        self, file: Path, datum: Datum, radius_m: float, width_m: float, *, repair: bool
    ) -> None:
        self.ignored: Counter[str] = Counter()
        self.far = 0
        self.repaired = 0
        self._file, self._datum, self._repair = file, datum, repair
        self._radius_m, self._width_m = radius_m, width_m
        self._key = ""

    def __call__(self, given: object, number: int) -> Iterator[Feature]:
        """Give what a feature forbids: nothing, or several areas and circles."""
        self._key = f"features[{number}]"
        if not isinstance(given, dict) or given.get("type") != "Feature":
            raise self._refuse("expected a Feature")
        properties = given.get("properties") or {}
        if not isinstance(properties, dict):
            raise self._refuse("expected an object", "properties")
        geometry = given.get("geometry")
        if geometry is None:
            return
        kind, depth_m = self._kind(properties)
        if kind is None:
            return
        name = str(properties.get("name") or properties.get("OBJNAM") or "")[:60]
        keep_in = properties.get("keep_in", False)
        if not isinstance(keep_in, bool) or (keep_in and kind != "fence"):
            raise self._refuse(
                f"got {keep_in!r}; true or false, and true for a fence alone", "properties.keep_in"
            )
        for shape in self._shapes(geometry, properties):
            if isinstance(shape, _Circle):
                centre = (shape.north_m, shape.east_m)
                feature: Feature = Disc(
                    kind=kind,
                    centre=centre,
                    radius_m=shape.radius_m,
                    keep_in=keep_in,
                    depth_m=depth_m,
                    name=name,
                )
            else:
                outline, *holes = shape
                feature = Area(
                    kind=kind,
                    outline=outline,
                    holes=tuple(holes),
                    keep_in=keep_in,
                    depth_m=depth_m,
                    name=name,
                )
            if _is_far(feature) and not keep_in:
                self.far += 1
            elif isinstance(feature, Area) and np.abs(feature.outline).max() > FARTHEST_M:
                raise self._refuse(
                    f"it comes near, and has places more than {FARTHEST_M / 1e3:g} km away: cut it "
                    "to the water around autopilot.datum",
                    "geometry.coordinates",
                )
            else:
                yield feature

    def _refuse(self, words: str, key: str = "") -> ConfigError:
        return ConfigError(words, file=self._file, key=f"{self._key}.{key}" if key else self._key)

    # -- What it is.

    def _kind(self, properties: dict[str, Any]) -> tuple[Kind | None, float]:
        """Give a feature's kind, None if it forbids nothing, and its depth [m]."""
        said = properties.get("twinscrew")
        if said is not None:
            if said == "ignore":
                self.ignored["ignore"] += 1
                return None, -math.inf
            for known in KINDS:
                if said == known:
                    return known, self._depth(properties, "depth_m")
            raise self._refuse(one_of(said, (*KINDS, "ignore")), "properties.twinscrew")
        name = properties.get("class") or properties.get("layer")
        if name is None:
            raise self._refuse(
                f"nothing says what it is: expected the property twinscrew, {', '.join(KINDS)} or "
                "ignore, or class, a class of S-57"
            )
        if not (isinstance(name, str) and _CLASS.fullmatch(name)):
            raise self._refuse(
                f"got {name!r}; expected a class of S-57, as LNDARE", "properties.class"
            )
        name = name.upper()
        if name == "RESARE" and str(ENTRY_PROHIBITED) in _listed(properties.get("RESTRN")):
            return "keep_out", -math.inf
        kind = CLASSES.get(name)
        if kind is None:
            self.ignored[name] += 1
        elif name in SOUNDED and properties.get("VALSOU") is not None:
            return "depth", self._depth(properties, "VALSOU")
        return kind, self._depth(properties, "DRVAL1") if kind == "depth" else -math.inf

    def _depth(self, properties: dict[str, Any], key: str) -> float:
        """Read a depth [m]; where it is not known there may be none."""
        value = properties.get(key)
        if value is None:
            return -math.inf
        return self._number(value, f"properties.{key}", -100.0, 12_000.0)

    def _number(self, value: object, key: str, least: float, most: float) -> float:
        try:
            number = float(value) if isinstance(value, int | float | str) else math.nan
        except (ValueError, OverflowError):
            number = math.nan
        if isinstance(value, bool) or not least <= number <= most:
            raise self._refuse(f"got {value!r}; allowed is {least:g} to {most:g} m", key)
        return number

    # -- Where it is.

    def _shapes(self, geometry: object, properties: dict[str, Any]) -> Iterator[Any]:
        if not isinstance(geometry, dict):
            raise self._refuse("expected an object", "geometry")
        kind, given = geometry.get("type"), geometry.get("coordinates")
        single = str(kind).removeprefix("Multi")
        if single not in ("Point", "LineString", "Polygon") or not isinstance(given, list):
            allowed = (n + g for g in ("Point", "LineString", "Polygon") for n in ("", "Multi"))
            raise self._refuse(one_of(kind, allowed) + ", with coordinates", "geometry.type")
        parts = given if str(kind).startswith("Multi") else [given]
        for part in parts:
            if single == "Point":
                north, east = self._line([part], "a point")[0].tolist()
                radius = properties.get("radius_m", self._radius_m)
                radius_m = self._number(radius, "properties.radius_m", 0.01, FAR_M)
                yield _Circle(north, east, radius_m)
            elif single == "LineString":
                yield from self._strip(self._line(part, "a line"), properties)
            else:
                yield from self._polygon(part)

    def _line(self, given: object, what: str) -> Float64:
        """Give the positions, (K, 2) [m] [N], of a list of [longitude, latitude, ...]."""
        if not isinstance(given, list) or not given:
            raise self._refuse(f"{what} has no places", "geometry.coordinates")
        degrees = np.empty((len(given), 2))
        for index, place in enumerate(given):
            numbers = place[:2] if isinstance(place, list) else []
            if len(numbers) < 2 or not all(type(value) in (int, float) for value in numbers):
                raise self._refuse(
                    f"{what}, place {index + 1}: expected [longitude, latitude], got {place!r}",
                    "geometry.coordinates",
                )
            longitude, latitude = map(_float, numbers)
            if not (abs(latitude) <= 90.0 and abs(longitude) <= 180.0):
                raise self._refuse(
                    f"{what}, place {index + 1}: longitude {longitude:g}, latitude {latitude:g}; "
                    "allowed are degrees, -180 to 180 and -90 to 90",
                    "geometry.coordinates",
                )
            degrees[index] = latitude, longitude
        return positions_N(self._datum, degrees)

    def _strip(self, line: Float64, properties: dict[str, Any]) -> Iterator[list[Float64]]:
        """Give the area that a line of a width covers."""
        from shapely import LineString

        if len(line) < 2:
            raise self._refuse("a line of a single place", "geometry.coordinates")
        width = properties.get("width_m", self._width_m)
        width_m = self._number(width, "properties.width_m", 0.01, 1000.0)
        yield from _rings_of(LineString(line).buffer(width_m / 2.0, quad_segs=2))

    def _polygon(self, given: object) -> Iterator[list[Float64]]:
        """Give a polygon's rings: the outline and its holes."""
        if not isinstance(given, list) or not given:
            raise self._refuse("a polygon has no rings", "geometry.coordinates")
        rings = []
        for number, ring in enumerate(given, start=1):
            line = self._line(ring, f"ring {number}")
            if len(line) < 4 or ring[0][:2] != ring[-1][:2]:
                raise self._refuse(
                    f"ring {number} is not closed: expected four places at least, the last like "
                    "the first",
                    "geometry.coordinates",
                )
            rings.append(line)
        from shapely import Polygon, is_valid, make_valid

        polygon = Polygon(rings[0], rings[1:])
        if is_valid(polygon) and polygon.area > 0.0:
            yield rings
        elif self._repair and np.ptp(rings[0], axis=0).min() > 0.0:
            self.repaired += 1
            yield from _rings_of(make_valid(polygon))
        else:
            raise self._refuse(self._fault(rings), "geometry.coordinates")

    def _fault(self, rings: list[Float64]) -> str:
        """Say which ring is wrong, how and where."""
        from shapely import Polygon, is_valid, is_valid_reason

        single = (i for i, ring in enumerate(rings) if not is_valid(Polygon(ring)))
        number = next(single, None)
        shape = Polygon(rings[0], rings[1:]) if number is None else Polygon(rings[number])
        ring = "its rings" if number is None else f"ring {number + 1}"
        reason, _, place = is_valid_reason(shape).partition("[")
        if reason == "Valid Geometry":
            return "ring 1 has no area"
        where = ""
        if place:
            north, east = map(float, place.rstrip("]").split()[:2])
            latitude, longitude = to_degrees(self._datum, np.array([north, east]))
            where = f" at longitude {longitude:.6f}, latitude {latitude:.6f}"
        words = "crosses itself" if "Self-inter" in reason and number is not None else reason
        return f"{ring}: {words}{where}; chart.repair = true keeps what it encloses"


@dataclass(frozen=True, slots=True)
class _Circle:
    north_m: float
    east_m: float
    radius_m: float


def _rings_of(shape: Any) -> Iterator[list[Float64]]:
    """Give the rings of each polygon in a shapely geometry; lines and points are left out."""
    from shapely import get_coordinates, get_parts, get_rings

    for part in get_parts(shape).tolist():
        if part.geom_type in ("MultiPolygon", "GeometryCollection"):
            yield from _rings_of(part)
        elif part.geom_type == "Polygon" and part.area > 0.0:
            yield [get_coordinates(ring) for ring in get_rings(part).tolist()]


def _is_far(feature: Feature) -> bool:
    """Whether all of a feature lies farther than `FAR_M` from the datum.

    An area may have its vertices far away and the datum inside: then it is not far.
    """
    if isinstance(feature, Disc):
        return math.hypot(*feature.centre) - feature.radius_m > FAR_M
    low, high = feature.outline.min(axis=0), feature.outline.max(axis=0)
    nearest = np.clip(0.0, low, high)
    return bool(np.hypot(*nearest) > FAR_M)


def _listed(value: object) -> list[str]:
    """Give the elements of an attribute that is a list: "7,14", [7, 14] or ["7", "14"]."""
    if isinstance(value, list):
        return [str(one) for one in value]
    return str(value).replace("(", ",").replace(")", ",").split(",")
