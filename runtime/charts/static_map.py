"""The static map: every place where a vessel may not be, as one region of the plane.

Land, keep-out areas, water that is too shallow, hazards and fences come as features; what they
forbid together is one region, the union of them all. Everybody who must know where a vessel may go
asks this region, so that the policy, the route, the assurance and a ground station agree.

All coordinates are north and east [m] in frame N. "Counter-clockwise" is meant with north as x and
east as y. The union is made by shapely (GEOS), on a grid of a millimetre: edges shorter than that,
and slivers between neighbours, do not arise.
"""

from __future__ import annotations

import hashlib
import math
import struct
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, Final, Literal, TypeAlias

import numpy as np

from twinscrew.runtime.errors import ConfigError
from twinscrew.runtime.messages.types import Float64

if TYPE_CHECKING:
    from numpy.typing import NDArray

Kind: TypeAlias = Literal["land", "keep_out", "depth", "hazard", "fence"]
KINDS: Final[tuple[Kind, ...]] = ("land", "keep_out", "depth", "hazard", "fence")

GRID_M: Final = 1e-3
"""[m] Vertices of the forbidden region lie on a grid as fine as this."""
MOST_VERTICES: Final = 50_000
"""[-] Of all features together; the time to make a map grows a little faster than their number."""
FARTHEST_M: Final = 1e6
"""[m] No vertex lies farther from the origin of frame N."""
_QUARTER: Final = 8
"""[-] A circle is a polygon of four times as many sides."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Area:
    """A polygon: land, a keep-out area, an area of water of a depth, or a fence."""

    kind: Kind
    """What it is."""
    outline: Float64
    """[m] [N] (M, 2) M >= 3 vertices, in either direction; the last may repeat the first."""
    holes: tuple[Float64, ...] = ()
    """[m] [N] each (M, 2): what is cut out of it."""
    keep_in: bool = False
    """True for an inclusion fence: it is forbidden outside."""
    depth_m: float = -math.inf
    """[m] The least depth of water in it, for kind "depth"; negative where it dries."""
    name: str = ""
    """What people call it; for messages."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Disc:
    """A circle: a rock, a buoy, a pile, or a circular fence."""

    kind: Kind
    """What it is."""
    centre: tuple[float, float]
    """[m] [N] Its centre."""
    radius_m: float
    """[m] Its radius, greater than zero."""
    keep_in: bool = False
    """True for an inclusion fence: it is forbidden outside."""
    depth_m: float = -math.inf
    """[m] The depth of water over it, for kind "depth"; negative where it dries."""
    name: str = ""
    """What people call it; for messages."""


Feature: TypeAlias = Area | Disc


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Outline:
    """A feature as it is drawn."""

    kind: Kind
    """What it is."""
    ring: Float64
    """[m] [N] (M, 2), closed, counter-clockwise."""
    holes: tuple[Float64, ...] = ()
    """[m] [N] each (M, 2), closed, clockwise."""
    keep_in: bool = False
    """True if it is forbidden outside of the ring, and not inside."""
    name: str = ""
    """What people call it."""


