"""AC-IQN: actor-critic implicit quantile networks (paper, sec. V-D and algorithm 2).

The critic learns quantiles of the return of (state, action) by the quantile Huber loss against
r + gamma Z'(s', pi'(s')); the actor climbs the mean of the critic's quantiles. With `risk` < 1 the
actor climbs the mean of the worst share of them instead, the conditional value at risk.
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
    Rate,
    adam,
    anneal,
    blend,
    descend,
    wide,
)
from twinscrew.training.buffer import Batch
from twinscrew.training.encoders import See, Seen
from twinscrew.training.losses import (
    quantile_huber,
    stratified_fractions,
    td_target,
    uniform_fractions,
)
from twinscrew.training.networks import ACTIONS, Actor, Pilot, make_quantile_critic
from twinscrew.training.observations import Observations


class AcIqnSettings(AgentSettings, frozen=True, tag_field="algorithm", tag="ac_iqn"):
    """AC-IQN."""

    actor_rate: Positive = 3e-4
    """[-] Adam's step for the actor, at the start."""
    fractions: Count = 8
    """[-] N = N': quantile fractions in a loss (paper: 8)."""
    stratified: bool = True
    """Share one fraction from each eighth of [0, 1] in the batch; else draw each one by itself."""
    kappa: Positive = 1.0
    """[-] Where the Huber loss turns linear (paper: 1)."""
    risk: Rate = 1.0
    """[-] alpha: the actor maximises the mean of the worst share alpha of the returns (CVaR)."""


class AcIqn(Agent[AcIqnSettings]):
    """The learner of algorithm 2."""

    def __init__(self, settings: AcIqnSettings, seed: int, device: str = "cpu") -> None:
        super().__init__(settings, seed, device)
        self.see = See(settings.network).to(self.device)
        self.actor = Actor(settings.network).to(self.device)
        self.critic = make_quantile_critic(settings.network).to(self.device)
        self.target_actor = copy.deepcopy(self.actor)
        self.target_critic = copy.deepcopy(self.critic)
        self.average_actor = copy.deepcopy(self.actor)
        self.actor_optimizer = adam(self.actor, settings.actor_rate)
        self.critic_optimizer = adam(self.critic, settings.learning_rate)
        self.keep(
            actor=self.actor,
            critic=self.critic,
            target_actor=self.target_actor,
            target_critic=self.target_critic,
            average_actor=self.average_actor,
            actor_optimizer=self.actor_optimizer,
            critic_optimizer=self.critic_optimizer,
        )

    def act(self, observations: Observations, *, explore: bool) -> Tensor:
        """Give the actor's actions, (B, 2); exploration is added outside."""
        with torch.no_grad(), wide(self.settings.bfloat16, self.device.type):
            actor = self.actor if explore else self.average_actor
            action: Tensor = actor(self.see(observations))
        return action.float()

    def random(self, count: int) -> Tensor:
        """Give uniform actions, (count, 2) in [-1, 1]."""
        return 2.0 * torch.rand(count, ACTIONS, generator=self.generator) - 1.0

    def update(self, batch: Batch, progress: float) -> Metrics:
        """Take one step of algorithm 2."""
        s = self.settings
        anneal(self.critic_optimizer, s.learning_rate, s.final_rate, progress)
        anneal(self.actor_optimizer, s.actor_rate, s.final_rate, progress)
        seen, following = self.see(batch.observations), self.see(batch.next_observations)
        critic_loss = self.critic_loss(batch, seen, following)
        descend(self.critic_optimizer, critic_loss, self.critic.parameters(), s.gradient_norm)
        self.critic.requires_grad_(False)
        value = self.actor_value(seen)
        descend(self.actor_optimizer, -value, self.actor.parameters(), s.gradient_norm)
        self.critic.requires_grad_(True)
        self.updates += 1
        if self.updates % s.target_every == 0:
            blend(self.target_critic, self.critic, s.target_rate)
            blend(self.target_actor, self.actor, s.target_rate)
        blend(self.average_actor, self.actor, s.average_rate)
        return {"critic_loss": critic_loss.detach(), "actor_value": value.detach()}

    def critic_loss(self, batch: Batch, seen: Seen, following: Seen) -> Tensor:
        """Give the quantile Huber loss of Z against r + gamma Z'(s', pi'(s')) (alg. 2, line 2)."""
        s = self.settings
        with torch.no_grad(), wide(s.bfloat16, self.device.type):
            action = self.target_actor(following)
            value = self.target_critic(following, action, self._fractions(len(action)))
        target = td_target(batch.reward, batch.discount, value.float())
        fractions = self._fractions(len(action))
        with wide(s.bfloat16, self.device.type):
            quantiles = self.critic(seen, batch.action, fractions)
        return quantile_huber(quantiles.float(), target, fractions, s.kappa).mean()

    def actor_value(self, seen: Seen) -> Tensor:
        """Give the mean of Z(s, pi(s)), or of its worst share (alg. 2, line 3)."""
        fractions = self._fractions(len(seen.ego), upper=self.settings.risk)
        with wide(self.settings.bfloat16, self.device.type):
            quantiles = self.critic(seen, self.actor(seen), fractions)
        value: Tensor = quantiles.float().mean()
        return value

    def deployed(self, radius_margin: float) -> nn.Module:
        """Give the averaged actor."""
        return Pilot(self.see, self.average_actor, radius_margin)

    def _fractions(self, batch: int, upper: float = 1.0) -> Tensor:
        count = self.settings.fractions
        if self.settings.stratified:
            fractions = stratified_fractions(count, self.generator, upper=upper)
        else:
            fractions = uniform_fractions(batch, count, self.generator) * upper
        return fractions.to(self.device)
