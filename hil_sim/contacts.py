"""How near the vessels are to everything they may not touch: circles, and boxes seen from above."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from twinscrew.runtime.messages.types import Float64


@dataclass(frozen=True, slots=True, kw_only=True)
class Obstacles:
    """What stands still."""

    circles: Float64
    """[m] [N] (B, 3) North, east, radius: buoys."""
    boxes: Float64
    """[m, rad] [N] (Q, 6) North, east of the centre; length, width, height; heading: quays."""


def gaps(
    position_N: Float64, radius: float, present: NDArray[np.bool_], obstacles: Obstacles
) -> Float64:
    """Give the distances between the vessels' circles and everything else.

    Parameters
    ----------
    position_N : (V, 2) float64
        The vessels' origins [m], frame N.
    radius : float
        Radius of the circle that holds a vessel [m].
    present : (V,) bool
        False for a vessel that has left the map.
    obstacles : Obstacles
        Buoys and quays.

    Returns
    -------
    gaps : (V, V + B + Q) float64
        Distances between surfaces [m]: to vessels, to buoys, to quays. Negative where they overlap;
        infinite to itself, and to and from what is not there.
    """
    vessels = _distances(position_N, position_N) - 2 * radius
    np.fill_diagonal(vessels, np.inf)
    vessels[:, ~present] = np.inf
    buoys = _distances(position_N, obstacles.circles[:, :2]) - obstacles.circles[:, 2] - radius
    quays = [distance_to_box(position_N, box) - radius for box in obstacles.boxes]
    all_gaps = np.column_stack([vessels, buoys, *quays])
    all_gaps[~present] = np.inf
    return all_gaps


def distance_to_box(position_N: Float64, box: Float64) -> Float64:
    """Give the distances (V,) [m] of points, (V, 2), to a box seen from above; 0 inside."""
    north, east, length, width, _, heading = box
    c, s = np.cos(heading), np.sin(heading)
    offset = (position_N - [north, east]) @ np.array([[c, -s], [s, c]])  # in the box's own axes
    outside = np.maximum(np.abs(offset) - [length / 2, width / 2], 0.0)
    distance: Float64 = np.hypot(outside[:, 0], outside[:, 1])
    return distance


def _distances(a: Float64, b: Float64) -> Float64:
    offset = a[:, None] - b[None]
    distances: Float64 = np.hypot(offset[..., 0], offset[..., 1])
    return distances
