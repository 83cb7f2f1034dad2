"""DQN (Mnih et al. 2015), by choice with double estimation (van Hasselt et al. 2016)."""

from __future__ import annotations

import torch
from torch import Tensor, nn

from twinscrew.training.agents.base import AgentSettings
from twinscrew.training.agents.discrete import PAIRS, action_number, taken
from twinscrew.training.agents.lesson import Lesson, Metrics
from twinscrew.training.agents.steps import wide
from twinscrew.training.agents.values import ValueAgent
from twinscrew.training.losses import huber, td_target
from twinscrew.training.networks_value import QNetwork


class DqnSettings(AgentSettings, frozen=True, tag_field="algorithm", tag="dqn"):
    """DQN."""

    double: bool = True
    """Let the online network choose the next action and the target network value it."""


class Dqn(ValueAgent[DqnSettings], online="values"):
    """The learner."""

    def __init__(self, settings: DqnSettings, seed: int, device: str = "cpu") -> None:
        super().__init__(settings, seed, device)
        self.furnish(QNetwork(settings.network, PAIRS))

    def values(self, network: nn.Module) -> nn.Module:
        """Give the network: its outputs are the values."""
        return network

    def loss(self, lesson: Lesson) -> tuple[Tensor, Metrics]:
        """Give the mean Huber loss of Q(s, a) against r + gamma Q'(s', argmax Q)."""
        with torch.no_grad(), wide(self.settings.bfloat16, self.device.type):
            after = self.target(lesson.following)
            choice = self.network(lesson.following) if self.settings.double else after
        best = taken(after, choice.argmax(1)).float()
        target = td_target(lesson.reward, lesson.discount, best[:, None]).squeeze(1)
        with wide(self.settings.bfloat16, self.device.type):
            values = self.network(lesson.seen)
        loss = huber(target - taken(values, action_number(lesson.action)).float(), 1.0).mean()
        return loss, {"critic_loss": loss}
