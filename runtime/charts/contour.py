"""The contour: how far off the nearest edge of something fixed is, direction by direction.

The horizon around a vessel is cut into equal sectors; sector 0 is centred on straight ahead and the
numbers go clockwise. A sector's distance is that to the nearest point of any edge inside it, exact
and not sampled along rays: a mooring post's corner between two rays is seen too.

    contour = np.full(32, range_m)                         # nothing fixed in sight
    contour = contour_of(map.near(place, range_m), place, heading, range_m)

A policy takes it as its optional input `contour` (N, 32). The training environment calls the same
kernel, `sector_distances`, for all vessels of all episodes at once.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from twinscrew.runtime.messages.types import Float32, Float64

SECTORS = 32
"""[-] Directions that a policy is shown."""
CONTOUR_RANGE_M = 40.0
"""[m] Edges farther away than this are not told apart, in the hull's own units: 8 lengths."""


def contour_of(
    edges: Float64,
    place: Float64,
    heading: float,
    range_m: float = CONTOUR_RANGE_M,
    sectors: int = SECTORS,
    *,
    inside: bool = False,
) -> Float32:
    """Give the distance to what is fixed, sector by sector.

    Parameters
    ----------
    edges : (S, 2, 2) float64
        Segments of the boundary of what must not be entered: from, to; north, east [m] [N]. Those
        farther than `range_m` away may be left out.
    place : (2,) float64
        [m] [N] Where the vessel is.
    heading
        [rad] Of the vessel, clockwise from north.
    range_m
        [m] The greatest distance that is told.
    sectors
        How many: sector k is centred on k times 2 pi / sectors, clockwise from straight ahead.
    inside
        Whether the place lies inside what must not be entered: edges alone do not tell.

    Returns
    -------
    (sectors,) float32
        [m] Least distance of any edge's point inside each sector, at most `range_m`; 0 everywhere
        inside.
    """
    if inside:
        return np.zeros(sectors, np.float32)
    if not len(edges):
        return np.full(sectors, range_m, np.float32)
    ends = (np.asarray(edges, np.float64) - np.asarray(place, np.float64)[:2]).reshape(-1, 2)
    levelled = (ends[:, 0] + 1j * ends[:, 1]) * np.exp(-1j * heading)
    distances = sector_distances(levelled[0::2], levelled[1::2], range_m, sectors)
    return np.asarray(distances.min(axis=0), np.float32)


def sector_distances(
    start: NDArray[np.complexfloating],
    end: NDArray[np.complexfloating],
    range_m: float,
    sectors: int,
) -> NDArray[np.floating]:
    """Give the distance from the origin to the part of each segment inside each sector.

    Along a segment the distance from the origin is convex, and a sector cuts one piece out of it.
    So the piece's nearest point is the segment's own nearest point, if that lies in the sector, or
    lies on one of the two rays that bound the sector.

    Parameters
    ----------
    start, end : (P,) complex
        [m] Forward + i starboard.
    range_m
        [m] The greatest distance that is told: also where a segment has no part in a sector.
    sectors
        How many.

    Returns
    -------
    (P, sectors) of the real type of `start`
    """
    forward, starboard = _rays(sectors, start.real.dtype.char)
    # Cross products of each ray with both ends: of different sign where it crosses the line.
    before = np.outer(start.imag, forward) - np.outer(start.real, starboard)
    after = np.outer(end.imag, forward) - np.outer(end.real, starboard)
    moment = (start.real * end.imag - start.imag * end.real)[:, None]
    crosses = (before > 0) != (after > 0)
    turn = after - before
    turn[~crosses] = 1
    along = moment / turn
    along[~crosses | (along <= 0)] = range_m
    np.minimum(along, range_m, out=along)
    distances = np.minimum(along, np.roll(along, -1, axis=1))
    nearest = nearest_point(start, end)
    which = sector_of(nearest, sectors)
    rows = np.arange(len(nearest))
    distances[rows, which] = np.minimum(distances[rows, which], np.abs(nearest))
    return np.asarray(distances)


def nearest_point(
    start: NDArray[np.complexfloating], end: NDArray[np.complexfloating]
) -> NDArray[np.complexfloating]:
    """Give the point of each segment that is nearest to the origin; all arrays have one shape."""
    way = end - start
    square = way.real * way.real + way.imag * way.imag
    along = -(start.real * way.real + start.imag * way.imag)
    share = np.clip(along / np.maximum(square, np.finfo(square.dtype).tiny), 0, 1)
    point: NDArray[np.complexfloating] = start + share * way
    return point


def sector_of(point: NDArray[np.complexfloating], sectors: int) -> NDArray[np.intp]:
    """Give the number of the sector in which each point, forward + i starboard, lies."""
    turns = np.arctan2(point.imag, point.real) * (sectors / (2 * np.pi))
    return np.asarray(np.rint(turns).astype(np.intp) % sectors)


@lru_cache(maxsize=8)
def _rays(sectors: int, kind: str) -> tuple[NDArray[np.floating], NDArray[np.floating]]:
    """Give the rays that bound the sectors, forward and starboard; ray k begins sector k."""
    angle = (np.arange(sectors) - 0.5) * (2 * np.pi / sectors)
    return np.cos(angle).astype(kind), np.sin(angle).astype(kind)
