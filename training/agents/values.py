"""What IQN, DQN and Rainbow share: 25 discrete actions and one network that values them.

The actions are 5 x 5 pairs of thrust rates (paper, sec. V).
"""

from __future__ import annotations

import copy
from abc import abstractmethod
from typing import Any, ClassVar

import torch
from torch import Tensor, nn

from twinscrew.training.agents.base import Agent, Descent, Draws, Lesson, Metrics, S, adam
from twinscrew.training.networks import Pilot, Seen

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


class ValueAgent(Agent[S]):
    """A learner of the values of the discrete actions: its network, a target and an average."""

    continuous = False
    online: ClassVar[str]
    """What checkpoints call the network that learns."""

    def __init_subclass__(cls, *, online: str) -> None:
        """Name the network that learns: target and average follow it."""
        cls.online = online
        cls.targets = (("target", online),)
        cls.averages = (("average", online),)

    def furnish(self, network: nn.Module) -> None:
        """Take the network, and make its target, its average and its optimiser."""
        self.network = network.to(self.device)
        self.target, self.average = copy.deepcopy(self.network), copy.deepcopy(self.network)
        self.keep(**{self.online: self.network}, target=self.target, average=self.average)
        self.keep(optimizer=adam(self.network, self.settings.learning_rate))

    @abstractmethod
    def values(self, network: nn.Module) -> nn.Module:
        """Give what computes the values, (B, A), of all actions by a network."""

    @abstractmethod
    def loss(self, lesson: Lesson) -> tuple[Tensor, Metrics]:
        """Give what the network goes down."""

    def choose(self, seen: Seen, draws: Draws, *, explore: bool) -> Tensor:  # noqa: ARG002
        """Give greedy pairs, (B, 2); exploration is added outside."""
        with torch.no_grad(), self.mixed():
            network = self.network if explore else self.average
            action: Tensor = Greedy(self.values(network))(seen)
        return action

    def random(self, count: int) -> Tensor:
        """Draw pairs, (count, 2), uniformly."""
        return action_table()[torch.randint(PAIRS, (count,), generator=self.generator)]

    def rates(self) -> dict[str, float]:
        """Give the network's learning rate."""
        return {"optimizer": self.settings.learning_rate}

    def descents(self) -> tuple[Descent, ...]:
        """Give the one step of an update."""
        return (Descent(self.loss, ((self.online, "optimizer"),)),)

    def deployed(self, radius_margin: float) -> Pilot:
        """Give the greedy policy of the averaged network."""
        return Pilot(self.see, Greedy(self.values(self.average)), radius_margin)
