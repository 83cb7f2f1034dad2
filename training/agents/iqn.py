"""IQN: implicit quantile networks (Dabney et al. 2018; paper, sec. V-C).

Acting takes fixed fractions, the midpoints of K equal parts: with random ones the policy disagrees
with itself from one call to the next.
"""

from __future__ import annotations

import torch
from torch import Tensor, nn

from twinscrew.runtime.settings import Count, Positive
from twinscrew.training.agents.base import AgentSettings
from twinscrew.training.agents.discrete import PAIRS, action_number, taken
from twinscrew.training.agents.lesson import Draws, Lesson, Metrics
from twinscrew.training.agents.steps import wide
from twinscrew.training.agents.values import ValueAgent
from twinscrew.training.encoders import Seen
from twinscrew.training.losses import draw_fractions, quantile_huber, td_target
from twinscrew.training.networks_value import QuantileQNetwork


class IqnSettings(AgentSettings, frozen=True, tag_field="algorithm", tag="iqn"):
    """IQN."""

    fractions: Count = 8
    """[-] N = N': quantile fractions in a loss (paper: 8)."""
    acting_fractions: Count = 32
    """[-] K: fractions over which an action's value is averaged (paper: 32)."""
    stratified: bool = True
    """Share one fraction from each eighth of [0, 1] in the batch; else draw each one by itself."""
    kappa: Positive = 1.0
    """[-] Where the Huber loss turns linear (paper: 1)."""


class MeanOverFractions(nn.Module):
    """Action values: the mean quantile at fixed, evenly spread fractions."""

    fractions: Tensor

    def __init__(self, quantiles: nn.Module, count: int) -> None:
        super().__init__()
        self.quantiles = quantiles
        device = next(quantiles.parameters()).device
        fractions = (torch.arange(count, device=device) + 0.5) / count
        self.register_buffer("fractions", fractions, persistent=False)

    def forward(self, seen: Seen) -> Tensor:
        """Give values (B, A)."""
        values: Tensor = self.quantiles(seen, self.fractions)
        return values.mean(1)


class Iqn(ValueAgent[IqnSettings], online="quantiles"):
    """The learner."""

    def __init__(self, settings: IqnSettings, seed: int, device: str = "cpu") -> None:
        super().__init__(settings, seed, device)
        self.furnish(QuantileQNetwork(settings.network, PAIRS))

    def values(self, network: nn.Module) -> nn.Module:
        """Give the mean over fixed fractions."""
        return MeanOverFractions(network, self.settings.acting_fractions)

    def chance(self, batch: int) -> Draws:
        """Draw the fractions of the target and of the network."""
        s = self.settings
        return {
            name: draw_fractions(batch, s.fractions, self.generator, stratified=s.stratified)
            for name in ("target", "online")
        }

    def loss(self, lesson: Lesson) -> tuple[Tensor, Metrics]:
        """Give the mean quantile Huber loss (paper, eqs. 8 to 10)."""
        s, fractions = self.settings, lesson.draws["online"]
        with torch.no_grad(), wide(s.bfloat16, self.device.type):
            after = self.target(lesson.following, lesson.draws["target"])
        best = after.float().mean(1).argmax(1)
        target = td_target(lesson.reward, lesson.discount, taken(after, best).float())
        with wide(s.bfloat16, self.device.type):
            quantiles = self.network(lesson.seen, fractions)
        chosen = taken(quantiles, action_number(lesson.action)).float()
        loss = quantile_huber(chosen, target, fractions, s.kappa).mean()
        return loss, {"critic_loss": loss}
