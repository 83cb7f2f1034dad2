"""IQN: implicit quantile networks (Dabney et al. 2018; paper, sec. V-C).

The loss is AC-IQN's, with a' = argmax_a mean_j Z'(s', a; tau'_j) over 25 pairs. Acting takes fixed
fractions, the midpoints of K equal parts: with random ones the policy disagrees with itself.
"""

from __future__ import annotations

import torch
from torch import Tensor, nn

from twinscrew.runtime.settings import Count, Positive
from twinscrew.training.agents.ac_iqn import (
    CosineEmbedding,
    draw_fractions,
    quantile_huber,
    spread,
)
from twinscrew.training.agents.base import AgentSettings, Draws, Lesson, Metrics, td_target
from twinscrew.training.agents.values import PAIRS, ValueAgent, action_number, taken
from twinscrew.training.networks import NetworkSettings, Seen, make_encoder


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


class QuantileQNetwork(nn.Module):
    """Quantiles of the returns of discrete actions: the critic without its action branch."""

    def __init__(self, settings: NetworkSettings, actions: int) -> None:
        super().__init__()
        self.encoder = make_encoder(settings)
        hidden = settings.hidden_width
        self.embedding = CosineEmbedding(settings.cosines, self.encoder.width)
        self.hidden1 = nn.Linear(self.encoder.width, hidden)
        self.hidden2 = nn.Linear(hidden, hidden)
        self.output = nn.Linear(hidden, actions)

    def forward(self, seen: Seen, fractions: Tensor) -> Tensor:
        """Give quantiles (B, N, A) at `fractions`, (N,) or (B, N)."""
        state = self.encoder(seen)[:, None, :]
        hidden = torch.relu(self.hidden1(state * self.embedding(fractions)))
        quantiles: Tensor = self.output(torch.relu(self.hidden2(hidden)))
        return quantiles


class MeanOverFractions(nn.Module):
    """Action values: the mean quantile at fixed, evenly spread fractions (paper, eq. 8)."""

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
        """Give the mean quantile Huber loss (paper, eqs. 9 to 11)."""
        s, fractions = self.settings, lesson.draws["online"]
        with torch.no_grad(), self.mixed():
            after = self.target(lesson.following, lesson.draws["target"])
        best = after.float().mean(1).argmax(1)
        target = td_target(lesson.reward, lesson.discount, taken(after, best).float())
        with self.mixed():
            quantiles = self.network(lesson.seen, fractions)
        chosen = taken(quantiles, action_number(lesson.action)).float()
        loss = quantile_huber(chosen, target, fractions, s.kappa).mean()
        return loss, {"critic_loss": loss, "quantile_spread": spread(chosen)}
