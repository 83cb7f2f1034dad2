"""What the networks read: a batch of observations, raw SI units, frame B."""

from __future__ import annotations

from typing import NamedTuple

import torch
from torch import Tensor

from twinscrew.runtime.messages.types import OBSERVED_OBJECTS

EGO_COLUMNS = 7
OBJECT_COLUMNS = 5
PACKED_COLUMNS = EGO_COLUMNS + OBSERVED_OBJECTS * (OBJECT_COLUMNS + 1)
"""[-] Numbers in one observation: ego, objects row by row, mask."""


class Observations(NamedTuple):
    """A batch of B observations; the columns are those of `messages.types.Observation`."""

    ego: Tensor
    """(B, 7) float32: goal x, y [m]; surge, sway [m/s]; yaw rate [rad/s]; thrusts [N]. Eq. (2)."""
    objects: Tensor
    """(B, 5, 5) float32: x, y [m]; vx, vy over ground [m/s]; radius [m]. Eq. (3)."""
    mask: Tensor
    """(B, 5) float32: 1 where there is an object, 0 where there is padding."""


def pack(observations: Observations) -> Tensor:
    """Lay a batch out as rows, (B, 37), so that a replay buffer gathers it in one go."""
    ego, objects, mask = observations
    return torch.cat([ego, objects.flatten(1), mask], dim=1)


def unpack(rows: Tensor) -> Observations:
    """Undo `pack`: (..., B, 37) to observations."""
    width = OBSERVED_OBJECTS * OBJECT_COLUMNS
    ego, objects, mask = torch.split(rows, [EGO_COLUMNS, width, OBSERVED_OBJECTS], dim=-1)
    return Observations(ego, objects.reshape(*mask.shape, OBJECT_COLUMNS), mask)
