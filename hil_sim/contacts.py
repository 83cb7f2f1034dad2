"""How near the vessels are to everything they may not touch: circles, and boxes seen from above."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from twinscrew.runtime.messages.types import Float64
from twinscrew.runtime.vessel_description import VesselDescription


@dataclass(frozen=True, slots=True, kw_only=True)
class Obstacles:
    """What stands still."""

    circles: Float64
    """[m] [N] (B, 3) North, east, radius: buoys."""
    boxes: Float64
    """[m, rad] [N] (Q, 6) North, east of the centre; length, width, height; heading: quays."""


class HullCircles:
    """The circles that hold V vessels, N in all, in the order of the vessels."""

    def __init__(self, vessels: Sequence[VesselDescription]) -> None:
        counts = [len(vessel.circles_m) for vessel in vessels]
        ahead, radius = np.array([circle for v in vessels for circle in v.circles_m]).T
        self.ahead: Float64 = ahead
        """[m] (N,) How far ahead of its vessel's origin."""
        self.radius: Float64 = radius
        """[m] (N,)"""
        self.vessel: NDArray[np.intp] = np.repeat(np.arange(len(vessels)), counts)
        """(N,) Whose each is."""
        self.first: NDArray[np.intp] = np.cumsum([0, *counts[:-1]])
        """(V,) The number of each vessel's first."""
        self.alone = len(radius) == len(vessels) and not ahead.any()
        """Whether each vessel has one circle, round its origin."""

    def centres(self, position_N: Float64, heading: Float64) -> Float64:
        """Give the circles' centres, (N, 2) [m], frame N, of vessels at (V, 2) [m], (V,) [rad]."""
        if self.alone:
            return position_N
        forward = np.column_stack([np.cos(heading), np.sin(heading)])
        centres: Float64 = position_N[self.vessel] + self.ahead[:, None] * forward[self.vessel]
        return centres

    def of_vessels(self, gaps: Float64) -> Float64:
        """Give the least gaps of each vessel, (V, V + B + Q), from those of circles."""
        if self.alone:
            return gaps
        rows = np.minimum.reduceat(gaps, self.first, axis=0)
        others = np.minimum.reduceat(rows[:, : len(self.vessel)], self.first, axis=1)
        both: Float64 = np.concatenate([others, rows[:, len(self.vessel) :]], axis=1)
        return both


def reaches(hulls: HullCircles, there: NDArray[np.bool_], obstacles: Obstacles) -> Float64:
    """Give at which distances between centres surfaces touch, for `gaps`.

    Parameters
    ----------
    hulls : HullCircles
        The vessels' circles.
    there : (V,) bool
        False for a vessel that has left the map.
    obstacles : Obstacles
        Buoys and quays.

    Returns
    -------
    reaches : (N, N + B + Q) float64
        Distances [m]; minus infinity for what cannot touch: a vessel and itself, or one that left.
    """
    count, present = len(hulls.radius), there[hulls.vessel]
    others = hulls.radius, obstacles.circles[:, 2], np.zeros(len(obstacles.boxes))
    reaches: Float64 = hulls.radius[:, None] + np.concatenate(others)
    reaches[:, :count][hulls.vessel[:, None] == hulls.vessel] = -np.inf
    reaches[~present] = -np.inf
    reaches[:, :count][:, ~present] = -np.inf
    return reaches


def gaps(position_N: Float64, reaches: Float64, obstacles: Obstacles) -> Float64:
    """Give the distances between the surfaces of the vessels' circles and of everything else.

    Parameters
    ----------
    position_N : (N, 2) float64
        The circles' centres [m], frame N.
    reaches : (N, N + B + Q) float64
        Distances [m] at which surfaces touch, see `reaches`.
    obstacles : Obstacles
        Buoys and quays.

    Returns
    -------
    gaps : (N, N + B + Q) float64
        Distances [m] to circles, to buoys, to quays. Negative where they overlap, infinite where
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