class StaticMap:
    """Where a vessel may not be. It never changes: other content makes another map.

    Made by `StaticMap.of` or `StaticMap.empty`. On one core of a cloud machine a map of 500 (5000)
    edges is made in 40 (240) ms; `near` takes 0.02 ms and `distance_m` of one place 0.02 ms with
    either, `distance_m` of 1000 places 4 (5) ms, `forbidden` of 1000 places 0.2 (1.0) ms.
    """

    def __init__(self, features: tuple[Feature, ...], safety_depth_m: float) -> None:
        self.features: Final = features
        """What it was made of, deep water included."""
        self.safety_depth_m: Final = safety_depth_m
        """[m] Areas of water of less depth are forbidden."""
        forbidding = [feature for feature in features if _forbids(feature, safety_depth_m)]
        # Sorted by content, so that the order in which features come makes no difference at all.
        self._forbidding = tuple(sorted(forbidding, key=_content))
        content = b"".join(_content(feature) for feature in self._forbidding)
        self.version: Final = int.from_bytes(hashlib.sha256(content).digest()[:6]) if content else 0
        """[-] 48 bits; another number for any other content that forbids something; 0: nothing."""

    @classmethod
    def empty(cls) -> StaticMap:
        """Give the map of the open sea."""
        return cls((), 0.0)

    @classmethod
    def of(cls, features: Iterable[Feature], *, safety_depth_m: float = 0.0) -> StaticMap:
        """Make a map.

        Parameters
        ----------
        features
            In any order. Inclusion fences forbid everything outside of each of them, as
            ArduPilot's do.
        safety_depth_m
            [m] A "depth" area of less depth is forbidden.

        Raises
        ------
        ConfigError
            A feature that has no area, crosses itself, is not finite, or is farther than
            `FARTHEST_M` away; or there are more than `MOST_VERTICES` vertices.
        """
        features = tuple(features)
        vertices = sum(map(_size, features))
        if vertices > MOST_VERTICES:
            raise ConfigError(f"{vertices} vertices; allowed are at most {MOST_VERTICES}")
        for number, feature in enumerate(features, start=1):
            _check(feature, number)
        made = cls(features, safety_depth_m)
        _ = made._shapes  # any fault of a shape is found here
        return made

    @property
    def is_empty(self) -> bool:
        """Whether nothing is forbidden."""
        return not self._forbidding

    @property
    def leaves_water(self) -> bool:
        """Whether any place is left where a vessel may be."""
        return self._allowed is None or not self._allowed.is_empty

    @cached_property
    def edges(self) -> Float64:
        """[m] [N] (S, 2, 2) The boundary of the forbidden region: segments from, to.

        What is forbidden lies to the left of each (north as x, east as y): outer rings of the
        region are counter-clockwise, rings around open water are clockwise.
        """
        if self.is_empty:
            return np.empty((0, 2, 2))
        from shapely import get_coordinates, get_parts, get_rings, normalize, orient_polygons

        region = self._solid if self._allowed is None else self._allowed
        parts = get_parts(normalize(region))
        oriented = orient_polygons(parts, exterior_cw=self._allowed is not None)
        rings = [get_coordinates(ring) for ring in get_rings(oriented).tolist()]
        segments = [np.stack([ring[:-1], ring[1:]], axis=1) for ring in rings]
        return np.concatenate([np.empty((0, 2, 2)), *segments])

    @cached_property
    def polygons(self) -> tuple[Outline, ...]:
        """What is forbidden, feature by feature, to be drawn; they may lie over each other."""
        if self.is_empty:
            return ()
        from shapely import get_coordinates, get_rings, orient_polygons

        outlines = []
        for feature, shape in zip(self._forbidding, self._shapes, strict=True):
            ring, *holes = map(get_coordinates, get_rings(orient_polygons(shape)).tolist())
            outline = Outline(
                kind=feature.kind,
                ring=ring,
                holes=tuple(holes),
                keep_in=feature.keep_in,
                name=feature.name,
            )
            outlines.append(outline)
        return tuple(outlines)

    def forbidden(self, points: Float64) -> NDArray[np.bool_]:
        """Tell which places are forbidden, the boundary included.

        Parameters
        ----------
        points : (P, 2) float64
            [m] [N]

        Returns
        -------
        (P,) bool
        """
        if self.is_empty:
            return np.zeros(len(points), bool)
        from shapely import contains_xy, intersects_xy

        if self._allowed is not None:
            return np.asarray(~contains_xy(self._allowed, points[:, 0], points[:, 1]))
        return np.asarray(intersects_xy(self._solid, points[:, 0], points[:, 1]))

    def distance_m(self, points: Float64) -> Float64:
        """Give the distance to the forbidden region.

        Parameters
        ----------
        points : (P, 2) float64
            [m] [N]

        Returns
        -------
        (P,) float64
            [m] 0 inside and on the boundary; infinite if nothing is forbidden.
        """
        distances = np.full(len(points), np.inf)
        outside = np.flatnonzero(~self.forbidden(points))
        if len(self.edges) and len(outside):
            from shapely import points as as_points

            found, away = self._tree.query_nearest(
                as_points(points[outside]), return_distance=True, all_matches=False
            )
            distances[outside[found[0]]] = away
            inside = np.ones(len(points), bool)
            inside[outside] = False
            distances[inside] = 0.0
        elif not len(outside):
            distances[:] = 0.0
        return distances

    def near(self, point: Float64, radius_m: float) -> Float64:
        """Give the edges of which a part is within a distance of a place.

        Parameters
        ----------
        point : (2,) float64
            [m] [N]
        radius_m
            [m] Edges at exactly this distance are among them.

        Returns
        -------
        (K, 2, 2) float64
            [m] [N] Rows of `edges`, in their order.
        """
        if not len(self.edges):
            return self.edges
        from shapely import Point

        found = self._tree.query(Point(point[:2]), predicate="dwithin", distance=radius_m)
        return np.asarray(self.edges[np.sort(found)])

    def why(self, point: Float64) -> str:
        """Say why a place, (2,) [m] [N], is forbidden: "on land (Mole)"; empty if it is not."""
        if self.is_empty or not self.forbidden(point[None, :2])[0]:
            return ""
        from shapely import Point, contains_properly, intersects

        here = Point(point[:2])
        reasons = [
            _words(feature, self.safety_depth_m)
            for feature, shape in zip(self._forbidding, self._shapes, strict=True)
            if (not contains_properly(shape, here) if feature.keep_in else intersects(shape, here))
        ]
        return " and ".join(dict.fromkeys(reasons)) or "on the edge of what is forbidden"

    def blocks(self, start: Float64, end: Float64) -> bool:
        """Tell whether the straight way between two places, (2,) [m] [N], touches the region."""
        if self.is_empty:
            return False
        from shapely import LineString, Point

        way: Any = LineString([start[:2], end[:2]])
        if not way.length:
            way = Point(start[:2])
        allowed = self._allowed
        if allowed is not None:
            return not bool(allowed.contains_properly(way))
        return bool(self._solid.intersects(way))

    def region(self, low: tuple[float, float], high: tuple[float, float]) -> Any:
        """Give the forbidden region inside of a box as a shapely geometry.

        Parameters
        ----------
        low, high
            [m] [N] The box's least and greatest north and east.
        """
        from shapely import Polygon, box

        if self.is_empty:
            return Polygon()
        frame = box(*low, *high)
        if self._allowed is not None:
            return frame.difference(self._allowed)
        return self._solid.intersection(frame)

    # -- The shapes, made when they are first needed: an empty map never imports shapely (25 ms).

    @cached_property
    def _shapes(self) -> list[Any]:
        """Every feature that forbids something, as a shapely polygon."""
        return [_shape(feature) for feature in self._forbidding]

    def _united(self) -> Any:
        from shapely import union_all

        pairs = zip(self._forbidding, self._shapes, strict=True)
        shapes = [shape for feature, shape in pairs if not feature.keep_in]
        return _polygons(union_all(shapes, grid_size=GRID_M))

    @cached_property
    def _solid(self) -> Any:
        """What is forbidden but for inclusion fences, prepared for lookups."""
        from shapely import prepare

        solid = self._united()
        prepare(solid)
        return solid

    @cached_property
    def _allowed(self) -> Any | None:
        """Where a vessel may be, prepared; None if there is no inclusion fence: nearly anywhere."""
        pairs = zip(self._forbidding, self._shapes, strict=True)
        fences = [shape for feature, shape in pairs if feature.keep_in]
        if not fences:
            return None
        from shapely import difference, intersection, prepare, set_precision

        allowed = set_precision(fences[0], GRID_M)
        for fence in fences[1:]:
            allowed = _polygons(intersection(allowed, fence, grid_size=GRID_M))
        allowed = _polygons(difference(allowed, self._united(), grid_size=GRID_M))
        prepare(allowed)
        return allowed

    @cached_property
    def _tree(self) -> Any:
        from shapely import STRtree, linestrings

        return STRtree(linestrings(self.edges))


