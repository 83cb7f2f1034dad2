"""What visible centroids say, in numpy; see ``runtime/native/centroids.hpp``."""

from __future__ import annotations

import numpy as np

from twinscrew.runtime.geometry import rotation_2d
from twinscrew.runtime.messages.types import Float64, Objects, Odometry
from twinscrew.runtime.tracking.lidar import (
    NO_SEGMENTS,
    LidarExtras,
    Measurements,
    MeasurementSettings,
    SensorView,
)


def measure(
    objects: Objects, odometry: Odometry, settings: MeasurementSettings, view: SensorView
) -> Measurements:
    """Turn the objects of a scan into measurements in frame N; what is not finite is left out.

    Parameters
    ----------
    objects
        As perception found them.
    odometry
        The vessel's state at the scan's stamp.
    settings
        How the centroid relates to the centre.
    view
        How the sensor looks at it.
    """
    R_NL = rotation_2d(odometry.heading)
    finite = np.isfinite(objects.p_L).all(axis=1) & np.isfinite(objects.radius)
    finite &= bool(np.isfinite(odometry.position_N[:2]).all() and np.isfinite(R_NL[0, 0]))
    p_L, radius, points = objects.p_L[finite], objects.radius[finite], objects.points[finite]
    p_BN = p_L @ R_NL.T
    distance = np.hypot(p_BN[:, 0], p_BN[:, 1])
    along = p_BN / np.maximum(distance, 1e-9)[:, None]
    z_N = odometry.position_N[:2] + p_BN + along * depth(distance, radius, settings, view)[:, None]
    edge_m = view.reach_m - 3.0 if settings.edge_m is None else settings.edge_m
    variance = (
        settings.sigma_m**2
        + (settings.scatter * radius) ** 2 / np.maximum(points, 1)
        + (settings.edge_sigma * radius * (distance > edge_m)) ** 2
    )
    R = variance[:, None, None] * np.eye(2)
    return Measurements(
        z_N=z_N,
        H=observation_matrix(along),
        R=R,
        radius=radius,
        gate=(settings.jump * radius) ** 2,
        extras=[LidarExtras(objects.stamp_ns, NO_SEGMENTS)] * len(radius),
    )


def depth(
    distance: Float64, radius: Float64, settings: MeasurementSettings, view: SensorView
) -> Float64:
    """Give how far centres are expected behind visible centroids, (K,) [m].

    Parameters
    ----------
    distance : (K,) float64
        From the vessel to the centroids [m].
    radius : (K,) float64
        As seen [m].
    settings, view
        The table, and by how much its near end is farther off.
    """
    hull = np.interp(distance, _distances(settings, view), settings.depth_m)
    share = hull_share(radius, settings)
    expected: Float64 = settings.small_depth_m + share * (hull - settings.small_depth_m)
    return expected


def _distances(settings: MeasurementSettings, view: SensorView) -> list[float]:
    """Give the distances of the table for a sensor; they never fall."""
    scaled = [r * view.near_scale if r <= settings.near_m else r for r in settings.range_m]
    return [min(scaled[k:]) for k in range(len(scaled))]


def hull_share(radius: Float64, settings: MeasurementSettings) -> Float64:
    """Give how much of a hull, and how little of a buoy, things of radius (K,) [m] are, 0 .. 1."""
    share: Float64 = np.interp(radius, settings.buoy_hull_m, (0.0, 1.0))
    return share


def bias_variance(
    distance: Float64, radius: Float64, settings: MeasurementSettings, view: SensorView
) -> Float64:
    """Give how far centroids are off what is expected of them, along and across, (K, 2) [m2].

    Parameters
    ----------
    distance : (K,) float64
        From the vessel [m].
    radius : (K,) float64
        Of the objects [m].
    settings, view
        How centroids wander, and between which rows.
    """
    gap2 = view.row_gap(distance) ** 2
    missed = (settings.row_spread_per_m * hull_share(radius, settings) * gap2) ** 2
    shares = np.array([settings.bias_along, settings.bias_across])
    variance: Float64 = (radius[:, None] * shares) ** 2 + missed[:, None]
    return variance


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
