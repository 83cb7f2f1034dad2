"""The LiDAR as a source: what the objects of a scan say about where things are in frame N.

The centroid of the visible side lies nearer to the sensor than the object's centre. For an upright
cylinder of radius r under parallel rays evenly spread across it, the visible points' mean lies
r pi / 4 before the axis, and the farthest of them, at the edges, hypot(1, pi / 4) r from that mean:
the centre lies 0.62 of the *reported* radius behind the centroid. A hull differs (see
docs/tracking.md), so the share is a setting; what remains is left to the filter's bias states.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from twinscrew.runtime import _native
from twinscrew.runtime._native import crowded
from twinscrew.runtime.geometry import rotation_2d
from twinscrew.runtime.messages.types import Float64, Objects, Odometry, Strips
from twinscrew.runtime.perception.segmentation import PerceptionSettings
from twinscrew.runtime.perception.sensor import Sensor
from twinscrew.runtime.settings import Fraction, NonNegative, Positive, Settings

ABOUT_RAD = (-0.25, 0.05)
"""[rad] Elevations under which other vessels are seen, from 6 m on."""

PART_M = 3.0
"""[m] What is nearer than this to the end of sight may be seen in part: half a vessel's length."""
FREEBOARD_M = 0.6
"""[m] Vessels rise this far out of the water, at least."""


@dataclass(frozen=True, slots=True)
class SensorView:
    """How a sensor looks at what floats; by default as the one of docs/tracking.md's table."""

    height_m: float = 1.93
    """[m] Over the vessel's origin."""
    lowest_rad: float = 0.186
    """[rad] How far the lowest beam looks down."""
    row_rad: float = 0.0234
    """[rad] Between two rows, there where vessels are."""
    reach_m: float = PerceptionSettings().max_range_m
    """[m] Farther echoes are not used."""

    @classmethod
    def of(cls, sensor: Sensor, reach_m: float = PerceptionSettings().max_range_m) -> SensorView:
        """Take it from a description, and from how far perception uses echoes [m]."""
        elevations = sensor.elevations
        height = cls().height_m if sensor.mount is None else sensor.mount.z_m
        lowest, step = max(-float(elevations[0]), 1e-3), _usual_step(elevations)
        return cls(height, lowest, step, min(reach_m, sensor.range_max_m))

    @property
    def near_scale(self) -> float:
        """[-] How much farther than the default's its lowest beam comes down to some height."""
        usual = SensorView()
        reach = self.height_m / math.tan(self.lowest_rad)
        return max(reach, 0.0) * math.tan(usual.lowest_rad) / usual.height_m

    @property
    def sure_m(self) -> float:
        """[m] Up to here each hull is in range, and higher than its rows are apart."""
        return min(max(self.reach_m - PART_M, 0.5 * self.reach_m), FREEBOARD_M / self.row_rad)

    def row_gap(self, distance: Float64) -> Float64:
        """[m] Give how far apart rows are on an upright side at distances (K,) [m]."""
        gap: Float64 = self.row_rad * distance
        return gap


def _usual_step(elevations: Float64) -> float:
    """[rad] Give the mean gap between rows that see vessels; of all rows, if few do."""
    low, high = ABOUT_RAD
    seen = elevations[(elevations >= low) & (elevations <= high)]
    return float(np.diff(seen if len(seen) >= 3 else elevations).mean())


NO_SEGMENTS = np.empty((0, 4))


SLIDING_M = 12.0
"""[m] The visible part of what is so long may slide along it."""
FAR_M = 25.0
"""[m] Farther off rows are too far apart to tell by free water that a vessel moves."""
HIDES_M = 0.5
"""[m] What is nearer by this much, and beside it, hides a part of it."""
AtRest = bool | Literal["unknown"] | None
"""Of a piece of a long object, whether that lies at rest (`lidar_motion.LongObjects.at_rest`), or
that this is unknown; None for what is no piece."""