def _forbids(feature: Feature, safety_depth_m: float) -> bool:
    return feature.kind != "depth" or feature.depth_m < safety_depth_m


def _size(feature: Feature) -> int:
    """Count the vertices of a feature's polygon."""
    if isinstance(feature, Disc):
        return 4 * _QUARTER
    return len(feature.outline) + sum(map(len, feature.holes))


def _content(feature: Feature) -> bytes:
    """Give what a feature is as bytes: equal for equal features."""
    head = f"{feature.kind}\0{feature.keep_in}\0{feature.name}\0".encode()
    if isinstance(feature, Disc):
        return head + struct.pack("<c4d", b"o", *feature.centre, feature.radius_m, feature.depth_m)
    rings = (np.asarray(ring, "<f8") for ring in (feature.outline, *feature.holes))
    sized = b"".join(struct.pack("<cI", b"[", len(ring)) + ring.tobytes() for ring in rings)
    return head + struct.pack("<d", feature.depth_m) + sized


def _check(feature: Feature, number: int) -> None:
    """Refuse a feature that has no area, or is out of this world."""
    key = f"feature {number} ({label(feature)})"
    if feature.keep_in and feature.kind != "fence":
        raise ConfigError("only a fence can be kept inside of", key=key)
    if isinstance(feature, Disc):
        if not 0.0 < feature.radius_m <= FARTHEST_M:
            allowed = f"allowed: above 0 and at most {FARTHEST_M:g} m"
            raise ConfigError(f"a radius of {feature.radius_m:g} m; {allowed}", key=key)
        _check_places(np.array([feature.centre]), key)
        return
    for ring in (feature.outline, *feature.holes):
        if ring.ndim != 2 or ring.shape[1] != 2:
            raise ConfigError(f"expected places (M, 2), got shape {ring.shape}", key=key)
        _check_places(ring, key)
        if len(np.unique(ring, axis=0)) < 3:
            raise ConfigError("a ring of fewer than three different places", key=key)


