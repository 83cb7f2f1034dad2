"""AC-IQN: actor-critic implicit quantile networks (paper, sec. V-D and algorithm 2).

The critic Z learns quantiles of the return of (state, action); the actor pi climbs the mean of the
critic's quantiles. A prime marks target networks, M is the batch, N = N' are the fractions tau:

    delta_ij = r + gamma^n Z'(s', pi'(s'); tau'_j) - Z(s, a; tau_i)                      eq. 9
    L = 1/M sum_M 1/N' sum_i sum_j |tau_i - 1{delta_ij < 0}| L_kappa(delta_ij) / kappa   eqs. 10, 11
    J = 1/M sum_M 1/N sum_i Z(s, pi(s); tau_i)                                           alg. 2, 3
    theta' <- beta theta + (1 - beta) theta'                                             alg. 2, 5

With `risk` alpha < 1 the actor climbs the mean of the worst share alpha of the quantiles instead,
the conditional value at risk (CVaR). With `risk_levels` one actor learns all levels at once: alpha
is one more input of both networks, and Z(.|alpha) is the return of the policy of that level. A
transition does not depend on alpha, so in an update each is given a level drawn anew, whatever
level gathered it.
"""

from __future__ import annotations

import copy
import math
from typing import Annotated

import torch
from msgspec import Meta
from torch import Tensor, nn
from torch.nn import functional

from twinscrew.runtime.errors import ConfigError
from twinscrew.runtime.settings import Count, Positive
from twinscrew.training.agents.base import (
    ActorAgent,
    ActorSettings,
    Descent,
    Draws,
    Lesson,
    Metrics,
    Rate,
    adam,
    huber,
    td_target,
)
from twinscrew.training.networks import (
    ACTIONS,
    Actor,
    NetworkSettings,
    Observations,
    Pilot,
    Seen,
    make_encoder,
    with_risk,
)
from twinscrew.training.replay import Batch


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
    """[-] L: one actor is learnt for alpha = 1/L, 2/L, ..., 1, an input; 0: for `risk`."""

    def __post_init__(self) -> None:
        """Refuse levels that do not fall on the edges between the fractions."""
        levels = self.risk_levels
        if levels and (not self.stratified or self.fractions % levels):
            raise ValueError("risk_levels needs stratified fractions, a multiple of it in number")


# -- networks (paper, fig. 5); the actor is `networks.Actor` --------------------------------------


class CosineEmbedding(nn.Module):
    """Features of quantile fractions: ReLU(W cos(pi i tau) + b), i = 0, 1, ... (IQN, eq. 4)."""

    frequencies: Tensor

    def __init__(self, cosines: int, width: int) -> None:
        super().__init__()
        self.layer = nn.Linear(cosines, width)
        frequencies = math.pi * torch.arange(cosines, dtype=torch.float32)
        self.register_buffer("frequencies", frequencies, persistent=False)

    def forward(self, fractions: Tensor) -> Tensor:
        """Embed fractions, (..., N) in [0, 1], as (..., N, width)."""
        return torch.relu(self.layer(torch.cos(fractions[..., None] * self.frequencies)))


class PaperQuantileCritic(nn.Module):
    """The paper's critic: state (.) quantile -> 128 (.) action -> 128 -> 1 (fig. 5)."""

    def __init__(self, settings: NetworkSettings, extra: int = 0) -> None:
        super().__init__()
        self.encoder = make_encoder(settings, extra)
        hidden = settings.hidden_width
        self.embedding = CosineEmbedding(settings.cosines, self.encoder.width)
        self.hidden1 = nn.Linear(self.encoder.width, hidden)
        self.action = nn.Linear(ACTIONS, hidden)
        self.hidden2 = nn.Linear(hidden, hidden)
        self.output = nn.Linear(hidden, 1)

    def forward(self, seen: Seen, action: Tensor, fractions: Tensor) -> Tensor:
        """Give the return's quantiles (B, N) at `fractions`, (N,) or (B, N)."""
        state = self.encoder(seen)[:, None, :]
        hidden = torch.relu(self.hidden1(state * self.embedding(fractions)))
        hidden = hidden * torch.relu(self.action(action))[:, None, :]
        value: Tensor = self.output(torch.relu(self.hidden2(hidden)))
        return value.squeeze(-1)


