"""The replay buffer: a ring of rows in one tensor, so that a batch is one gather."""

from __future__ import annotations

from typing import NamedTuple

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
    places: Tensor | None = None
    """(B,) Where they lie in the replay, where transitions are drawn by priority."""


def split_rows(rows: Tensor) -> Batch:
    """Read transitions, (B, 78), as a batch."""
    widths = [PACKED_COLUMNS, 2, 1, 1, PACKED_COLUMNS]
    first, action, reward, discount, last = torch.split(rows, widths, dim=1)
    return Batch(unpack(first), action, reward.squeeze(1), discount.squeeze(1), unpack(last))


def to_device(batch: Batch, device: torch.device) -> Batch:
    """Move what an agent learns from; the places belong to the replay and stay."""
    if device.type == "cpu":
        return batch
    return Batch(
        observations=Observations(*(part.to(device) for part in batch.observations)),
        action=batch.action.to(device),
        reward=batch.reward.to(device),
        discount=batch.discount.to(device),
        next_observations=Observations(*(part.to(device) for part in batch.next_observations)),
        weight=None if batch.weight is None else batch.weight.to(device),
        places=batch.places,
    )


class ReplayBuffer:
    """The last `capacity` transitions."""

    def __init__(self, capacity: int) -> None:
        self.rows = torch.zeros(capacity, TRANSITION_COLUMNS)
        self._size = 0
        self._next = 0

    def __len__(self) -> int:
        return self._size

    def clear(self) -> None:
        """Forget every transition: after a change of the rewards."""
        self._size = self._next = 0

    def add(self, rows: Tensor) -> Tensor:
        """Store transitions, (K, 78); the oldest make room. Gives the places they went to, (K,)."""
        capacity = len(self.rows)
        rows = rows[-capacity:]
        places = (torch.arange(len(rows)) + self._next) % capacity
        self.rows[places] = rows
        self._next = (self._next + len(rows)) % capacity
        self._size = min(self._size + len(rows), capacity)
        return places

    def sample(self, count: int, generator: torch.Generator) -> Batch:
        """Draw `count` transitions uniformly, with replacement."""
        places = torch.randint(self._size, (count,), generator=generator)
        return split_rows(self.rows[places])