def _check_places(places: Float64, key: str) -> None:
    if not (np.abs(places) <= FARTHEST_M).all():  # NaN is no such place either
        raise ConfigError(f"a place that is not within {FARTHEST_M:g} m of the origin", key=key)


def _shape(feature: Feature) -> Any:
    """Give a feature's polygon: a forbidden circle goes around its polygon, a free one inside."""
    from shapely import Point, Polygon, is_valid, is_valid_reason

    if isinstance(feature, Disc):
        # The polygon of an obstacle goes around its circle, that of an inclusion fence inside.
        widened = 1.0 if feature.keep_in else 1.0 / math.cos(math.pi / (4 * _QUARTER))
        return Point(feature.centre).buffer(widened * feature.radius_m, quad_segs=_QUARTER)
    polygon = Polygon(feature.outline, feature.holes)
    if not is_valid(polygon):
        raise ConfigError(fault_of(is_valid_reason(polygon)), key=label(feature))
    if polygon.area <= 0.0:
        raise ConfigError("an outline without area", key=label(feature))
    return polygon


def fault_of(reason: str) -> str:
    """Put GEOS's reason why a polygon is none, "Self-intersection[12 30]", into our words."""
    what, _, place = reason.partition("[")
    north, _, east = place.rstrip("]").partition(" ")
    where = f" at north {float(north):.2f} m, east {float(east):.2f} m" if east else ""
    known = {
        "Self-intersection": "the outline crosses itself",
        "Ring Self-intersection": "a ring touches itself",
        "Hole lies outside shell": "a hole lies outside of the outline",
        "Holes are nested": "a hole lies in another hole",
        "Interior is disconnected": "the holes cut the area in two",
    }
    return known.get(what, what) + where


def label(feature: Feature) -> str:
    """Name a feature for a message: its kind, and its name if it has one."""
    kind = feature.kind.replace("_", "-")
    return f"{kind} {feature.name!r}" if feature.name else kind


def _words(feature: Feature, safety_depth_m: float) -> str:
    """Say where somebody is who is in a feature, or outside of an inclusion fence."""
    name = f" ({feature.name})" if feature.name else ""
    if feature.keep_in:
        return f"outside the fence{name}"
    if feature.kind == "depth":
        return f"in water shallower than {safety_depth_m:g} m{name}"
    where = {
        "land": "on land",
        "keep_out": "in a keep-out area",
        "hazard": "on a hazard",
        "fence": "inside an exclusion fence",
    }
    return where[feature.kind] + name


def _polygons(shape: Any) -> Any:
    """Leave out what has no area: the points and lines where two polygons touch."""
    from shapely import MultiPolygon, get_parts

    return MultiPolygon([p for p in get_parts(shape).tolist() if p.geom_type == "Polygon"])
