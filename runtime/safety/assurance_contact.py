"""What could be met, and what a contact is."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from twinscrew.runtime.geometry import rotation_2d
from twinscrew.runtime.messages.types import Float64, Odometry, Tracks


@dataclass(frozen=True, slots=True)
class Circles:
    """What is around the vessel, going straight on, in its present levelled frame L."""

    id: tuple[int, ...]
    p_L: Float64
    """[m] (K, 2)"""
    v_L: Float64
    """[m/s] (K, 2) Over ground."""
    radius: Float64
    """[m] (K,)"""
    horizon_s: Float64
    """[s] (K,) Until when it can be foretold."""


class Contact(NamedTuple):
    """The worst that a path leads to."""

    harm: float
    """[m/s] How much faster than allowed it closes in, at most and, times 1 /s, in all; less the
    later; 0 if it leads to none."""
    time_s: float = float("inf")
    """[s] From now until the vessel first closes in too fast."""
    speed_mps: float = 0.0
    """[m/s] How fast it then closes in."""
    track: int = -1
    """The track's id."""
    to_starboard: bool = False
    """True if the track is then on the starboard side."""


NO_CONTACT = Contact(0.0)


def surroundings(
    odometry: Odometry,
    tracks: Tracks,
    *,
    reach_m: float,
    horizon_s: tuple[float, float],
    least_radius_m: float,
    clearance_m: float,
    static_mps: float,
) -> Circles:
    """Give what could be met within the horizon.

    Parameters
    ----------
    reach_m : float
        How far the edge of the vessel, with its margin, can get within the horizon [m].
    horizon_s : (float, float)
        Until when what stands still, and what moves, can be foretold [s].
    least_radius_m : float
        No object is taken to be smaller [m].
    clearance_m : float
        Every object is taken to be this much larger [m].
    static_mps : float
        Slower tracks stand still [m/s].
    """
    speed = np.hypot(tracks.v_N[:, 0], tracks.v_N[:, 1])
    speed = np.where(speed < static_mps, 0.0, speed)
    offset_N = tracks.p_N - odometry.position_N[:2]
    radius = np.maximum(tracks.radius, least_radius_m) + clearance_m
    gap = np.hypot(offset_N[:, 0], offset_N[:, 1]) - radius - reach_m
    horizon = np.where(speed > 0.0, horizon_s[1], horizon_s[0])
    near = np.flatnonzero(gap < speed * horizon)
    R_NL = rotation_2d(odometry.heading)
    return Circles(
        id=tuple(tracks.id[near].tolist()),
        p_L=offset_N[near] @ R_NL,
        v_L=np.where(speed[near, None] > 0.0, tracks.v_N[near], 0.0) @ R_NL,
        radius=radius[near],
        horizon_s=horizon[near],
    )
