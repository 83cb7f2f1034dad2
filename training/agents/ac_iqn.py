"""AC-IQN: actor-critic implicit quantile networks (paper, sec. V-D and algorithm 2).

The critic learns quantiles of the return of (state, action) by the quantile Huber loss against
r + gamma Z'(s', pi'(s')); the actor climbs the mean of the critic's quantiles. With `risk` < 1 the
actor climbs the mean of the worst share of them instead, the conditional value at risk (CVaR).

With `risk_levels` one actor learns all levels at once: both networks are told alpha, and Z(.|alpha)
is the return of the policy of that level. A transition does not depend on alpha, so in an update
each is given a level drawn anew, whatever level gathered it.
"""

from __future__ import annotations

from typing import Annotated

import torch
from msgspec import Meta
from torch import Tensor

from twinscrew.runtime.errors import ConfigError
from twinscrew.runtime.settings import Count, Positive
from twinscrew.training.agents.actor_critic import ActorSettings, DeterministicAgent
from twinscrew.training.agents.base import Rate
from twinscrew.training.agents.lesson import Draws, Lesson, Metrics
from twinscrew.training.agents.steps import wide
from twinscrew.training.buffer import Batch
from twinscrew.training.encoders import heed
from twinscrew.training.losses import draw_fractions, quantile_huber, td_target, worst_share
from twinscrew.training.networks import Actor, Pilot, make_quantile_critic
from twinscrew.training.observations import Observations


class AcIqnSettings(ActorSettings, frozen=True, tag_field="algorithm", tag="ac_iqn"):
    """AC-IQN."""

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


class AcIqn(DeterministicAgent[AcIqnSettings]):
    """The learner of algorithm 2."""

    def __init__(self, settings: AcIqnSettings, seed: int, device: str = "cpu") -> None:
        super().__init__(settings, seed, device)
        self.risk_levels = settings.risk_levels
        extra = 1 if self.risk_levels else 0
        actor = Actor(settings.network, extra)
        self.furnish(actor, make_quantile_critic(settings.network, extra))

    def act(
        self, observations: Observations, *, explore: bool, risk: Tensor | None = None
    ) -> Tensor:
        """Give actions (B, 2), at the settings' risk level if the agent is told of any."""
        if self.risk_levels and risk is None:
            risk = torch.full((1, 1), self.settings.risk, device=self.device)
        return super().act(observations, explore=explore, risk=risk)

    def chance(self, batch: int) -> Draws:
        """Draw a risk level for each sample, if the agent is told of any, and the fractions."""
        s, draws = self.settings, {}
        if self.risk_levels:
            level = torch.randint(1, self.risk_levels + 1, (batch, 1), generator=self.generator)
            draws["risk"] = level / self.risk_levels
        for name in ("target", "critic", "actor"):
            draws[name] = draw_fractions(
                batch, s.fractions, self.generator, stratified=s.stratified
            )
        if not self.risk_levels:
            draws["actor"] *= s.risk  # the worst share alone
        return draws

    def prepare(self, batch: Batch, draws: Draws) -> Lesson:
        """Turn a batch into a lesson; its risk levels are seen like the rest."""
        lesson = super().prepare(batch, draws)
        if not self.risk_levels:
            return lesson
        told = [heed(seen, draws["risk"]) for seen in (lesson.seen, lesson.following)]
        return lesson._replace(seen=told[0], following=told[1])

    def critic_loss(self, lesson: Lesson) -> tuple[Tensor, Metrics]:
        """Give the quantile Huber loss of Z against r + gamma Z'(s', pi'(s')) (alg. 2, line 2)."""
        s, fractions = self.settings, lesson.draws["critic"]
        with torch.no_grad(), wide(s.bfloat16, self.device.type):
            action = self.target_actor(lesson.following)
            value = self.target_critic(lesson.following, action, lesson.draws["target"])
        target = td_target(lesson.reward, lesson.discount, value.float())
        with wide(s.bfloat16, self.device.type):
            quantiles = self.critic(lesson.seen, lesson.action, fractions)
        loss = quantile_huber(quantiles.float(), target, fractions, s.kappa).mean()
        return loss, {"critic_loss": loss}

    def actor_value(self, lesson: Lesson) -> Tensor:
        """Give the mean of Z(s, pi(s)), or of its worst share (alg. 2, line 3).

        The share is the settings' `risk`, which the fractions then keep to, or each sample's own.
        """
        fractions = lesson.draws["actor"]
        with wide(self.settings.bfloat16, self.device.type):
            quantiles = self.critic(lesson.seen, self.actor(lesson.seen), fractions).float()
        if self.risk_levels:
            quantiles = quantiles * worst_share(lesson.draws["risk"], fractions.shape[-1])
            quantiles = quantiles.sum(1)
        mean: Tensor = quantiles.mean()
        return mean

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
        """Give the averaged actor, at the settings' risk level if it is told of any."""
        risk = self.settings.risk if self.risk_levels else None
        return Pilot(self.see, self.average_actor, radius_margin, risk)
