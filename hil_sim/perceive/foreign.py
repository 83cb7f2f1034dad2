"""Perception of other people's scans, whose sensor may not be quite the one described.

A scan that the description fits is perceived by it. For others an image is derived from the points
themselves (`fitted`). The plane of the ground or the water is found in the scan (`find_surface`),
because its attitude is not known.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from msgspec import structs
from numpy.typing import NDArray

from twinscrew.runtime.errors import ConfigError
from twinscrew.runtime.geometry import quaternion_from_euler, quaternion_product
from twinscrew.runtime.messages.types import Float32, Float64, Objects, PointCloud
from twinscrew.runtime.perception.segmentation import Perception, PerceptionSettings
from twinscrew.runtime.perception.sensor import Beams, Columns, Mount, Sensor

HERE = Mount(x_m=0.0, y_m=0.0, z_m=0.0)
LEVEL = np.array([1.0, 0.0, 0.0, 0.0])
KEPT = 0.8
"""[-] A description that keeps a smaller share of the points of use does not fit the scan."""
LAYER_M = 0.2
"""[m] Half the thickness of a layer that may be the ground."""
GROUND_SHARE = 0.25
"""[-] With this share of the points, it probably is."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Chosen:
    """What perceives a scan."""

    perception: Perception
    fits: bool
    """False if the description keeps too few points, so that the image came from the points."""
    kept: float
    """[-] The share of the points of use for which the description has a cell."""


def choose(
    cloud: PointCloud,
    ring: NDArray[np.uint16] | None,
    sensor: Sensor,
    settings: PerceptionSettings,
    mount: Mount = HERE,
) -> Chosen:
    """Choose the image: the description's, or if that drops points, the one that keeps most.

    `mount` places the sensor on the vessel whose hull and water the settings give.
    """
    described = Perception(sensor.mounted(mount), settings)
    kept = _kept(described, cloud)
    if kept >= KEPT:
        return Chosen(perception=described, fits=True, kept=kept)
    others = [
        perception
        for one in fitted(cloud.points_S, ring, sensor)
        if (perception := _perception(one.mounted(mount), settings)) is not None
    ]
    best = max([described, *others], key=lambda one: _kept(one, cloud))
    return Chosen(perception=best, fits=best is described, kept=kept)


def _perception(sensor: Sensor, settings: PerceptionSettings) -> Perception | None:
    """Make the perception of a fitted sensor; None if its beams are too close to each other."""
    try:
        return Perception(sensor, settings)
    except ConfigError:
        return None


def _kept(perception: Perception, cloud: PointCloud) -> float:
    """Give the share of the points of use that get a cell of their own; 1 if there are none."""
    report = perception.project(cloud, LEVEL)
    of_use = report.used + report.hidden + report.no_beam
    return report.used / of_use if of_use else 1.0


def objects_S(perception: Perception, cloud: PointCloud, q_NS: Float64 | None) -> Objects:
    """Perceive a scan; give the objects in the sensor's own axes.

    Perception gives them in frame L. Which echo belongs to which object stays; centroids and radii
    are computed anew, unless the sensor is the vessel's origin and level.

    Parameters
    ----------
    q_NS : (4,) float64
        The sensor's attitude; None: the vessel is level.
    """
    objects = perception.step(cloud, attitude_of_vessel(perception.sensor, q_NS))
    if perception.sensor.mount == HERE and q_NS is None:
        return objects
    number = perception.object_image()
    cells = number >= 0
    p, number = cloud.points_S[perception.point_image()[cells], :2].astype(float), number[cells]
    sums = [np.bincount(number, p[:, axis], len(objects.p_L)) for axis in (0, 1)]
    centre = np.stack(sums, axis=1) / objects.points[:, None]
    away = np.hypot(*(p - centre[number]).T)
    radius = np.zeros(len(centre))
    np.maximum.at(radius, number, away)
    return replace(objects, p_L=centre, radius=radius, strips=None)


