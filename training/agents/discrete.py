"""The discrete actions of IQN, DQN and Rainbow: 5 x 5 pairs of thrust rates (paper, sec. V)."""

from __future__ import annotations

from typing import Any

import torch
from torch import Tensor, nn

from twinscrew.training.encoders import Seen

LEVELS = (-1.0, -0.5, 0.0, 0.5, 1.0)
"""[-] Of each thruster, in units of 1000 N/s."""
PAIRS = len(LEVELS) ** 2
"""[-] Actions; number 5 i + j is level i to the left and j to the right."""


def action_table() -> Tensor:
    """Give the pairs, (25, 2) in [-1, 1], by their numbers."""
    return torch.cartesian_prod(torch.tensor(LEVELS), torch.tensor(LEVELS))


def action_number(action: Tensor) -> Tensor:
    """Give the numbers, (B,), of pairs (B, 2) in [-1, 1]; what lies between levels is rounded."""
    level = ((action.clamp(-1.0, 1.0) + 1.0) * 2.0).round().long()
    return level[:, 0] * len(LEVELS) + level[:, 1]


def taken(values: Tensor, number: Tensor) -> Tensor:
    """Give the values, (B, ...), of the actions taken, (B,), from those of all, (B, ..., A)."""
    index = number.view(-1, *[1] * (values.dim() - 1)).expand(*values.shape[:-1], 1)
    return values.gather(-1, index).squeeze(-1)


def random_pairs(count: int, generator: torch.Generator) -> Tensor:
    """Draw pairs, (count, 2), uniformly."""
    return action_table()[torch.randint(PAIRS, (count,), generator=generator)]


class Greedy(nn.Module):
    """The best pair by a network of action values: what a discrete agent deploys."""

    table: Tensor

    def __init__(self, values: nn.Module) -> None:
        super().__init__()
        self.values = values
        device = next((p.device for p in values.parameters()), None)
        self.register_buffer("table", action_table().to(device), persistent=False)

    def forward(self, seen: Seen) -> Tensor:
        """Give actions (B, 2)."""
        best: Any = self.values(seen).argmax(dim=1)
        action: Tensor = self.table[best]
        return action
