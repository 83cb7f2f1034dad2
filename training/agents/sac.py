"""SAC: soft actor-critic (Haarnoja et al. 2018; paper, eq. 7); squashing by (2 / pi) atan."""

from __future__ import annotations

import copy
import math

import torch
from torch import Tensor, nn

from twinscrew.runtime.settings import Positive
from twinscrew.training.agents.base import (
    ActorAgent,
    ActorSettings,
    Descent,
    Draws,
    Lesson,
    Metrics,
    adam,
    huber,
    td_target,
)
from twinscrew.training.agents.ddpg import ActionCritic
from twinscrew.training.networks import ACTIONS, NetworkSettings, Pilot, Seen, Trunk, squash


class SacSettings(ActorSettings, frozen=True, tag_field="algorithm", tag="sac"):
    """SAC."""

    temperature: Positive = 0.078
    """[-] alpha: what an entropy of 1 is worth; its start if it is learnt."""
    learn_temperature: bool = True
    """Adapt alpha until the entropy is `target_entropy`; the paper's is fixed."""
    target_entropy: float = -2.0
    """[-] Of an action; -2, minus its dimension, is the authors' of SAC advice."""
    log_sigma_min: float = -5.0
    """[-] Least log standard deviation; the reference's -20 lets the noise die out,"""
    log_sigma_max: float = 2.0
    """[-] and its greatest."""


class GaussianActor(nn.Module):
    """A Gaussian over actions before squashing."""

    def __init__(self, settings: NetworkSettings, log_sigma: tuple[float, float]) -> None:
        super().__init__()
        self.trunk = Trunk(settings)
        self.mean = nn.Linear(self.trunk.width, ACTIONS)
        self.log_sigma = nn.Linear(self.trunk.width, ACTIONS)
        self.limits = log_sigma

    def forward(self, seen: Seen) -> tuple[Tensor, Tensor]:
        """Give mean and log standard deviation, (B, 2) each."""
        features = self.trunk(seen)
        return self.mean(features), self.log_sigma(features).clamp(*self.limits)


def log_density(x: Tensor, mean: Tensor, log_sigma: Tensor) -> Tensor:
    """Give log pi(a), (B,), of a = (2 / pi) atan(x), x ~ N(mean, sigma^2), all (B, 2).

    The squashing's slope is (2 / pi) / (1 + x^2).
    """
    normal = -0.5 * ((x - mean) / log_sigma.exp()) ** 2 - log_sigma - 0.5 * math.log(2 * math.pi)
    slope = math.log(2.0 / math.pi) - torch.log1p(x * x)
    return (normal - slope).sum(1)


class SquashedMean(nn.Module):
    """The deterministic policy of a Gaussian actor."""

    def __init__(self, actor: nn.Module) -> None:
        super().__init__()
        self.actor = actor

    def forward(self, seen: Seen) -> Tensor:
        """Give actions (B, 2)."""
        return squash(self.actor(seen)[0])


class Temperature(nn.Module):
    """The logarithm of alpha, learnt or not."""

    def __init__(self, alpha: float) -> None:
        super().__init__()
        self.log = nn.Parameter(torch.tensor(math.log(alpha)))


class Sac(ActorAgent[SacSettings]):
    """The learner."""

    targets = (("target_critics", "critics"),)

    def __init__(self, settings: SacSettings, seed: int, device: str = "cpu") -> None:
        super().__init__(settings, seed, device)
        limits = (settings.log_sigma_min, settings.log_sigma_max)
        self.actor = GaussianActor(settings.network, limits).to(self.device)
        self.critics = nn.ModuleList([ActionCritic(settings.network) for _ in range(2)])
        self.critics.to(self.device)
        self.target_critics = copy.deepcopy(self.critics)
        self.average_actor = copy.deepcopy(self.actor)
        self.temperature = Temperature(settings.temperature).to(self.device)
        self.keep(
            actor=self.actor,
            critics=self.critics,
            target_critics=self.target_critics,
            average_actor=self.average_actor,
            temperature=self.temperature,
            actor_optimizer=adam(self.actor, settings.actor_rate),
            critic_optimizer=adam(self.critics, settings.learning_rate),
            temperature_optimizer=adam(self.temperature, settings.actor_rate),
        )

    def choose(self, seen: Seen, draws: Draws, *, explore: bool) -> Tensor:
        """Give sampled actions, (B, 2), when exploring, else squashed means."""
        if explore:
            return self.sample(seen, draws["white"])[0]
        return squash(self.average_actor(seen)[0])

    def acting_chance(self, count: int) -> Draws:
        """Draw white noise for the actions."""
        return {"white": self._white(count)}

    def chance(self, batch: int) -> Draws:
        """Draw white noise for the actions that follow, and for those of the actor's step."""
        return {"following": self._white(batch), "seen": self._white(batch)}

    def _white(self, count: int) -> Tensor:
        return torch.randn((count, ACTIONS), generator=self.generator)

    def sample(self, seen: Seen, white: Tensor) -> tuple[Tensor, Tensor]:
        """Give actions, (B, 2), with their log densities, (B,); gradients flow through both."""
        with self.mixed():
            mean, log_sigma = self.actor(seen)
        mean, log_sigma = mean.float(), log_sigma.float()
        x = mean + log_sigma.exp() * white
        return squash(x), log_density(x, mean, log_sigma)

    def descents(self) -> tuple[Descent, ...]:
        """Give the critics' step, and the actor's with that of the temperature, if it is learnt."""
        actor = [("actor", "actor_optimizer")]
        if self.settings.learn_temperature:
            actor.append(("temperature", "temperature_optimizer"))
        return (
            Descent(self.critic_loss, (("critics", "critic_optimizer"),)),
            Descent(self.actor_loss, tuple(actor)),
        )

    def critic_loss(self, lesson: Lesson) -> tuple[Tensor, Metrics]:
        """Give both critics' Huber loss against r + gamma (min Q'(s', a') - alpha log pi(a'))."""
        with torch.no_grad():
            action, density = self.sample(lesson.following, lesson.draws["following"])
            worse = self._worse(self.target_critics, lesson.following, action)
            soft = worse - self.temperature.log.exp() * density
        target = td_target(lesson.reward, lesson.discount, soft[:, None]).squeeze(1)
        with self.mixed():
            values = [critic(lesson.seen, lesson.action) for critic in self.critics]
        losses = torch.stack([huber(target - value.float(), 1.0).mean() for value in values])
        return losses.sum(), {"critic_loss": losses.sum()}

    def actor_loss(self, lesson: Lesson) -> tuple[Tensor, Metrics]:
        """Give minus the worse critic's value with the entropy, and the temperature's loss.

        Each flows to its own: the first to the actor, log alpha (H - H_target) to the temperature.
        """
        action, density = self.sample(lesson.seen, lesson.draws["seen"])
        alpha = self.temperature.log.detach().exp()
        value = (self._worse(self.critics, lesson.seen, action) - alpha * density).mean()
        loss = -value
        if self.settings.learn_temperature:
            surplus = (density.detach() + self.settings.target_entropy).mean()
            loss = loss - self.temperature.log * surplus
        return loss, {"actor_value": value, "temperature": alpha, "entropy": -density.mean()}

    def _worse(self, critics: nn.ModuleList, seen: Seen, action: Tensor) -> Tensor:
        with self.mixed():
            one, other = (critic(seen, action) for critic in critics)
        return torch.minimum(one, other).float()

    def deployed(self, radius_margin: float) -> Pilot:
        """Give the squashed mean of the averaged actor."""
        return Pilot(self.see, SquashedMean(self.average_actor), radius_margin)
