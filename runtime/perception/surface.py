"""The plane of the ground or the water in a scan whose attitude nobody has told.

A sensor is never quite level: on a car it is half a degree off, on a boat five. At 20 m that lifts
the ground by decimetres, above any height at which it could be cut off.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from twinscrew.runtime.geometry.frames import quaternion_from_euler
from twinscrew.runtime.messages.types import Float32, Float64

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
