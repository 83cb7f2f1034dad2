"""What one scan says about objects: where they are in frame N, and how far that can be trusted.

The centroid of the visible side lies nearer to the sensor than the object's centre. For an upright
cylinder of radius r under parallel rays evenly spread across it, the visible points' mean lies
r pi / 4 before the axis, and the farthest of them, at the edges, hypot(1, pi / 4) r from that mean:
the centre lies 0.62 of the *reported* radius behind the centroid. A hull differs (see
docs/tracking.md), so the share is a setting; what remains is left to the filter's bias states.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from twinscrew.runtime.geometry.frames import rotation_2d
from twinscrew.runtime.messages.types import Float64, Objects, Odometry
from twinscrew.runtime.settings import NonNegative, Positive, Settings
from twinscrew.runtime.tracking.displacement import Sight

NO_STRIPS = np.empty((0, 4))


class MeasurementSettings(Settings, frozen=True, kw_only=True):
    """How the visible centroid relates to the centre; figures: docs/tracking.md."""

    range_m: tuple[NonNegative, ...] = (7.2, 10.0, 16.5, 19.5)
    """[m] Distances of a hull's centroid, at which"""
    depth_m: tuple[float, ...] = (0.02, 0.48, 0.45, 1.0)
    """[m] its centre is expected this far behind; linear in between, constant outside."""
    small_depth_m: NonNegative = 0.32
    """[m] The same for a buoy, at any distance."""
    buoy_hull_m: tuple[Positive, Positive] = (0.7, 1.5)
    """[m] Up to the first radius all is a buoy, from the second on a hull; linear in between."""
    bias_along: NonNegative = 0.05
    """[-] Standard deviation of that distance over aspects, as a share of the radius."""
    bias_across: NonNegative = 0.06
    """[-] Standard deviation of the centroid's offset across the line of sight, likewise."""
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
    """(K,) Their strips."""


def measure(objects: Objects, odometry: Odometry, settings: MeasurementSettings) -> Measurements:
    """Turn the objects of a scan into measurements in frame N; what is not finite is left out.

    Parameters
    ----------
    objects
        As perception found them.
    odometry
        The vessel's state at the scan's stamp.
    settings
        How the centroid relates to the centre.
    """
    R_NB = rotation_2d(odometry.heading)
    finite = np.isfinite(objects.p_B).all(axis=1) & np.isfinite(objects.radius)
    finite &= bool(np.isfinite(odometry.position_N[:2]).all() and np.isfinite(R_NB[0, 0]))
    p_B, radius, points = objects.p_B[finite], objects.radius[finite], objects.points[finite]
    p_BN = p_B @ R_NB.T
    distance = np.hypot(p_BN[:, 0], p_BN[:, 1])
    along = p_BN / np.maximum(distance, 1e-9)[:, None]
    z_N = odometry.position_N[:2] + p_BN + along * depth(distance, radius, settings)[:, None]
    variance = (
        settings.sigma_m**2
        + (settings.scatter * radius) ** 2 / np.maximum(points, 1)
        + (settings.edge_sigma * radius * (distance > settings.edge_m)) ** 2
    )
    R = variance[:, None, None] * np.eye(2)
    return Measurements(
        z_N=z_N,
        H=observation_matrix(along),
        R=R,
        radius=radius,
        gate=(settings.jump * radius) ** 2,
        sights=_sights(objects, odometry.position_N[:2], R_NB, np.flatnonzero(finite)),
    )


def _sights(objects: Objects, p_N: Float64, R_NB: Float64, kept: NDArray[np.intp]) -> list[Sight]:
    """Give the strips of the objects that are kept, in N."""
    strips = objects.strips
    if strips is None:
        return [Sight(objects.stamp_ns, NO_STRIPS)] * len(kept)
    rows_N = strips.rows_B.copy()
    rows_N[:, :2] = strips.rows_B[:, :2] @ R_NB.T + p_N
    begin = strips.begin.tolist()
    return [Sight(objects.stamp_ns, rows_N[begin[k] : begin[k + 1]]) for k in kept.tolist()]


def depth(distance: Float64, radius: Float64, settings: MeasurementSettings) -> Float64:
    """Give how far centres are expected behind visible centroids, (K,) [m].

    Parameters
    ----------
    distance : (K,) float64
        From the vessel to the centroids [m].
    radius : (K,) float64
        As seen [m].
    settings
        The table.
    """
    hull = np.interp(distance, settings.range_m, settings.depth_m)
    share = np.interp(radius, settings.buoy_hull_m, (0.0, 1.0))
    expected: Float64 = settings.small_depth_m + share * (hull - settings.small_depth_m)
    return expected


def observation_matrix(along: Float64) -> Float64:
    """Give H, (K, 2, 6): a centroid is the centre less the bias, turned by the line of sight.

    Parameters
    ----------
    along : (K, 2) float64
        Unit vectors [N] from the sensor to the objects.
    """
    H = np.zeros((len(along), 2, 6))
    H[:, 0, 0] = H[:, 1, 1] = 1.0
    H[:, :, 4] = -along
    H[:, 0, 5], H[:, 1, 5] = along[:, 1], -along[:, 0]
    return H
