"""AC-IQN: actor-critic implicit quantile networks (paper, sec. V-D and algorithm 2).

The critic learns quantiles of the return of (state, action) by the quantile Huber loss against
r + gamma Z'(s', pi'(s')); the actor climbs the mean of the critic's quantiles. With `risk` < 1 the
actor climbs the mean of the worst share of them instead, the conditional value at risk (CVaR).

With `risk_levels` one actor learns all levels at once: both networks are told alpha, and Z(.|alpha)
is the return of the policy of that level. A transition does not depend on alpha, so in an update
each is given a level drawn anew, whatever level gathered it.
"""

from __future__ import annotations

import copy
from typing import Annotated

import torch
from msgspec import Meta
from torch import Tensor

from twinscrew.runtime.errors import ConfigError
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
from twinscrew.training.encoders import Seen, heed
from twinscrew.training.losses import (
    quantile_huber,
    stratified_fractions,
    td_target,
    uniform_fractions,
    worst_share,
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
    """[-] alpha: the actor maximises the mean of the worst share alpha of the returns (CVaR).
    With `risk_levels`, the level at which it is evaluated and deployed."""
    risk_levels: Annotated[int, Meta(ge=0, le=64)] = 0
    """[-] L: one actor is learnt for alpha = 1/L, 2/L, ..., 1, told as an input; 0: for `risk`."""

    def __post_init__(self) -> None:
        """Refuse levels that do not fall on the edges between the fractions."""
        levels = self.risk_levels
        if levels and (not self.stratified or self.fractions % levels):
            raise ValueError("risk_levels needs stratified fractions, a multiple of it in number")


class AcIqn(Agent[AcIqnSettings]):
    """The learner of algorithm 2."""

    def __init__(self, settings: AcIqnSettings, seed: int, device: str = "cpu") -> None:
        super().__init__(settings, seed, device)
        self.risk_levels = settings.risk_levels
        extra = 1 if self.risk_levels else 0
        self.actor = Actor(settings.network, extra).to(self.device)
        self.critic = make_quantile_critic(settings.network, extra).to(self.device)
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

    def act(
        self, observations: Observations, *, explore: bool, risk: Tensor | None = None
    ) -> Tensor:
        """Give actions (B, 2), at the settings' risk level if the agent is told of any."""
        if self.risk_levels and risk is None:
            risk = torch.full((1, 1), self.settings.risk, device=self.device)
        return super().act(observations, explore=explore, risk=risk)

    def choose(self, seen: Seen, *, explore: bool) -> Tensor:
        """Give the actor's actions, (B, 2); exploration is added outside."""
        actor = self.actor if explore else self.average_actor
        with wide(self.settings.bfloat16, self.device.type):
            action: Tensor = actor(seen)
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
        risk = self._relabel(len(batch.action))
        if risk is not None:
            seen, following = heed(seen, risk), heed(following, risk)
        critic_loss = self.critic_loss(batch, seen, following)
        descend(self.critic_optimizer, critic_loss, self.critic.parameters(), s.gradient_norm)
        self.critic.requires_grad_(False)
        value = self.actor_value(seen, risk)
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

    def actor_value(self, seen: Seen, risk: Tensor | None = None) -> Tensor:
        """Give the mean of Z(s, pi(s)), or of its worst share (alg. 2, line 3).

        The share is the settings' `risk`, or that of each sample, (B, 1).
        """
        upper = self.settings.risk if risk is None else 1.0
        fractions = self._fractions(len(seen.ego), upper=upper)
        with wide(self.settings.bfloat16, self.device.type):
            quantiles = self.critic(seen, self.actor(seen), fractions).float()
        if risk is None:
            mean: Tensor = quantiles.mean()
            return mean
        value: Tensor = (quantiles * worst_share(risk, len(fractions))).sum(1).mean()
        return value

    def retune(self, settings: AcIqnSettings) -> None:
        """Go on under other settings.

        Raises
        ------
        ConfigError
            Other risk levels need other networks.
        """
        if settings.risk_levels != self.risk_levels:
            raise ConfigError("stays the same over all phases", key="agent.risk_levels")
        super().retune(settings)

    def deployed(self, radius_margin: float) -> Pilot:
        """Give the averaged actor."""
        risk = self.settings.risk if self.risk_levels else None
        return Pilot(self.see, self.average_actor, radius_margin, risk)

    def _relabel(self, batch: int) -> Tensor | None:
        """Draw a level for each sample, (B, 1); None if there are none."""
        if not self.risk_levels:
            return None
        level = torch.randint(1, self.risk_levels + 1, (batch, 1), generator=self.generator)
        return (level / self.risk_levels).to(self.device)

    def _fractions(self, batch: int, upper: float = 1.0) -> Tensor:
        count = self.settings.fractions
        if self.settings.stratified:
            fractions = stratified_fractions(count, self.generator, upper=upper)
        else:
            fractions = uniform_fractions(batch, count, self.generator) * upper
        return fractions.to(self.device)
