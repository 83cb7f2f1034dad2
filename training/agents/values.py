"""What IQN, DQN and Rainbow share: one network of action values, its target and its average."""

from __future__ import annotations

import copy
from abc import abstractmethod
from typing import ClassVar

import torch
from torch import Tensor, nn

from twinscrew.training.agents.base import Agent, S
from twinscrew.training.agents.discrete import Greedy, random_pairs
from twinscrew.training.agents.lesson import Descent, Draws, Lesson, Metrics
from twinscrew.training.agents.steps import adam, wide
from twinscrew.training.encoders import Seen
from twinscrew.training.networks import Pilot


class ValueAgent(Agent[S]):
    """A learner of the values of the discrete actions."""

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
        """Give what tells the values, (B, A), of all actions by a network."""

    @abstractmethod
    def loss(self, lesson: Lesson) -> tuple[Tensor, Metrics]:
        """Give what the network goes down."""

    def choose(self, seen: Seen, draws: Draws, *, explore: bool) -> Tensor:  # noqa: ARG002
        """Give greedy pairs, (B, 2); exploration is added outside."""
        network = self.network if explore else self.average
        with torch.no_grad(), wide(self.settings.bfloat16, self.device.type):
            action: Tensor = Greedy(self.values(network))(seen)
        return action

    def random(self, count: int) -> Tensor:
        """Give random pairs, (count, 2)."""
        return random_pairs(count, self.generator)

    def rates(self) -> dict[str, float]:
        """Give the network's learning rate."""
        return {"optimizer": self.settings.learning_rate}

    def descents(self) -> tuple[Descent, ...]:
        """Give the one step of an update."""
        return (Descent(self.loss, ((self.online, "optimizer"),)),)

    def deployed(self, radius_margin: float) -> Pilot:
        """Give the greedy policy of the averaged network."""
        return Pilot(self.see, Greedy(self.values(self.average)), radius_margin)
