"""What vessels do in an encounter, as geometry: on which side, ahead or astern, on which course."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from twinscrew.runtime.messages.types import Float64
from twinscrew.runtime.policy.colregs import Situation, compliant_course

SLOWEST_MPS = 0.5
"""[m/s] Slower, a velocity says little of a course (paper, sec. IV)."""


def runs(kinds: NDArray[np.int8], least: int) -> list[tuple[int, int]]:
    """Give the stretches [begin, end) in which `kinds` stays at one value that is not zero."""
    edges = np.flatnonzero(np.diff(kinds)) + 1
    begins, ends = np.r_[0, edges], np.r_[edges, len(kinds)]
    return [
        (int(b), int(e))
        for b, e in zip(begins, ends, strict=True)
        if kinds[b] != Situation.NONE and e - b >= least
    ]


def passed_to_port(p: Float64, heading: float) -> bool:
    """Tell whether a place, (2,) from the vessel in N, is on the vessel's port side."""
    across = np.cos(heading) * p[1] - np.sin(heading) * p[0]
    return bool(across < 0.0)


def crossed_ahead(p_ego_N: Float64, p_other_N: Float64, v_other_N: Float64) -> bool:
    """Tell whether the ego vessel crossed the other's track from its port side, ahead of it.

    All arguments are (n, 2). Where the other nearly stands still, its last course counts.
    """
    along = _courses(v_other_N)
    p = p_ego_N - p_other_N
    ahead = (p * along).sum(axis=1)
    across = along[:, 0] * p[:, 1] - along[:, 1] * p[:, 0]
    crossing = (across[:-1] < 0.0) & (across[1:] >= 0.0)
    return bool((crossing & (ahead[1:] > 0.0)).any())


def rule_tracks(
    p_N: Float64,
    v_N: Float64,
    acts: tuple[bool, bool],
    radius: float,
    turn_rate_radps: float,
    times: Float64,
) -> Float64:
    """Give where two vessels would be that go by the rules, each at its speed.

    Parameters
    ----------
    p_N, v_N : (2, 2) float64
        Positions [m] and velocities [m/s] at the beginning, a row a vessel.
    acts : (bool, bool)
        Who turns to starboard whenever its course falls short of `colregs.compliant_course`; the
        other stands on, with its course and speed.
    radius : float
        [m] Of either vessel.
    turn_rate_radps : float
        [rad/s] How fast a vessel turns.
    times : (n,) float64
        [s] Rising.

    Returns
    -------
    tracks : (n, 2, 2) float64
        [m] N.
    """
    speed, course = np.hypot(*v_N.T), np.arctan2(v_N[:, 1], v_N[:, 0])
    tracks = np.empty((len(times), 2, 2))
    tracks[0] = p_N
    for k, dt in enumerate(np.diff(times)):
        asked = compliant_course(tracks[k, ::-1] - tracks[k], np.full(2, radius), radius)
        short = np.remainder(asked - course + np.pi, 2 * np.pi) - np.pi
        course = course + np.where(acts, np.clip(short, 0.0, turn_rate_radps * dt), 0.0)
        step = speed[:, None] * np.column_stack([np.cos(course), np.sin(course)])
        tracks[k + 1] = tracks[k] + dt * step
    return tracks


def _courses(v_N: Float64, slowest: float = SLOWEST_MPS) -> Float64:
    """Give unit vectors along velocities, (n, 2); a slow one takes over the one before it."""
    speed = np.hypot(*v_N.T)
    fast = speed >= slowest
    fast[0] = True
    last = np.maximum.accumulate(np.where(fast, np.arange(len(v_N)), 0))
    unit: Float64 = v_N[last] / np.maximum(speed[last], 1e-9)[:, None]
    return unit
