"""Rainbow (Hessel et al. 2018): C51, dueling, noisy, double; multi-step and priorities outside.

The n-step returns come from the loop (`n_steps`), the priorities from the replay (`priority`).
"""

from __future__ import annotations

from typing import Annotated

import torch
from msgspec import Meta
from torch import Tensor, nn

from twinscrew.runtime.settings import Positive
from twinscrew.training.agents.base import AgentSettings
from twinscrew.training.agents.discrete import PAIRS, action_number
from twinscrew.training.agents.lesson import Draws, Lesson, Metrics
from twinscrew.training.agents.steps import wide
from twinscrew.training.agents.values import ValueAgent
from twinscrew.training.encoders import Seen
from twinscrew.training.losses import cross_entropy, project_distribution
from twinscrew.training.networks import Pilot
from twinscrew.training.networks_value import DuelingDistribution, NoisyLinear


class RainbowSettings(AgentSettings, frozen=True, tag_field="algorithm", tag="rainbow"):
    """Rainbow."""

    atoms: Annotated[int, Meta(ge=2, le=1001)] = 51
    """[-] Of the return's distribution (paper: 51)."""
    support_min: float = -40.0
    """[-] Least return; the reference's support [-1, 1] cannot hold returns of +-40,"""
    support_max: float = 60.0
    """[-] and the greatest."""
    sigma0: Positive = 0.05
    """[-] Initial noise of the noisy layers (paper: 0.05)."""


class MeanReturn(nn.Module):
    """Action values: the mean of the return's distribution."""

    support: Tensor

    def __init__(self, distribution: nn.Module, support: Tensor) -> None:
        super().__init__()
        self.distribution = distribution
        self.register_buffer("support", support, persistent=False)

    def forward(self, seen: Seen) -> Tensor:
        """Give values (B, A)."""
        logs: Tensor = self.distribution(seen)
        return (logs.exp() * self.support).sum(2)


class Rainbow(ValueAgent[RainbowSettings], online="online"):
    """The learner."""

    def __init__(self, settings: RainbowSettings, seed: int, device: str = "cpu") -> None:
        super().__init__(settings, seed, device)
        s = settings
        self.support = torch.linspace(s.support_min, s.support_max, s.atoms, device=self.device)
        self.furnish(DuelingDistribution(s.network, PAIRS, s.atoms, s.sigma0))

    def values(self, network: nn.Module) -> nn.Module:
        """Give the mean of the network's distribution."""
        return MeanReturn(network, self.support)

    def chance(self, batch: int) -> Draws:  # noqa: ARG002
        """Draw the noise of the network's and the target's layers, which keep it."""
        for network in (self.network, self.target):
            for layer in noisy(network):
                layer.draw(self.generator)
        return {}

    def acting_chance(self, count: int) -> Draws:  # noqa: ARG002
        """Draw the noise of the network's layers: it explores."""
        for layer in noisy(self.network):
            layer.draw(self.generator)
        return {}

    def loss(self, lesson: Lesson) -> tuple[Tensor, Metrics]:
        """Give the weighted mean of the samples' losses, which are their new priorities."""
        losses = self.losses(lesson)
        loss = (lesson.weight * losses).mean()
        return loss, {"critic_loss": loss, "priority": losses}

    def losses(self, lesson: Lesson) -> Tensor:
        """Give each sample's cross entropy, (B,), against the projected next distribution."""
        rows = torch.arange(len(lesson.action), device=self.device)
        with torch.no_grad(), wide(self.settings.bfloat16, self.device.type):
            choice = self.network(lesson.following).float()
            after = self.target(lesson.following).float()
        best = (choice.exp() * self.support).sum(2).argmax(1)
        target = project_distribution(
            after[rows, best].exp(), lesson.reward, lesson.discount, self.support
        )
        with wide(self.settings.bfloat16, self.device.type):
            logs = self.network(lesson.seen)
        return cross_entropy(logs.float()[rows, action_number(lesson.action)], target)

    def deployed(self, radius_margin: float) -> Pilot:
        """Give the greedy policy of the averaged network, without its noise."""
        for layer in noisy(self.average):
            layer.quiet()
        return super().deployed(radius_margin)


def noisy(network: nn.Module) -> list[NoisyLinear]:
    """Give the layers with noise."""
    return [layer for layer in network.modules() if isinstance(layer, NoisyLinear)]
