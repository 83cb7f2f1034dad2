"""DQN (Mnih et al. 2015; paper, eq. 5), by choice with double estimation (van Hasselt 2016)."""

from __future__ import annotations

import torch
from torch import Tensor, nn

from twinscrew.training.agents.base import AgentSettings, Lesson, Metrics, huber, td_target
from twinscrew.training.agents.values import PAIRS, ValueAgent, action_number, taken
from twinscrew.training.networks import NetworkSettings, Seen, Trunk


class DqnSettings(AgentSettings, frozen=True, tag_field="algorithm", tag="dqn"):
    """DQN."""

    double: bool = True
    """Let the online network choose the next action and the target network value it."""


class QNetwork(nn.Module):
    """The values of discrete actions."""

    def __init__(self, settings: NetworkSettings, actions: int) -> None:
        super().__init__()
        self.trunk = Trunk(settings)
        self.output = nn.Linear(self.trunk.width, actions)

    def forward(self, seen: Seen) -> Tensor:
        """Give values (B, A)."""
        values: Tensor = self.output(self.trunk(seen))
        return values


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
        with torch.no_grad(), self.mixed():
            after = self.target(lesson.following)
            choice = self.network(lesson.following) if self.settings.double else after
        best = taken(after, choice.argmax(1)).float()
        target = td_target(lesson.reward, lesson.discount, best[:, None]).squeeze(1)
        with self.mixed():
            values = self.network(lesson.seen)
        loss = huber(target - taken(values, action_number(lesson.action)).float(), 1.0).mean()
        return loss, {"critic_loss": loss}
