"""How near the vessels are to everything they may not touch.

Vessels, buoys, piles and boxes by the circles around the hulls, as the paper's experiments; shores
and fences by the hulls' rectangles, because a circle cannot pass where a hull can.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from twinscrew.runtime.charts.static_map import StaticMap
from twinscrew.runtime.messages.types import Float64
from twinscrew.runtime.vessel_description import VesselDescription


@dataclass(frozen=True, slots=True, kw_only=True)
class Obstacles:
    """What stands still."""

    circles: Float64
    """[m] [N] (B, 3) North, east, radius: buoys and piles."""
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


SIGHT_M = 25.0
"""[m] Edges farther from a vessel's origin than this are not looked at,"""
RENEW_M = 5.0
"""[m] and those within are looked up again when a vessel has moved so far."""


class Shore:
    """How far hulls, as rectangles, are from a forbidden region.

    Parameters
    ----------
    region
        What they must keep out of.
    vessels
        Their lengths and beams.
    """

    def __init__(self, region: StaticMap, vessels: Sequence[VesselDescription]) -> None:
        self._region = region
        self._halves = np.array([(v.length_m, v.beam_m) for v in vessels]) / 2
        signs = np.array([(1, 1), (1, -1), (-1, -1), (-1, 1)])
        self._corners = signs * self._halves[:, None]  # (V, 4, 2), frame B
        self._at: Float64 | None = None
        self._edges = np.empty((0, 2, 2))

    def gaps(self, position_N: Float64, heading: Float64) -> Float64:
        """Give each hull's distance (V,) [m]; not above 0 in contact, infinite far away.

        Parameters
        ----------
        position_N : (V, 2) float64
            Where the vessels are [m], frame N.
        heading : (V,) float64
            [rad]
        """
        self._look_up(position_N)
        if not len(self._edges):
            return np.full(len(position_N), np.inf)
        c, s = np.cos(heading)[:, None], np.sin(heading)[:, None]
        off = self._edges[None] - position_N[:, None, None]  # (V, K, 2, 2)
        x = off[..., 0] * c[..., None] + off[..., 1] * s[..., None]
        y = off[..., 1] * c[..., None] - off[..., 0] * s[..., None]
        half = self._halves[:, None]
        # Each edge's beginning to the rectangle: every corner of the region begins an edge.
        beyond = np.maximum(np.abs(x[..., 0]) - half[..., 0], 0.0)
        aside = np.maximum(np.abs(y[..., 0]) - half[..., 1], 0.0)
        gaps = np.hypot(beyond, aside).min(axis=1)
        # Each corner of the rectangle to the edges.
        dx, dy = (x[..., 1] - x[..., 0])[:, None], (y[..., 1] - y[..., 0])[:, None]
        to_x = self._corners[..., :1] - x[:, None, :, 0]
        to_y = self._corners[..., 1:] - y[:, None, :, 0]
        t = np.clip((to_x * dx + to_y * dy) / np.maximum(dx * dx + dy * dy, 1e-12), 0.0, 1.0)
        gaps = np.minimum(gaps, np.hypot(to_x - t * dx, to_y - t * dy).min(axis=(1, 2)))
        # What lies across a rectangle, and leaves its corners free, crosses one of its diagonals.
        for vessel in np.flatnonzero(gaps < np.hypot(*self._halves.T)).tolist():
            cos, sin = float(c[vessel, 0]), float(s[vessel, 0])
            corners = self._corners[vessel] @ np.array([[cos, sin], [-sin, cos]])
            fore, starboard, aft, port = position_N[vessel] + corners
            if self._region.blocks(fore, aft) or self._region.blocks(starboard, port):
                gaps[vessel] = -gaps[vessel]
        return np.asarray(gaps)

    def _look_up(self, position_N: Float64) -> None:
        """Keep the edges that are near any vessel."""
        if self._at is not None and np.abs(position_N - self._at).max() < RENEW_M:
            return
        self._at = position_N.copy()
        near = [self._region.near(place, SIGHT_M) for place in position_N]
        self._edges = np.unique(np.concatenate(near), axis=0)