def attitude_of_vessel(sensor: Sensor, q_NS: Float64 | None) -> Float64:
    """Give q_NB, (4,), by the attitude of a sensor on the vessel; None: the vessel is level."""
    if q_NS is None:
        return LEVEL
    return quaternion_product(q_NS, sensor.q_BS * np.array([1.0, -1.0, -1.0, -1.0]))


def ground_below(points_S: Float32) -> float | None:
    """[m] Give how far below the sensor a layer with many of the points is; none if none is."""
    down = points_S[:, 2]
    down = down[(down > 2 * LAYER_M) & (down < 100.0)]
    if len(down) == 0:
        return None
    counts = np.bincount((down / (2 * LAYER_M)).astype(np.int64))
    middle = (int(np.argmax(counts)) + 0.5) * 2 * LAYER_M
    for _ in range(3):  # the layer is centred on what it holds
        layer = down[np.abs(down - middle) <= LAYER_M]
        middle = float(layer.mean()) if len(layer) else middle
    return middle if len(layer) >= GROUND_SHARE * len(points_S) else None


# A range image from the points themselves, for scans that no description fits: corrected for motion
# or calibration, thinned, or from a sensor that nobody described. The beams are found where the
# elevations gather; if those are smeared, evenly spaced rows take their place.

BEAMS = (4, 256)
"""[-] Fewest and most rows of an image."""
STEP_DEG = (0.05, 1.0)
"""[deg] Finest and coarsest columns of an image."""
BIN_DEG = 0.02
"""[deg] Of the histogram in which elevations gather."""
SMOOTH_DEG = 0.06
"""[deg] Standard deviation of what smooths it."""
PEAK = 0.5
"""[-] A beam's peak rises over the valley beside it by this share of its height, at least."""
SLICE_DEG = 0.1
"""[deg] Echoes within so little elevation mostly come from one beam."""
TOO_FEW = 100
"""[-] Points that show no pattern."""


def fitted(points_S: Float32, ring: NDArray[np.uint16] | None, like: Sensor) -> list[Sensor]:
    """Give sensors that might have taken these points, most trustworthy first.

    Parameters
    ----------
    points_S : (N, 3) float32
        Points [m], frame S (FRD); those without an echo are left out.
    ring : (N,) uint16
        The beam of each point, where the file tells it.
    like
        Noise, range and all else are this sensor's; its scan is of one moment.
    """
    with np.errstate(over="ignore", invalid="ignore"):
        seen = np.isfinite(points_S).all(axis=1) & (np.abs(points_S).max(axis=1, initial=0) > 0)
    x, y, z = points_S[seen].T.astype(np.float64)
    if len(x) < TOO_FEW:
        return []
    elevation, azimuth = np.arctan2(-z, np.hypot(x, y)), np.arctan2(y, x)
    step = _azimuth_step(elevation, azimuth)
    beams = [_gathered(elevation), _even(elevation, azimuth, step)]
    if ring is not None:
        beams.insert(0, _ring_medians(elevation, ring[seen]))
    columns = Columns(
        count=max(2, round(2 * math.pi / step)),
        first_rad=math.pi,
        span_rad=-2 * math.pi,
        endpoint=False,
    )
    return [
        structs.replace(
            like,
            name=f"fitted to {len(degrees)} beams",
            beams=Beams(elevations_deg=tuple(degrees.tolist())),
            columns=columns,
            scan_duration_s=0.0,
        )
        for degrees in map(_apart, beams)
        if BEAMS[0] <= len(degrees) <= BEAMS[1]
    ]


def _azimuth_step(elevation: Float64, azimuth: Float64) -> float:
    """Take the usual gap of azimuths within thin slices of elevation."""
    thin = np.floor(elevation / math.radians(SLICE_DEG))
    order = np.lexsort((azimuth, thin))
    gaps = np.diff(azimuth[order])[np.diff(thin[order]) == 0]
    least, most = np.radians(STEP_DEG)
    gaps = gaps[(gaps > 0.5 * least) & (gaps < 2 * most)]
    usual = float(np.percentile(gaps, 40)) if len(gaps) else most
    return float(np.clip(usual, least, most))


