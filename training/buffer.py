"""The replay buffer: a ring of rows in one tensor, so that a batch is one gather."""

from __future__ import annotations

from typing import Any, NamedTuple

import torch
from torch import Tensor

from twinscrew.training.observations import PACKED_COLUMNS, Observations, unpack

TRANSITION_COLUMNS = 2 * PACKED_COLUMNS + 4
"""[-] Observation, action (2), reward, discount, next observation."""


class Batch(NamedTuple):
    """B transitions."""

    observations: Observations
    action: Tensor
    """(B, 2) in [-1, 1]."""
    reward: Tensor
    """(B,) Discounted sum over the n steps."""
    discount: Tensor
    """(B,) gamma^n; 0 where the episode ended, so that nothing is bootstrapped."""
    next_observations: Observations
    weight: Tensor | None = None
    """(B,) Of each sample's loss, where transitions are drawn by priority."""


def split_rows(rows: Tensor) -> Batch:
    """Read transitions, (..., B, 78), as a batch."""
    widths = [PACKED_COLUMNS, 2, 1, 1, PACKED_COLUMNS]
    first, action, reward, discount, last = torch.split(rows, widths, dim=-1)
    return Batch(unpack(first), action, reward.squeeze(-1), discount.squeeze(-1), unpack(last))


class Drawn(NamedTuple):
    """Transitions drawn from a replay."""

    rows: Tensor
    """(B, 78)"""
    weight: Tensor | None = None
    """(B,) Of each sample's loss, where they are drawn by priority."""
    places: Tensor | None = None
    """(B,) Where they lie in the replay, where they are drawn by priority."""

    def batch(self, device: torch.device) -> Batch:
        """Give them on a device, moved there at once."""
        weight = None if self.weight is None else self.weight.to(device)
        return split_rows(self.rows.to(device))._replace(weight=weight)


class ReplayBuffer:
    """The last `capacity` transitions."""

    def __init__(self, capacity: int) -> None:
        self.rows = torch.zeros(capacity, TRANSITION_COLUMNS)
        self.added = 0
        """[-] Transitions since the last `clear`: number n lies in place n modulo the capacity."""
        self.cleared = 0
        """[-] How often the buffer was emptied."""

    def __len__(self) -> int:
        return min(self.added, len(self.rows))

    def clear(self) -> None:
        """Forget every transition: after a change of the rewards."""
        self.added = 0
        self.cleared += 1

    def add(self, rows: Tensor) -> Tensor:
        """Store transitions, (K, 78); the oldest make room. Gives the places they went to, (K,)."""
        capacity = len(self.rows)
        rows = rows[-capacity:]
        places = (torch.arange(len(rows)) + self.added) % capacity
        self.rows[places] = rows
        self.added += len(rows)
        return places

    def sample(self, count: int, generator: torch.Generator) -> Drawn:
        """Draw `count` transitions uniformly, with replacement."""
        places = torch.randint(len(self), (count,), generator=generator)
        return Drawn(self.rows[places])

    def state(self) -> dict[str, Any]:
        """Give what there is to remember beside the transitions."""
        return {"added": self.added, "cleared": self.cleared}

    def restore(self, state: dict[str, Any]) -> None:
        """Take a `state` back; the transitions are put back by whoever kept them."""
        self.added, self.cleared = state["added"], state["cleared"]
