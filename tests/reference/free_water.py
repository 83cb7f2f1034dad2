"""A slow, plain reference of the free water: what a scan's sights show of it, bin by bin."""

import math

import numpy as np
from numpy.typing import NDArray

from twinscrew.runtime.messages.types import Float64


def free(sights: Float64, begin: Float64, sector: float, guard: float, is_closed: bool) -> Float64:
    """Give how far the water is free in each bin of azimuth, from -pi on [m].

    Parameters
    ----------
    sights : (A, 2) float64
        Where each sector's sight ends [m].
    begin : (2,) float64
        Where they begin [m].
    sector, guard : float
        Greatest width of a bin; how far to either side the water must be as free [rad].
    is_closed : bool
        False if beside the first sector, and the last, nothing is looked at.
    """
    away = sights - begin
    reach = np.linalg.norm(away, axis=1)
    if not is_closed:
        reach[[0, -1]] = 0.0
    count = math.ceil(2 * math.pi / sector)
    seen = np.full(count, np.inf)
    np.minimum.at(seen, _bins(away, count), reach)
    wide = min(math.ceil(guard * count / (2 * math.pi)), count // 2)
    around: Float64 = np.min([np.roll(seen, k) for k in range(-wide, wide + 1)], axis=0)
    return np.where(np.isinf(around), 0.0, around)


def holds(water: Float64, begin: Float64, places: Float64, margin: float) -> NDArray[np.bool_]:
    """Tell which places, (L, 2), lie in the water that is free, further from its end [m]."""
    away = places - begin
    inside: NDArray[np.bool_] = (
        np.linalg.norm(away, axis=1) < water[_bins(away, len(water))] - margin
    )
    return inside


def _bins(away: Float64, count: int) -> NDArray[np.intp]:
    turn = np.arctan2(away[:, 1], away[:, 0]) + math.pi
    bins: NDArray[np.intp] = np.clip(turn * (count / (2 * math.pi)), 0, count - 1).astype(np.intp)
    return bins