def told(objects: Objects, at_rest: Sequence[bool | None]) -> Sequence[AtRest]:
    """Tell pieces of which nothing is known from what is no piece of a long object.

    What is not so long, and hidden by nothing at its ends, is followed as any vessel is. So it is
    where rows are too far apart to see free water under its side, though it seemed to rest.
    """
    outline = objects.outline
    if outline is None:
        return at_rest
    pairs = list(zip(at_rest, outline.cut_from.tolist(), strict=True))
    doubtful = {number for rests, number in pairs if rests is not False and number >= 0}
    if not doubtful:
        return at_rest
    away = np.hypot(*(outline.boundary_L - outline.sensor_L[:2]).T)
    is_echo, sliding, far = np.isfinite(outline.height_m), set(), set()
    for number in doubtful:
        mine = np.flatnonzero(outline.seen == number)
        if not len(mine):
            continue
        beside = np.setdiff1d(np.concatenate([mine - 1, mine + 1]) % len(away), mine)
        hides = is_echo[beside] & (away[beside] < away[mine].min() - HIDES_M)
        size = float(np.hypot(*np.ptp(outline.boundary_L[mine], axis=0)))
        if size >= SLIDING_M or bool(hides.any()):
            sliding.add(number)
        elif float(away[mine].min()) > FAR_M:
            far.add(number)
    return [
        "unknown"
        if rests is None and number in sliding
        else (None if rests is True and number in far else rests)
        for rests, number in pairs
    ]


@dataclass(frozen=True, slots=True)
class LidarExtras:
    """What only a LiDAR knows of one object, as seen in one scan."""

    stamp_ns: int
    """[ns] The scan's stamp."""
    segments_N: Float64
    """(S, 4) Segments of the hull: mean, north and east [m]; length [m]; number of echoes."""
    at_rest: AtRest = None
    """Of a piece of a long object, whether that lies at rest."""


class MeasurementSettings(Settings, frozen=True, kw_only=True):
    """How the visible centroid relates to the centre; figures: docs/tracking.md."""

    range_m: tuple[NonNegative, ...] = (7.2, 10.0, 16.5, 19.5)
    """[m] Distances of a hull's centroid, at which"""
    depth_m: tuple[float, ...] = (0.02, 0.48, 0.45, 1.0)
    """[m] its centre is expected this far behind; linear in between, constant outside."""
    near_m: NonNegative = 10.0
    """[m] Up to here the distances are those at which the lowest beam passes over the near side:
    with another sensor they are where its lowest beam does."""
    small_depth_m: NonNegative = 0.32
    """[m] The same for a buoy, at any distance."""
    buoy_hull_m: tuple[Positive, Positive] = (0.7, 1.5)
    """[m] Up to the first radius all is a buoy, from the second on a hull; linear in between."""
    bias_along: NonNegative = 0.05
    """[-] Standard deviation of that distance over aspects, as a share of the radius."""
    bias_across: NonNegative = 0.06
    """[-] Standard deviation of the centroid's offset across the line of sight, likewise."""
    row_spread_per_m: NonNegative = 0.75
    """[1/m] By how much more a hull's may be off where rows are far apart: times their gap squared.
    The wider the gap, the more often a part is missed, and the larger is what is."""
    bias_time_s: Positive = 1.0
    """[s] Time constant with which both wander."""
    sigma_m: Positive = 0.01
    """[m] White noise of a centroid with many points: sensor and waves."""
    scatter: NonNegative = 0.4
    """[-] White noise of a single-point centroid, as a share of the radius; falls with the root of
    the number of points."""
    jump: NonNegative = 0.3
    """[-] By how much a centroid may jump between scans, as a share of the radius, and still be the
    same object's: a mast or a bow comes into sight or goes out of it."""
    jump_sigma: Positive = 2.0
    """[-] Innovations beyond this Mahalanobis distance are jumps: no vessel moves so suddenly."""
    edge_m: Positive | None = None
    """[m] A centroid farther than this may be that of a part: the rest is out of range. None: 3 m
    less than perception's range."""
    edge_sigma: NonNegative = 0.3
    """[-] White noise there, as a share of the radius."""

    def __post_init__(self) -> None:
        """Refuse a table that is none."""
        if len(self.range_m) != len(self.depth_m) or not self.range_m:
            raise ValueError("range_m and depth_m must be as long as each other, and not empty")
        rising = (*pairwise(self.range_m), self.buoy_hull_m)
        if any(low >= high for low, high in rising):
            raise ValueError("range_m and buoy_hull_m must rise")