class QuantileCritic(nn.Module):
    """Our critic: (state, action) -> 256 (.) quantile -> 128 -> 1, fractions shared by the batch.

    What does not depend on the fraction is computed once a sample instead of once a fraction; one
    wide layer remains that is computed for every pair of them.
    """

    def __init__(self, settings: NetworkSettings, extra: int = 0) -> None:
        super().__init__()
        self.encoder = make_encoder(settings, extra)
        wide, hidden = settings.feature_width, settings.hidden_width
        self.state = nn.Linear(self.encoder.width, wide)
        self.action = nn.Linear(ACTIONS, wide, bias=False)
        self.beyond: nn.Linear | None = None
        if settings.contour:  # a goal on the way is worth what lies beyond it
            self.beyond = nn.Linear(2, wide, bias=False)
            nn.init.zeros_(self.beyond.weight)
        self.joined = nn.Linear(wide, wide)
        self.embedding = CosineEmbedding(settings.cosines, wide)
        self.hidden = nn.Linear(wide, hidden)
        self.output = nn.Linear(hidden, 1)

    def forward(self, seen: Seen, action: Tensor, fractions: Tensor) -> Tensor:
        """Give the return's quantiles (B, N) at `fractions`, (N,)."""
        joined = self.state(self.encoder(seen)) + self.action(action)
        if self.beyond is not None:
            joined = joined + self.beyond(seen.beyond)
        joined = torch.relu(joined)
        joined = torch.relu(self.joined(joined))
        # W (x (.) phi_n) = (W diag(phi_n)) x: the fractions are the batch's, so they go into the
        # weights, and no (B, N, width) product is ever formed.
        embedding = self.embedding(fractions)
        weight = self.hidden.weight.to(embedding.dtype) * embedding[:, None, :]
        hidden = functional.linear(
            joined, weight.flatten(0, 1), self.hidden.bias.repeat(len(embedding))
        )
        hidden = torch.relu(hidden).view(len(joined), len(embedding), -1)
        value: Tensor = self.output(hidden)
        return value.squeeze(-1)


def make_quantile_critic(
    settings: NetworkSettings, extra: int = 0
) -> PaperQuantileCritic | QuantileCritic:
    """Build the critic that the settings name, with `extra` more ego features."""
    kind = PaperQuantileCritic if settings.critic == "paper" else QuantileCritic
    return kind(settings, extra)


# -- losses ---------------------------------------------------------------------------------------


def draw_fractions(
    batch: int, count: int, generator: torch.Generator, *, stratified: bool
) -> Tensor:
    """Draw quantile fractions: (count,) for all samples, or each from U([0, 1]), (batch, count).

    Stratified, one lies in each of `count` equal parts of [0, 1]: their mean has far less variance
    than that of independent draws. Multiplied by alpha they keep to the worst share of the returns:
    the mean of the quantiles is then their CVaR.
    """
    if stratified:
        return (torch.arange(count) + torch.rand(count, generator=generator)) / count
    return torch.rand(batch, count, generator=generator)


def worst_share(risk: Tensor, count: int) -> Tensor:
    """Give weights, (B, count), that turn stratified quantiles into their CVaR at (B, 1) levels.

    The first k of n stratified fractions cover [0, k / n]: with alpha = k / n the mean of their
    quantiles is that of the worst share alpha of the returns, without bias.
    """
    inside = torch.arange(count, device=risk.device) + 0.5 < risk * count
    return inside / (risk * count)


def quantile_huber(quantiles: Tensor, targets: Tensor, fractions: Tensor, kappa: float) -> Tensor:
    """Give the quantile Huber loss of each sample, (B,) (paper, eqs. 9 to 11).

    Parameters
    ----------
    quantiles : (B, N)
        Z at `fractions`.
    targets : (B, M)
        Samples of the return; no gradient is taken through them.
    fractions : (N,) or (B, N)
        tau_i.
    kappa
        Where the loss turns from square to linear.
    """
    error = targets.detach()[:, None, :] - quantiles[:, :, None]
    weight = (fractions[..., None] - (error.detach() < 0).float()).abs()
    return (weight * huber(error, kappa)).mean(2).sum(1) / kappa


