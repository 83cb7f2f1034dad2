"""A scan as the page shows it: seen from above, thinned out, in centimetres around the vessel."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from twinscrew.runtime.geometry import rotation_from_quaternion
from twinscrew.runtime.messages.types import Odometry, PointCloud
from twinscrew.runtime.perception.sensor import Sensor

MOST_POINTS = 1500
"""[-] Points of a vessel in one frame: 6 kB."""
REACH_M = 300.0
"""[m] Farther echoes do not fit into 16 bits of centimetres (327 m)."""


def echoes_from_above(
    cloud: PointCloud, odometry: Odometry, sensor: Sensor, most: int = MOST_POINTS
) -> NDArray[np.int16]:
    """Give the echoes around a vessel.

    Parameters
    ----------
    cloud
        May hold rays without an echo (not finite).
    odometry
        Near the scan's time: its attitude levels the points.
    most
        [-] How many points to give; from a larger scan, every second, third, ... is taken.

    Returns
    -------
    p_cm : (M, 2) int16
        [cm] North and east of the vessel, axes of N, M <= most.
    """
    points_S = cloud.points_S[np.isfinite(cloud.points_S).all(axis=1)]
    points_S = points_S[:: max(1, -(-len(points_S) // most))]
    R_NB = rotation_from_quaternion(odometry.q_NB)
    points_B = points_S @ sensor.R_BS.T + sensor.mount_position_B
    p_N = (points_B @ R_NB.T)[:, :2]
    p_N = p_N[(np.abs(p_N) < REACH_M).all(axis=1)]
    return np.round(100.0 * p_N).astype("<i2")