@dataclass(frozen=True, slots=True)
class Measurements:
    """The objects of a scan, seen from the ego vessel, in frame N."""

    z_N: Float64
    """[m] [N] (K, 2) Centroids, moved back by the expected depth."""
    H: Float64
    """(K, 2, 6) What they say of the state (see motion)."""
    R: Float64
    """[m2] [N] (K, 2, 2) White measurement noise."""
    radius: Float64
    """[m] (K,)"""
    gate: Float64
    """[m2] (K,) Variance that the gate allows for jumps."""
    extras: list[LidarExtras]
    """(K,) Their segments, and whether they lie at rest."""


class Viewpoint(NamedTuple):
    """From where, and with which heading, a scan was taken."""

    p_N: Float64
    """[m] [N] (2,) The vessel's place."""
    R_NL: Float64
    """(2, 2) Turns a vector of the levelled frame L into N."""

    @classmethod
    def of(cls, odometry: Odometry) -> Viewpoint:
        """Take it from the vessel's state at the scan's stamp."""
        return cls(odometry.position_N[:2], rotation_2d(odometry.heading))

    def in_N(self, places_L: Float64) -> Float64:
        """Give places, (K, 2) [m], of the levelled frame L in N."""
        return places_L @ self.R_NL.T + self.p_N

    def in_L(self, places_N: Float64) -> Float64:
        """Give places, (K, 2) [m], of N in the levelled frame L."""
        return (places_N - self.p_N) @ self.R_NL

    @property
    def heading(self) -> float:
        """[rad] Of the vessel, clockwise from north."""
        return math.atan2(self.R_NL[1, 0], self.R_NL[0, 0])

    @property
    def is_known(self) -> bool:
        """False if a number of it is none."""
        (north, east), ahead = self.p_N.tolist(), float(self.R_NL[0, 0])
        return math.isfinite(north + east + ahead)


class Centroids:
    """Turns objects into measurements; the work is in ``runtime/native/centroids.hpp``."""

    def __init__(self, settings: MeasurementSettings, view: SensorView) -> None:
        """Prepare the model for a sensor's view."""
        buoy, hull = settings.buoy_hull_m
        self._model = _native.CentroidModel(
            range=_distances(settings, view),
            depth=settings.depth_m,
            small_depth=settings.small_depth_m,
            buoy=buoy,
            hull=hull,
            along=settings.bias_along,
            across=settings.bias_across,
            row_spread=settings.row_spread_per_m,
            row=view.row_rad,
            sigma=settings.sigma_m,
            scatter=settings.scatter,
            jump=settings.jump,
            edge=_edge_m(settings, view),
            edge_sigma=settings.edge_sigma,
        )

    def measure(
        self, objects: Objects, own: Viewpoint, at_rest: Sequence[AtRest] | None = None
    ) -> Measurements:
        """Give the objects of a scan in frame N; what is not finite is left out.

        Parameters
        ----------
        objects
            As perception found them.
        own
            From where the scan was taken.
        at_rest
            Of each object, see `AtRest`; by default none is a piece.
        """
        (cosine, _), (sine, _) = own.R_NL.tolist()
        z_N, H, R, radius, gate, kept = self._model.measured(
            objects.p_L, objects.radius, objects.points, (*own.p_N.tolist(), cosine, sine)
        )
        return Measurements(z_N, H, R, radius, gate, _extras(objects, own, at_rest, kept))

    def bias_variance(self, places_N: Float64, radius: Float64, own_N: Float64) -> Float64:
        """Give how far centroids may be off what is expected of them, along and across.

        Parameters
        ----------
        places_N : (K, 2 or more) float64
            Where things are [m]; of states the first two numbers count.
        radius : (K,) float64
            Their radii [m].
        own_N : (2,) float64
            From where they are seen [m].

        Returns
        -------
        variance : (K, 2) float64
            Along and across the line of sight [m2].
        """
        return self._model.bias_variance(places_N, radius, *own_N.tolist())


def _edge_m(settings: MeasurementSettings, view: SensorView) -> float:
    """[m] Give how far a centroid may be, to be that of a whole vessel for certain."""
    usual_m = max(view.reach_m - PART_M, 0.5 * view.reach_m)
    return usual_m if settings.edge_m is None else settings.edge_m


def _distances(settings: MeasurementSettings, view: SensorView) -> list[float]:
    """Give the distances of the table for a sensor; they never fall."""
    scaled = [r * view.near_scale if r <= settings.near_m else r for r in settings.range_m]
    return [min(scaled[k:]) for k in range(len(scaled))]


