"""IQN: implicit quantile networks (Dabney et al. 2018; paper, sec. V-C).

Acting takes fixed fractions, the midpoints of K equal parts: with random ones the policy disagrees
with itself from one call to the next.
"""

from __future__ import annotations

import copy

import torch
from torch import Tensor, nn

from twinscrew.runtime.settings import Count, Positive
from twinscrew.training.agents.base import (
    Agent,
    AgentSettings,
    Metrics,
    adam,
    anneal,
    blend,
    descend,
    wide,
)
from twinscrew.training.agents.discrete import PAIRS, Greedy, action_number, random_pairs, taken
from twinscrew.training.buffer import Batch
from twinscrew.training.encoders import Seen
from twinscrew.training.losses import (
    quantile_huber,
    stratified_fractions,
    td_target,
    uniform_fractions,
)
from twinscrew.training.networks import Pilot
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

    def __init__(self, quantiles: QuantileQNetwork, count: int) -> None:
        super().__init__()
        self.quantiles = quantiles
        fractions = (torch.arange(count) + 0.5) / count
        fractions = fractions.to(quantiles.output.weight.device)
        self.register_buffer("fractions", fractions, persistent=False)

    def forward(self, seen: Seen) -> Tensor:
        """Give values (B, A)."""
        values: Tensor = self.quantiles(seen, self.fractions)
        return values.mean(1)


class Iqn(Agent[IqnSettings]):
    """The learner."""

    continuous = False

    def __init__(self, settings: IqnSettings, seed: int, device: str = "cpu") -> None:
        super().__init__(settings, seed, device)
        self.quantiles = QuantileQNetwork(settings.network, PAIRS).to(self.device)
        self.target = copy.deepcopy(self.quantiles)
        self.average = copy.deepcopy(self.quantiles)
        self.optimizer = adam(self.quantiles, settings.learning_rate)
        self.keep(
            quantiles=self.quantiles,
            target=self.target,
            average=self.average,
            optimizer=self.optimizer,
        )

    def choose(self, seen: Seen, *, explore: bool) -> Tensor:
        """Give greedy pairs, (B, 2); exploration is added outside."""
        network = self.quantiles if explore else self.average
        with wide(self.settings.bfloat16, self.device.type):
            action: Tensor = self._greedy(network)(seen)
        return action

    def random(self, count: int) -> Tensor:
        """Give random pairs, (count, 2)."""
        return random_pairs(count, self.generator)

    def update(self, batch: Batch, progress: float) -> Metrics:
        """Take one step."""
        s = self.settings
        anneal(self.optimizer, s.learning_rate, s.final_rate, progress)
        loss = self.loss(batch)
        descend(self.optimizer, loss, self.quantiles.parameters(), s.gradient_norm)
        self.updates += 1
        if self.updates % s.target_every == 0:
            blend(self.target, self.quantiles, s.target_rate)
        blend(self.average, self.quantiles, s.average_rate)
        return {"critic_loss": loss.detach()}

    def loss(self, batch: Batch) -> Tensor:
        """Give the mean quantile Huber loss (paper, eqs. 8 to 10)."""
        s = self.settings
        seen, following = self.see(batch.observations), self.see(batch.next_observations)
        with torch.no_grad(), wide(s.bfloat16, self.device.type):
            after = self.target(following, self._fractions(len(batch.action)))
        best = after.float().mean(1).argmax(1)
        target = td_target(batch.reward, batch.discount, taken(after, best).float())
        fractions = self._fractions(len(batch.action))
        with wide(s.bfloat16, self.device.type):
            quantiles = self.quantiles(seen, fractions)
        chosen = taken(quantiles, action_number(batch.action)).float()
        return quantile_huber(chosen, target, fractions, s.kappa).mean()

    def deployed(self, radius_margin: float) -> Pilot:
        """Give the greedy policy of the averaged network, at fixed fractions."""
        return Pilot(self.see, self._greedy(self.average), radius_margin)

    def _greedy(self, network: QuantileQNetwork) -> Greedy:
        return Greedy(MeanOverFractions(network, self.settings.acting_fractions))

    def _fractions(self, batch: int) -> Tensor:
        draw = self.settings.fractions
        if self.settings.stratified:
            return stratified_fractions(draw, self.generator).to(self.device)
        return uniform_fractions(batch, draw, self.generator).to(self.device)
