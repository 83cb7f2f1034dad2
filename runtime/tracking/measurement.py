"""What one scan says about objects: where they are in frame N, and how far that can be trusted.

The centroid of the visible side lies nearer to the sensor than the object's centre. For an upright
cylinder of radius r under parallel rays evenly spread across it, the visible points' mean lies
r pi / 4 before the axis, and the farthest of them, at the edges, hypot(1, pi / 4) r from that mean:
the centre lies 0.62 of the *reported* radius behind the centroid. A hull differs (see
docs/tracking.md), so the share is a setting; what remains is left to the filter's bias states.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from twinscrew.runtime.geometry.frames import rotation_2d
from twinscrew.runtime.messages.types import Float64, Objects, Odometry
from twinscrew.runtime.settings import NonNegative, Positive, Settings


class MeasurementSettings(Settings, frozen=True):
    """How the visible centroid relates to the centre. Shares are of the reported radius."""

    depth: NonNegative = 0.3
    """[-] Expected distance of the centre behind the visible centroid."""
    bias_along: NonNegative = 0.25
    """[-] Standard deviation of that distance, over aspects."""
    bias_across: NonNegative = 0.25
    """[-] Standard deviation of the centroid's offset across the line of sight, over aspects."""
    bias_time_s: Positive = 3.0
    """[s] Time constant with which both wander."""
    sigma_m: Positive = 0.03
    """[m] White noise of a centroid with many points: sensor and waves."""
    sigma_per_range: NonNegative = 0.002
    """[-] White noise that grows with the range: beams grow apart."""
    scatter: NonNegative = 0.5
    """[-] White noise of a single-point centroid; falls with the root of the number of points."""


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
    finite = np.isfinite(objects.p_B).all(axis=1) & np.isfinite(objects.radius)
    finite &= bool(np.isfinite(odometry.position_N[:2]).all() and np.isfinite(odometry.heading))
    p_B, radius, points = objects.p_B[finite], objects.radius[finite], objects.points[finite]
    R_NB = rotation_2d(odometry.heading)
    p_BN = p_B @ R_NB.T
    distance = np.hypot(p_BN[:, 0], p_BN[:, 1])
    along = p_BN / np.maximum(distance, 1e-9)[:, None]
    z_N = odometry.position_N[:2] + p_BN + along * (settings.depth * radius)[:, None]
    variance = (
        settings.sigma_m**2
        + (settings.sigma_per_range * distance) ** 2
        + (settings.scatter * radius) ** 2 / np.maximum(points, 1)
    )
    R = variance[:, None, None] * np.eye(2)
    return Measurements(z_N=z_N, H=observation_matrix(along), R=R, radius=radius)


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