def _extras(
    objects: Objects, own: Viewpoint, at_rest: Sequence[AtRest] | None, kept: list[int]
) -> list[LidarExtras]:
    """Give what is seen of the objects that are kept, in N."""
    strips, stamp_ns = objects.strips, objects.stamp_ns
    at_rest = at_rest or [None] * len(objects.radius)
    if strips is None:
        return [LidarExtras(stamp_ns, NO_SEGMENTS, at_rest[k]) for k in kept]
    rows_N = strips.rows_L.copy()
    rows_N[:, :2] = own.in_N(strips.rows_L[:, :2])
    begin = strips.begin.tolist()
    return [LidarExtras(stamp_ns, rows_N[begin[k] : begin[k + 1]], at_rest[k]) for k in kept]


def join_fragments(
    objects: Objects, at_rest: Sequence[AtRest], p_L: Float64, radius: Float64
) -> tuple[Objects, Sequence[AtRest]]:
    """Replace objects within the circle of one track by one object.

    Parameters
    ----------
    objects
        As perception found them.
    at_rest : (M,)
        Of each, see `AtRest`: pieces of what stands remain apart.
    p_L : (K, 2) float64
        Where the tracks are expected [m], levelled frame L.
    radius : (K,) float64
        Radii of their circles [m].

    Returns
    -------
    Objects
        The joined ones first: the mean of the points, the circle around that mean that holds the
        pieces' circles, the sum of the points. The others follow as they were.
    at_rest
        Of those: of what was joined nothing is known.
    """
    circles = crowded(objects.p_L, p_L, radius)
    if not circles:
        return objects, at_rest
    alone = np.array([rests is True for rests in at_rest])
    groups, free = [], ~alone
    for within in circles:
        members = np.array(within)
        pieces = members[free[members]]
        if len(pieces) > 1:
            groups.append(pieces)
            free[pieces] = False
    rows = np.array([_joined(objects, pieces) for pieces in groups]).reshape(-1, 4)
    kept = np.flatnonzero(free | alone)
    others = np.column_stack([objects.p_L[kept], objects.radius[kept], objects.points[kept]])
    table = np.concatenate([rows, others])
    joined = Objects(
        stamp_ns=objects.stamp_ns,
        p_L=table[:, :2],
        radius=table[:, 2],
        points=table[:, 3].astype(np.int64),
        strips=_regrouped(objects.strips, [*groups, *kept.reshape(-1, 1)]),
    )
    return joined, [*[None] * len(groups), *(at_rest[i] for i in kept.tolist())]


def _regrouped(strips: Strips | None, groups: Sequence[NDArray[np.intp]]) -> Strips | None:
    """Give each group of objects the strips of its members."""
    if strips is None:
        return None
    begin, end = strips.begin[:-1], strips.begin[1:]
    rows = [np.arange(begin[i], end[i]) for members in groups for i in members]
    counts = [int((end[members] - begin[members]).sum()) for members in groups]
    return Strips(
        begin=np.concatenate([[0], np.cumsum(counts, dtype=np.int64)]),
        rows_L=strips.rows_L[np.concatenate(rows)],
    )


def _joined(objects: Objects, pieces: NDArray[np.intp]) -> tuple[float, float, float, float]:
    """Give x, y, radius and points of pieces put together."""
    p, points = objects.p_L[pieces], objects.points[pieces]
    centre = points @ p / points.sum()
    away = np.hypot(p[:, 0] - centre[0], p[:, 1] - centre[1])
    reach = float((away + objects.radius[pieces]).max())
    return float(centre[0]), float(centre[1]), reach, float(points.sum())


class RadiusSettings(Settings, frozen=True, kw_only=True):
    """How the radius is smoothed."""

    quantile: Fraction = 0.9
    """[-] Share of the measured radii that the track's covers."""
    step: NonNegative = 0.1
    """[-] Step of one scan as a share of the radius; 0 keeps the first radius."""


def smoothed_radius(radius: float, measured: float, settings: RadiusSettings) -> float:
    """Follow the quantile of the measured radii [m] by one step, never past the measurement."""
    step = settings.step * radius
    if measured > radius:
        return min(measured, radius + settings.quantile * step)
    return max(measured, radius - (1.0 - settings.quantile) * step)
