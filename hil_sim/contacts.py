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


def reaches(radius: float, present: NDArray[np.bool_], obstacles: Obstacles) -> Float64:
    """Give at which distances between centres surfaces touch, for `gaps`.

    Parameters
    ----------
    radius : float
        Radius of the circle that holds a vessel [m].
    present : (V,) bool
        False for a vessel that has left the map.
    obstacles : Obstacles
        Buoys and quays.

    Returns
    -------
    reaches : (V, V + B + Q) float64
        Distances [m]; minus infinity for what cannot touch: a vessel and itself, or one that left.
    """
    count = len(present)
    others = np.full(count, radius), obstacles.circles[:, 2], np.zeros(len(obstacles.boxes))
    reaches = np.tile(radius + np.concatenate(others), (count, 1))
    np.fill_diagonal(reaches, -np.inf)
    reaches[~present] = -np.inf
    reaches[:, :count][:, ~present] = -np.inf
    return reaches


def gaps(position_N: Float64, reaches: Float64, obstacles: Obstacles) -> Float64:
    """Give the distances between the surfaces of the vessels and of everything else.

    Parameters
    ----------
    position_N : (V, 2) float64
        The vessels' origins [m], frame N.
    reaches : (V, V + B + Q) float64
        Distances [m] at which surfaces touch, see `reaches`.
    obstacles : Obstacles
        Buoys and quays.

    Returns
    -------
    gaps : (V, V + B + Q) float64
        Distances [m] to vessels, to buoys, to quays. Negative where they overlap, infinite where
        they cannot touch.
    """
    centres = np.concatenate([position_N, obstacles.circles[:, :2]])
    offset = position_N[:, None] - centres
    distance: Float64 = np.hypot(offset[..., 0], offset[..., 1])
    if len(obstacles.boxes):
        to_boxes = [distance_to_box(position_N, box) for box in obstacles.boxes]
        distance = np.column_stack([distance, *to_boxes])
    return distance - reaches


def distance_to_box(position_N: Float64, box: Float64) -> Float64:
    """Give the distances (V,) [m] of points, (V, 2), to a box seen from above; 0 inside."""
    north, east, length, width, _, heading = box
    c, s = np.cos(heading), np.sin(heading)
    offset = (position_N - [north, east]) @ np.array([[c, -s], [s, c]])  # in the box's own axes
    outside = np.maximum(np.abs(offset) - [length / 2, width / 2], 0.0)
    distance: Float64 = np.hypot(outside[:, 0], outside[:, 1])
    return distance
