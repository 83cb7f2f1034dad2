"""Whether a path leads to contact, how soon and how hard."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from twinscrew.runtime.geometry.frames import rotation_2d
from twinscrew.runtime.messages.types import Float64, Odometry, Tracks


@dataclass(frozen=True, slots=True)
class Circles:
    """What is around the vessel, going straight on, in its present levelled frame B."""

    id: tuple[int, ...]
    p_B: Float64
    """[m] (K, 2)"""
    v_B: Float64
    """[m/s] (K, 2) Over ground."""
    radius: Float64
    """[m] (K,)"""
    horizon_s: Float64
    """[s] (K,) Until when it can be foretold."""


class Contact(NamedTuple):
    """The worst that a path leads to."""

    harm: float
    """[m/s] How much faster than allowed it closes in, less the later; 0 if it leads to none."""
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
    static_mps : float
        Slower tracks stand still [m/s].
    """
    speed = np.hypot(tracks.v_N[:, 0], tracks.v_N[:, 1])
    speed = np.where(speed < static_mps, 0.0, speed)
    offset_N = tracks.p_N - odometry.position_N[:2]
    radius = np.maximum(tracks.radius, least_radius_m)
    gap = np.hypot(offset_N[:, 0], offset_N[:, 1]) - radius - reach_m
    horizon = np.where(speed > 0.0, horizon_s[1], horizon_s[0])
    near = np.flatnonzero(gap < speed * horizon)
    R_NB = rotation_2d(odometry.heading)
    return Circles(
        id=tuple(tracks.id[near].tolist()),
        p_B=offset_N[near] @ R_NB,
        v_B=np.where(speed[near, None] > 0.0, tracks.v_N[near], 0.0) @ R_NB,
        radius=radius[near],
        horizon_s=horizon[near],
    )


def worst_contact(
    path: Float64,
    circles: Circles,
    hull: tuple[tuple[float, float], ...],
    *,
    dt: float,
    margin_m: float,
    approach_per_s: float,
) -> Contact:
    """Judge a path.

    Nearer than the margin, closing in is allowed at `approach_per_s` times the gap that is left, so
    that a vessel may pass along an edge, or lie beside it, but not run into it. What comes later
    counts less, down to nothing at the track's horizon: until then there is time to decide again.

    Parameters
    ----------
    path : (T + 1, 3) float64
        x, y [m], heading [rad] in the present frame B, `dt` [s] apart, the first one now.
    circles
        What is around.
    hull
        [m] Circles that cover the own hull: how far ahead of the origin, radius.
    """
    steps = len(path) - 1
    gap = gaps(path, circles, hull, dt)
    if gap.min() >= margin_m:
        return NO_CONTACT
    closing = (gap[:-1] - gap[1:]) / dt
    allowed = approach_per_s * np.maximum(gap[1:], 0.0)
    weight = 1.0 - dt * np.arange(1, steps + 1)[:, None, None] / (circles.horizon_s + dt)
    harm = np.where(gap[1:] < margin_m, (closing - allowed) * np.maximum(weight, 0.0), 0.0)
    harmful = (harm > 0.0).any(axis=(1, 2))
    if not harmful.any():
        return NO_CONTACT
    first = int(np.argmax(harmful))
    _, k = divmod(int(np.argmax(harm[first])), len(circles.id))
    x, y, heading = path[first + 1]
    there = circles.p_B[k] + (first + 1) * dt * circles.v_B[k] - (x, y)
    return Contact(
        harm=float(harm.max()),
        time_s=(first + 1) * dt,
        speed_mps=float(closing[first, :, k].max()),
        track=circles.id[k],
        to_starboard=bool(np.cos(heading) * there[1] > np.sin(heading) * there[0]),
    )


def gaps(
    path: Float64, circles: Circles, hull: tuple[tuple[float, float], ...], dt: float
) -> Float64:
    """Give the distances between surfaces along a path, (T + 1, H, K) [m]; see `worst_contact`."""
    ahead, own = np.array(hull).T
    # Points of the plane as complex numbers, x + iy: a rotation is one product.
    here = path[:, :2].copy().view(np.complex128)
    if ahead.any():
        here = here + ahead * np.exp(1j * path[:, 2:])
    there = circles.p_B.view(np.complex128).T
    there = there + dt * np.arange(len(path))[:, None] * circles.v_B.view(np.complex128).T
    apart: Float64 = np.abs(there[:, None] - here[:, :, None])
    apart -= own[:, None] + circles.radius
    return apart
