"""Rainbow (Hessel et al. 2018): C51, dueling, noisy, double; multi-step and priorities outside.

The n-step returns come from the loop (`n_steps`), the priorities from the replay (`priority`).
"""

from __future__ import annotations

import copy
from typing import Annotated

import torch
from msgspec import Meta
from torch import Tensor, nn

from twinscrew.runtime.settings import Positive
from twinscrew.training.agents.base import (
    Agent,
    AgentSettings,
    Metrics,
    adam,
    anneal,
    blend,
    descend,
)
from twinscrew.training.agents.discrete import PAIRS, Greedy, action_number, random_pairs
from twinscrew.training.buffer import Batch
from twinscrew.training.encoders import Seen
from twinscrew.training.losses import cross_entropy, project_distribution
from twinscrew.training.networks import Pilot
from twinscrew.training.networks_value import DuelingDistribution


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

    def __init__(self, distribution: DuelingDistribution, support: Tensor) -> None:
        super().__init__()
        self.distribution = distribution
        self.register_buffer("support", support, persistent=False)

    def forward(self, seen: Seen) -> Tensor:
        """Give values (B, A)."""
        logs: Tensor = self.distribution(seen)
        return (logs.exp() * self.support).sum(2)


class Rainbow(Agent[RainbowSettings]):
    """The learner."""

    continuous = False

    def __init__(self, settings: RainbowSettings, seed: int, device: str = "cpu") -> None:
        super().__init__(settings, seed, device)
        s = settings
        self.support = torch.linspace(s.support_min, s.support_max, s.atoms, device=self.device)
        self.online = DuelingDistribution(s.network, PAIRS, s.atoms, s.sigma0).to(self.device)
        self.target = copy.deepcopy(self.online)
        self.average = copy.deepcopy(self.online)
        self.optimizer = adam(self.online, s.learning_rate)
        self.keep(
            online=self.online, target=self.target, average=self.average, optimizer=self.optimizer
        )

    def choose(self, seen: Seen, *, explore: bool) -> Tensor:
        """Give greedy pairs, (B, 2), under fresh noise of the layers when exploring."""
        network = self.online if explore else self.average
        self._noise(network, draw=explore)
        action: Tensor = self._greedy(network)(seen)
        return action

    def random(self, count: int) -> Tensor:
        """Give random pairs, (count, 2)."""
        return random_pairs(count, self.generator)

    def update(self, batch: Batch, progress: float) -> Metrics:
        """Take one step; `priority`, (B,), is for the replay."""
        s = self.settings
        anneal(self.optimizer, s.learning_rate, s.final_rate, progress)
        for network in (self.online, self.target):
            self._noise(network, draw=True)
        losses = self.losses(batch)
        weight = batch.weight if batch.weight is not None else torch.ones_like(losses)
        loss = (weight * losses).mean()
        descend(self.optimizer, loss, self.online.parameters(), s.gradient_norm)
        self.updates += 1
        if self.updates % s.target_every == 0:
            blend(self.target, self.online, s.target_rate)
        blend(self.average, self.online, s.average_rate)
        return {"critic_loss": loss.detach(), "priority": losses.detach()}

    def losses(self, batch: Batch) -> Tensor:
        """Give each sample's cross entropy, (B,), against the projected next distribution."""
        seen, following = self.see(batch.observations), self.see(batch.next_observations)
        rows = torch.arange(len(batch.action))
        with torch.no_grad():
            best = (self.online(following).exp() * self.support).sum(2).argmax(1)
            after = self.target(following)[rows, best].exp()
            goal = project_distribution(after, batch.reward, batch.discount, self.support)
        chosen = self.online(seen)[rows, action_number(batch.action)]
        return cross_entropy(chosen, goal)

    def deployed(self, radius_margin: float) -> Pilot:
        """Give the greedy policy of the averaged network, without its noise."""
        self._noise(self.average, draw=False)
        return Pilot(self.see, self._greedy(self.average), radius_margin)

    def _greedy(self, network: DuelingDistribution) -> Greedy:
        return Greedy(MeanReturn(network, self.support))

    def _noise(self, network: DuelingDistribution, *, draw: bool) -> None:
        for layer in network.noisy:
            if draw:
                layer.draw(self.generator)
            else:
                layer.quiet()
