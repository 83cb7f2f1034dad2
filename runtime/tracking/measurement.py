"""What one scan says about objects: where they are in frame N, and how far that can be trusted.

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
from typing import NamedTuple

import numpy as np

from twinscrew.runtime import _native
from twinscrew.runtime.geometry import rotation_2d
from twinscrew.runtime.messages.types import Float64, Objects, Odometry
from twinscrew.runtime.settings import NonNegative, Positive, Settings
from twinscrew.runtime.tracking.displacement import Sight
from twinscrew.runtime.tracking.view import View

NO_STRIPS = np.empty((0, 4))


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
    edge_m: Positive = 17.0
    """[m] A centroid farther than this may be that of a part: the rest is out of range."""
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
    sights: list[Sight]
    """(K,) Their strips, and whether they stand."""


class Stand(NamedTuple):
    """From where a scan was taken."""

    p_N: Float64
    """[m] [N] (2,) The vessel's place."""
    R_NL: Float64
    """(2, 2) Turns a vector of the levelled frame L into N."""

    @classmethod
    def of(cls, odometry: Odometry) -> Stand:
        """Take it from the vessel's state at the scan's stamp."""
        return cls(odometry.position_N[:2], rotation_2d(odometry.heading))

    def in_N(self, places_L: Float64) -> Float64:
        """Give places, (K, 2) [m], of the levelled frame L in N."""
        return places_L @ self.R_NL.T + self.p_N

    def in_L(self, places_N: Float64) -> Float64:
        """Give places, (K, 2) [m], of N in the levelled frame L."""
        return (places_N - self.p_N) @ self.R_NL

    @property
    def is_known(self) -> bool:
        """False if a number of it is none."""
        (north, east), ahead = self.p_N.tolist(), float(self.R_NL[0, 0])
        return math.isfinite(north + east + ahead)


class Centroids:
    """Turns objects into measurements; the work is in ``runtime/native/centroids.hpp``."""

    def __init__(self, settings: MeasurementSettings, view: View) -> None:
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
            edge=settings.edge_m,
            edge_sigma=settings.edge_sigma,
        )

    def measure(
        self, objects: Objects, own: Stand, stands: Sequence[bool | None] | None = None
    ) -> Measurements:
        """Give the objects of a scan in frame N; what is not finite is left out.

        Parameters
        ----------
        objects
            As perception found them.
        own
            From where the scan was taken.
        stands
            Of each object, see `standing.Standing.pieces`; by default nothing is known.
        """
        (cosine, _), (sine, _) = own.R_NL.tolist()
        z_N, H, R, radius, gate, kept = self._model.measured(
            objects.p_L, objects.radius, objects.points, (*own.p_N.tolist(), cosine, sine)
        )
        return Measurements(z_N, H, R, radius, gate, _sights(objects, own, stands, kept))

    def bias_variance(self, places_N: Float64, radius: Float64, own: Stand) -> Float64:
        """Give how far centroids may be off what is expected of them, along and across.

        Parameters
        ----------
        places_N : (K, 2 or more) float64
            Where things are [m]; of states the first two numbers count.
        radius : (K,) float64
            Their radii [m].
        own
            From where they are seen.

        Returns
        -------
        variance : (K, 2) float64
            Along and across the line of sight [m2].
        """
        return self._model.bias_variance(places_N, radius, *own.p_N.tolist())


def _distances(settings: MeasurementSettings, view: View) -> list[float]:
    """Give the distances of the table for a sensor; they never fall."""
    scaled = [r * view.near_scale if r <= settings.near_m else r for r in settings.range_m]
    return [min(scaled[k:]) for k in range(len(scaled))]


def _sights(
    objects: Objects, own: Stand, stands: Sequence[bool | None] | None, kept: list[int]
) -> list[Sight]:
    """Give what is seen of the objects that are kept, in N."""
    strips, stamp_ns = objects.strips, objects.stamp_ns
    stands = stands or [None] * len(objects.radius)
    if strips is None:
        return [Sight(stamp_ns, NO_STRIPS, stands[k]) for k in kept]
    rows_N = strips.rows_L.copy()
    rows_N[:, :2] = own.in_N(strips.rows_L[:, :2])
    begin = strips.begin.tolist()
    return [Sight(stamp_ns, rows_N[begin[k] : begin[k + 1]], stands[k]) for k in kept]
