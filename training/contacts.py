"""Who touched whom during a decision, checked at every sub-step.

First a bound: two circles whose distance at the start exceeds their radii and the farthest that
either strayed from there cannot have touched. The few pairs that are left are checked in full.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from twinscrew.runtime.messages.types import Float64

Mask = NDArray[np.bool_]


def strayed(trajectory: Float64) -> Float64:
    """Give the farthest, (N,) [m], that each vessel was from where it began; (S + 1, 2, N) in."""
    offset = trajectory[1:] - trajectory[0]
    offset *= offset
    farthest: Float64 = np.sqrt((offset[:, 0] + offset[:, 1]).max(axis=0))
    return farthest


def between_vessels(trajectory: Float64, strayed: Float64, there: Mask, radius: float) -> Mask:
    """Tell which vessels touched another one.

    Parameters
    ----------
    trajectory : (S + 1, 2, E, V) float64
        North, east [m] of V vessels in E episodes, before and after each of S sub-steps.
    strayed : (E, V) float64
        [m] Farthest from the first position.
    there : (E, V) bool
        Which of them are on the water.
    radius : float
        [m] Of each.

    Returns
    -------
    touched : (E, V) bool
    """
    touched = np.zeros(there.shape, bool)
    one, other = _pairs(there.shape[1])
    known = np.concatenate([trajectory[0], strayed[None]])
    first, second = known.take(one, axis=2), known.take(other, axis=2)
    north, east, _ = first - second
    reach = 2 * radius + first[2] + second[2]
    near = north * north + east * east < reach * reach
    near &= there[:, one] & there[:, other]
    episode, pair = np.nonzero(near)
    if episode.size:
        i, j = one[pair], other[pair]
        offset = trajectory[1:, :, episode, i] - trajectory[1:, :, episode, j]
        hit = _closest(offset) < 2 * radius
        touched[episode[hit], i[hit]] = True
        touched[episode[hit], j[hit]] = True
    return touched


def with_buoys(
    trajectory: Float64,
    strayed: Float64,
    there: Mask,
    radius: float,
    buoy: NDArray[np.complex128],
    buoy_there: Mask,
    buoy_radius: float,
) -> Mask:
    """Tell which vessels touched a buoy; buoys (E, M), the rest as in `between_vessels`."""
    touched = np.zeros(there.shape, bool)
    if not buoy.shape[1]:
        return touched
    x, y = trajectory[0][..., None]
    north, east = x - buoy.real[:, None], y - buoy.imag[:, None]
    reach = (radius + buoy_radius + strayed)[..., None]
    near = north * north + east * east < reach * reach
    near &= there[..., None] & buoy_there[:, None]
    episode, vessel, which = np.nonzero(near)
    if episode.size:
        centre = buoy[episode, which]
        offset = trajectory[1:, :, episode, vessel] - np.stack([centre.real, centre.imag])
        hit = _closest(offset) < radius + buoy_radius
        touched[episode[hit], vessel[hit]] = True
    return touched


def _closest(offset: Float64) -> Float64:
    """Give the smallest distance, (n,) [m], over the sub-steps of offsets (S, 2, n)."""
    closest: Float64 = np.hypot(offset[:, 0], offset[:, 1]).min(axis=0)
    return closest


@lru_cache(maxsize=8)
def _pairs(vessels: int) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    return np.triu_indices(vessels, k=1)
