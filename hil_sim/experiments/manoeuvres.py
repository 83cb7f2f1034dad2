"""What vessels do in an encounter, as geometry: on which side, ahead or astern, on which course."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from twinscrew.runtime.messages.types import Float64
from twinscrew.runtime.policy.colregs import Situation

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


def compliant_track(
    p_N: Float64, v_N: Float64, course: float, turn_rate_radps: float, elapsed: Float64
) -> Float64:
    """Give where a vessel would be that turns to starboard on to a course, at its speed.

    Parameters
    ----------
    p_N, v_N : (2,) float64
        Position [m] and velocity [m/s] at the beginning.
    course : float
        [rad] The course to turn to; if it lies to port the vessel keeps its own.
    turn_rate_radps : float
        [rad/s]
    elapsed : (n,) float64
        [s] Times since the beginning, rising from 0.

    Returns
    -------
    track : (n, 2) float64
        [m] N. Velocities are held over each interval at their middle.
    """
    first = float(np.arctan2(v_N[1], v_N[0]))
    turn = max(float(np.remainder(course - first + np.pi, 2 * np.pi) - np.pi), 0.0)
    middle = 0.5 * (elapsed[1:] + elapsed[:-1])
    angle = first + np.minimum(turn_rate_radps * middle, turn)
    step = np.hypot(*v_N) * np.diff(elapsed)[:, None]
    steps = step * np.column_stack([np.cos(angle), np.sin(angle)])
    track: Float64 = p_N + np.vstack([np.zeros(2), np.cumsum(steps, axis=0)])
    return track


def _courses(v_N: Float64, slowest: float = SLOWEST_MPS) -> Float64:
    """Give unit vectors along velocities, (n, 2); a slow one takes over the one before it."""
    speed = np.hypot(*v_N.T)
    fast = speed >= slowest
    fast[0] = True
    last = np.maximum.accumulate(np.where(fast, np.arange(len(v_N)), 0))
    unit: Float64 = v_N[last] / np.maximum(speed[last], 1e-9)[:, None]
    return unit
