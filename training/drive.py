"""A driver that only steers at its goal: makes episodes of a true length for the benchmark."""

from __future__ import annotations

import numpy as np

from twinscrew.runtime.messages.types import Float32, Float64

CRUISE_N = 600.0
"""[N] Thrust of each propeller on a straight course."""
TURN_N = 400.0
"""[N] Greatest difference from it."""
STEP_N = 500.0
"""[N] Change of thrust in one decision period that an action of 1 asks for."""


def steer_at_goal(ego: Float32) -> Float64:
    """Give actions, (..., 2) in [-1, 1], for ego states, (..., 7): turn at the goal, sail on."""
    bearing = np.arctan2(ego[..., 1], ego[..., 0])
    turn = TURN_N * np.clip(2.0 * bearing - 2.0 * ego[..., 4], -1.0, 1.0)
    wanted = np.stack([CRUISE_N + turn, CRUISE_N - turn], axis=-1)
    action: Float64 = np.clip((wanted - ego[..., 5:7]) / STEP_N, -1.0, 1.0)
    return action
