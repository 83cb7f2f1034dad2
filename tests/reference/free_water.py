"""A slow, plain reference of what a scan has shown of places: free, something there, or unknown."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from twinscrew.runtime.messages.types import Float64

UNKNOWN, FREE, TAKEN = range(3)
NOBODY = -1


@dataclass(frozen=True)
class Water:
    """How far the water is free in each bin of azimuth, from -pi on, and what ends it."""

    free: Float64
    """[m] (N,)"""
    is_echo: NDArray[np.bool_]
    """(N,) False where it ends because nothing more is looked at."""
    whose: NDArray[np.int64]
    """(N,)"""

    def bin_of(self, away: Float64) -> int:
        """Give the bin of a direction, (2,)."""
        turn = math.atan2(away[1], away[0]) + math.pi
        return min(int(turn / (2 * math.pi) * len(self.free)), len(self.free) - 1)


def seen(
    sights: Float64,
    is_echo: NDArray[np.bool_],
    whose: NDArray[np.int64],
    begin: Float64,
    sector: float,
    guard: float,
    is_closed: bool,
) -> Water:
    """Give the water that a scan shows.

    Parameters
    ----------
    sights : (A, 2) float64
        Where each sector's sight ends [m].
    is_echo, whose : (A,)
        Whether that is at an echo, and whose.
    begin : (2,) float64
        Where they begin [m].
    sector, guard : float
        Greatest width of a bin; how far to either side the water must be as free [rad].
    is_closed : bool
        False if beside the first sector, and the last, nothing is looked at: nothing is known in
        these two.
    """
    count = math.ceil(2 * math.pi / sector)
    water = Water(np.full(count, np.inf), np.zeros(count, bool), np.full(count, NOBODY))
    for i, away in enumerate(sights - begin):
        is_edge = not is_closed and i in (0, len(sights) - 1)
        reach = 0.0 if is_edge else float(np.linalg.norm(away))
        k = water.bin_of(away)
        if reach < water.free[k]:
            water.free[k] = reach
            water.is_echo[k] = is_echo[i] and not is_edge
            water.whose[k] = NOBODY if is_edge else whose[i]
    wide = min(math.ceil(guard * count / (2 * math.pi)), count // 2)
    around = [np.roll(np.arange(count), k) for k in range(-wide, wide + 1)]
    nearest = np.array(around)[np.argmin(water.free[np.array(around)], axis=0), np.arange(count)]
    is_known = np.isfinite(water.free[nearest])
    return Water(
        np.where(is_known, water.free[nearest], 0.0),
        is_known & water.is_echo[nearest],
        np.where(is_known, water.whose[nearest], NOBODY),
    )


def ask(water: Water, begin: Float64, place: Float64, margin: float) -> tuple[int, int]:
    """Tell what is known of a place, (2,), and whose it is, if no beam overlooks anything."""
    away = place - begin
    k = water.bin_of(away)
    distance, free = math.hypot(*away), water.free[k]
    if distance < free - margin:
        return FREE, NOBODY
    if water.is_echo[k] and distance <= free + margin:
        return TAKEN, int(water.whose[k])
    return UNKNOWN, NOBODY


def passes(elevation: float, away: Float64, down: Float64) -> float:
    """Give the slope at which a beam passes over a place so far away, (2,) [rad].

    The beam's directions form a cone around the sensor's z axis, (3,). In the upright plane
    through the place a ray that rises by b lies so high over the sensor's level:
    sin e = -(ahead cos b - down sin b) = length sin(b - level).
    """
    ahead = float(down[:2] @ away) / math.hypot(*away)
    level, length = math.atan2(ahead, down[2]), math.hypot(ahead, down[2])
    return level + math.asin(math.sin(elevation) / length)