def _ring_medians(elevation: Float64, ring: NDArray[np.uint16]) -> Float64:
    """[deg] Give the middle elevation of each ring."""
    order = np.lexsort((elevation, ring))
    _, first, count = np.unique(ring[order], return_index=True, return_counts=True)
    middle: Float64 = np.degrees(np.sort(elevation[order][first + count // 2]))
    return middle


def _gathered(elevation: Float64) -> Float64:
    """[deg] Give where elevations gather: the peaks of a smoothed histogram."""
    from scipy.ndimage import gaussian_filter1d
    from scipy.signal import find_peaks

    degrees = np.degrees(elevation)
    low = degrees.min() - 1.0
    counts = np.bincount(((degrees - low) / BIN_DEG).astype(np.int64)).astype(np.float64)
    smooth = gaussian_filter1d(np.append(counts, np.zeros(50)), SMOOTH_DEG / BIN_DEG)
    peaks, found = find_peaks(smooth, prominence=1e-3 * smooth.max())
    peaks = peaks[found["prominences"] > PEAK * smooth[peaks]]
    return np.asarray(low + (peaks + 0.5) * BIN_DEG, dtype=np.float64)


def _even(elevation: Float64, azimuth: Float64, step: float) -> Float64:
    """[deg] Give rows as far apart as points within one column usually are."""
    column = np.floor(azimuth / step)
    order = np.lexsort((elevation, column))
    gaps = np.degrees(np.diff(elevation[order])[np.diff(column[order]) == 0])
    gaps = gaps[gaps > 2 * BIN_DEG]
    if len(gaps) == 0:
        return np.empty(0)
    lowest, highest = np.percentile(np.degrees(elevation), [0.1, 99.9])
    rows = int(np.clip((highest - lowest) / np.median(gaps), *BEAMS)) + 1
    return np.linspace(lowest, highest, min(rows, BEAMS[1]))


def _apart(degrees: Float64) -> Float64:
    """Drop beams that coincide with the one below, or leave what a description may say."""
    degrees = degrees[np.abs(degrees) < 89.0]
    return degrees[np.diff(degrees, prepend=-np.inf) > BIN_DEG]


# The plane of the ground or the water in a scan of unknown attitude. No sensor is quite level: on a
# car it is half a degree off, on a boat five. At 20 m that lifts the ground by decimetres, above
# any height at which it could be cut off.

REACH_M = 20.0
"""[m] Farther echoes are not asked."""
ENOUGH = 4000
"""[-] Of more echoes every second, third, .. is asked."""
SLOPES = np.linspace(-0.2, 0.2, 9)
"""[-] Of the planes that are tried, forward and to starboard."""
BANDS_M = (0.3, 0.2, 0.15, 0.15)
"""[m] How far from the plane its echoes may lie: of the best one tried, of each better one."""
STEEPEST = math.tan(math.radians(12.0))
"""[-] A plane that is steeper is no surface that one drives or floats on."""
OFF_M = 0.5
"""[m] By how much the height that was told may be wrong."""
FEWEST = 60
"""[-] Fewer echoes make no plane."""
MOST_UNDER, MOST_ABOVE = 0.05, 0.5
"""[-] Echoes close under it and close above it, as shares of those on it."""
NARROWEST_M = 1.0
"""[m] Standard deviation across; echoes along a line make no plane."""


class Surface(NamedTuple):
    """The plane of the ground or the water, as the sensor sees it."""

    q_NS: Float64
    """(4,) The attitude in which it is level, a unit quaternion, w first."""
    height_m: float
    """[m] Of the sensor over it."""
    tilt_rad: float
    """[rad] Between the sensor's axis and the plane's normal."""


def find_surface(points_S: Float32, height_m: float) -> Surface | None:
    """Find the surface; none if the scan shows none.

    Of some planes z = a x + b y + c the one that most echoes lie on is made better by least
    squares, with less and less that counts as near: what stands on it falls out.

    Parameters
    ----------
    points_S : (N, 3) float32
        Points [m], frame S (FRD).
    height_m : float
        Height of the sensor over the surface, about [m].
    """
    p = _near(points_S, height_m)
    if len(p) < FEWEST:
        return None
    plane = _most_on(p, height_m)
    for band in BANDS_M:
        on = p[np.abs(_off(p, plane)) < band]
        if len(on) < FEWEST or _spread(on) < NARROWEST_M:
            return None
        plane = _fitted(on)
    return _surface(plane) if _plausible(plane, height_m) and _bears(p, plane) else None


def _near(points_S: Float32, height_m: float) -> Float64:
    """Give some of the points that may lie on the surface."""
    with np.errstate(over="ignore", invalid="ignore"):
        far = np.hypot(points_S[:, 0], points_S[:, 1])
        low = np.abs(points_S[:, 2] - height_m) < OFF_M + far * STEEPEST
    near = np.flatnonzero((far < REACH_M) & low)
    return points_S[near[:: 1 + len(near) // ENOUGH]].astype(np.float64)


def _most_on(p: Float64, height_m: float) -> Float64:
    """Give the plane that most echoes lie on, of those that are tried."""
    tried = [np.array([a, b, height_m]) for a in SLOPES for b in SLOPES]
    tried = [plane for plane in tried if math.hypot(*plane[:2]) < STEEPEST]
    weight = np.hypot(p[:, 0], p[:, 1])
    votes = [weight @ (np.abs(_off(p, plane)) < BANDS_M[0]) for plane in tried]
    return tried[int(np.argmax(votes))]


def _off(p: Float64, plane: Float64) -> Float64:
    """[m] Give how far below a plane points are."""
    off: Float64 = p[:, 2] - (p[:, :2] @ plane[:2] + plane[2])
    return off


def _spread(p: Float64) -> float:
    """[m] Give how far points reach to their narrower side, as a standard deviation."""
    return float(np.sqrt(np.linalg.eigvalsh(np.cov(p[:, :2].T))[0]))


def _fitted(p: Float64) -> Float64:
    """Give a, b, c of z = a x + b y + c, each ring of the ground weighing by its distance.

    Echoes are dense near the sensor; unweighted, the ground at the bow would outvote the rest.
    """
    weight = np.hypot(p[:, 0], p[:, 1])[:, None]
    A = np.column_stack([p[:, :2], np.ones(len(p))])
    return np.asarray(np.linalg.lstsq(weight * A, weight[:, 0] * p[:, 2], rcond=None)[0])


def _plausible(plane: Float64, height_m: float) -> bool:
    return math.hypot(plane[0], plane[1]) < STEEPEST and abs(plane[2] - height_m) < OFF_M


def _bears(p: Float64, plane: Float64) -> bool:
    """Tell whether a plane bears what there is: nothing is under it, little right above it.

    A plane through walls and hulls has as much of them on one side as on the other.
    """
    off, band = _off(p, plane), BANDS_M[-1]
    on = np.count_nonzero(np.abs(off) < band)
    under = np.count_nonzero((off >= 2 * band) & (off < 5 * band))  # waves reach half as far
    above = np.count_nonzero((off <= -band) & (off > -3 * band))
    return bool(under < MOST_UNDER * on and above < MOST_ABOVE * on)


def _surface(plane: Float64) -> Surface:
    """Give attitude and height by a plane.

    Down, seen from S, is (-a, -b, 1) / |..| = R_NS^T (0, 0, 1): Fossen (2021), eq. 2.31, third row.
    """
    norm = math.hypot(plane[0], plane[1], 1.0)
    x, y, z = np.array([-plane[0], -plane[1], 1.0]) / norm
    q_NS = quaternion_from_euler(math.atan2(y, z), -math.asin(x), 0.0)
    return Surface(q_NS, float(plane[2]) / norm, math.acos(z))
