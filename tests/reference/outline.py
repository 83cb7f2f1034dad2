"""A slow, plain reference of the outline: the nearest echo of every few columns of the image."""

import numpy as np
from numpy.typing import NDArray

from twinscrew.runtime.messages.types import Float64
from twinscrew.runtime.perception.sensor import Sensor


def outline(
    ranges: Float64,
    circles: NDArray[np.int32],
    p_L: Float64,
    cut_from: NDArray[np.int64],
    sensor: Sensor,
    R_LB: Float64,
    sector: int,
    reach_m: float,
) -> tuple[Float64, Float64, NDArray[np.int64]]:
    """Give where each sector's sight ends, (A, 2) [m]; how high its echo is, (A,) [m]; and of which
    cut object, (A,), or -1.

    Parameters
    ----------
    ranges : (M, W) float64
        The range image [m]; 0 where there is no echo.
    circles : (M, W) int32
        Each cell's circle; -1 where there is none.
    p_L : (M, W, 3) float64
        Where each cell's echo is [m], levelled, the third down.
    cut_from : (K,) int64
        Of each circle, what it was cut from; -1 if it was not cut.
    sensor
        It has a mount.
    R_LB : (3, 3) float64
        Levels frame B.
    sector : int
        Columns a sector.
    reach_m : float
        How far is looked.
    """
    ends, heights, seen = [], [], []
    for first in range(0, ranges.shape[1], sector):
        columns = np.arange(first, min(first + sector, ranges.shape[1]))
        rows = range(len(ranges))
        echoes = [(ranges[i, j], j, i) for j in columns for i in rows if ranges[i, j] > 0.0]
        if echoes:
            _, j, i = min(echoes)
            ends.append(p_L[i, j, :2])
            heights.append(-p_L[i, j, 2])
            seen.append(cut_from[circles[i, j]] if circles[i, j] >= 0 else -1)
        else:
            ends.append(_end(columns.mean(), sensor, R_LB, reach_m))
            heights.append(np.nan)
            seen.append(-1)
    return np.array(ends), np.array(heights), np.array(seen, dtype=np.int64)


def _end(column: float, sensor: Sensor, R_LB: Float64, reach_m: float) -> Float64:
    """Give the place at the range, seen from above, that a level ray of the sensor points to."""
    azimuth = sensor.first_azimuth + column * sensor.azimuth_step
    ray = R_LB @ sensor.R_BS @ [np.cos(azimuth), np.sin(azimuth), 0.0]
    place: Float64 = R_LB[:2] @ sensor.mount_position_B + reach_m * ray[:2] / np.hypot(*ray[:2])
    return place