# -- the update -----------------------------------------------------------------------------------


class AcIqn(ActorAgent[AcIqnSettings]):
    """The learner of algorithm 2."""

    targets = (("target_critic", "critic"), ("target_actor", "actor"))

    def __init__(self, settings: AcIqnSettings, seed: int, device: str = "cpu") -> None:
        super().__init__(settings, seed, device)
        self.risk_levels = settings.risk_levels
        extra = 1 if self.risk_levels else 0
        self.actor = Actor(settings.network, extra).to(self.device)
        self.critic = make_quantile_critic(settings.network, extra).to(self.device)
        self.target_actor = copy.deepcopy(self.actor)
        self.target_critic = copy.deepcopy(self.critic)
        self.average_actor = copy.deepcopy(self.actor)
        self.keep(
            actor=self.actor,
            critic=self.critic,
            target_actor=self.target_actor,
            target_critic=self.target_critic,
            average_actor=self.average_actor,
            actor_optimizer=adam(self.actor, settings.actor_rate),
            critic_optimizer=adam(self.critic, settings.learning_rate),
        )

    def act(
        self, observations: Observations, *, explore: bool, risk: Tensor | None = None
    ) -> Tensor:
        """Give actions (B, 2), at the settings' risk level if the networks take any."""
        if self.risk_levels and risk is None:
            risk = torch.full((1, 1), self.settings.risk, device=self.device)
        return super().act(observations, explore=explore, risk=risk)

    def choose(self, seen: Seen, draws: Draws, *, explore: bool) -> Tensor:  # noqa: ARG002
        """Give the actor's actions, (B, 2); exploration is added outside."""
        with self.mixed():
            action: Tensor = (self.actor if explore else self.average_actor)(seen)
        return action.float()

    def chance(self, batch: int) -> Draws:
        """Draw a risk level for each sample, if the networks take any, and the fractions."""
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
        seen, following = (with_risk(s, draws["risk"]) for s in (lesson.seen, lesson.following))
        return lesson._replace(seen=seen, following=following)

    def descents(self) -> tuple[Descent, ...]:
        """Give the critic's step, and the actor's (alg. 2, lines 2 to 4)."""
        return (
            Descent(self.critic_loss, (("critic", "critic_optimizer"),)),
            Descent(self.actor_loss, (("actor", "actor_optimizer"),)),
        )

    def critic_loss(self, lesson: Lesson) -> tuple[Tensor, Metrics]:
        """Give L of Z against r + gamma Z'(s', pi'(s')) (alg. 2, line 2)."""
        s, fractions = self.settings, lesson.draws["critic"]
        with torch.no_grad(), self.mixed():
            action = self.target_actor(lesson.following)
            value = self.target_critic(lesson.following, action, lesson.draws["target"])
        target = td_target(lesson.reward, lesson.discount, value.float())
        with self.mixed():
            quantiles = self.critic(lesson.seen, lesson.action, fractions)
        loss = quantile_huber(quantiles.float(), target, fractions, s.kappa).mean()
        return loss, {"critic_loss": loss, "quantile_spread": spread(quantiles)}

    def actor_loss(self, lesson: Lesson) -> tuple[Tensor, Metrics]:
        """Give -J: the mean of Z(s, pi(s)), or of its worst share (alg. 2, line 3).

        The share is the settings' `risk`, which the fractions then keep to, or each sample's own.
        """
        fractions = lesson.draws["actor"]
        with self.mixed():
            quantiles = self.critic(lesson.seen, self.actor(lesson.seen), fractions).float()
        if self.risk_levels:
            quantiles = quantiles * worst_share(lesson.draws["risk"], fractions.shape[-1])
            quantiles = quantiles.sum(1)
        value = quantiles.mean()
        return -value, {"actor_value": value}

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
        """Give the averaged actor, at the settings' risk level if it takes any."""
        risk = self.settings.risk if self.risk_levels else None
        return Pilot(self.see, self.average_actor, radius_margin, risk)


def spread(quantiles: Tensor) -> Tensor:
    """Give the mean over samples of the distance from the least to the greatest quantile."""
    return (quantiles.amax(1) - quantiles.amin(1)).detach().float().mean()
