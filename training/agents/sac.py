"""SAC: soft actor-critic (Haarnoja et al. 2018) with the paper's squashing, (2 / pi) atan."""

from __future__ import annotations

import copy
import math

import torch
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
    wide,
)
from twinscrew.training.buffer import Batch
from twinscrew.training.encoders import Seen
from twinscrew.training.losses import huber, td_target
from twinscrew.training.networks import ACTIONS, Pilot, squash
from twinscrew.training.networks_value import ActionCritic, GaussianActor


class SacSettings(AgentSettings, frozen=True, tag_field="algorithm", tag="sac"):
    """SAC."""

    actor_rate: Positive = 3e-4
    """[-] Adam's step for the actor and the temperature, at the start."""
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


def log_density(x: Tensor, mean: Tensor, log_sigma: Tensor) -> Tensor:
    """Give log pi(a), (B,), of a = (2 / pi) atan(x), x ~ N(mean, sigma^2), all (B, 2).

    The squashing's slope is (2 / pi) / (1 + x^2).
    """
    normal = -0.5 * ((x - mean) / log_sigma.exp()) ** 2 - log_sigma - 0.5 * math.log(2 * math.pi)
    slope = math.log(2.0 / math.pi) - torch.log1p(x * x)
    return (normal - slope).sum(1)


class SquashedMean(nn.Module):
    """The deterministic policy of a Gaussian actor."""

    def __init__(self, actor: GaussianActor) -> None:
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


class Sac(Agent[SacSettings]):
    """The learner."""

    def __init__(self, settings: SacSettings, seed: int, device: str = "cpu") -> None:
        super().__init__(settings, seed, device)
        limits = (settings.log_sigma_min, settings.log_sigma_max)
        self.actor = GaussianActor(settings.network, limits).to(self.device)
        self.critics = nn.ModuleList([ActionCritic(settings.network) for _ in range(2)])
        self.critics.to(self.device)
        self.target_critics = copy.deepcopy(self.critics)
        self.average_actor = copy.deepcopy(self.actor)
        self.temperature = Temperature(settings.temperature).to(self.device)
        self.actor_optimizer = adam(self.actor, settings.actor_rate)
        self.critic_optimizer = adam(self.critics, settings.learning_rate)
        self.temperature_optimizer = adam(self.temperature, settings.actor_rate)
        self.keep(
            actor=self.actor,
            critics=self.critics,
            target_critics=self.target_critics,
            average_actor=self.average_actor,
            temperature=self.temperature,
            actor_optimizer=self.actor_optimizer,
            critic_optimizer=self.critic_optimizer,
            temperature_optimizer=self.temperature_optimizer,
        )

    def choose(self, seen: Seen, *, explore: bool) -> Tensor:
        """Give sampled actions, (B, 2), when exploring, else squashed means."""
        return self.sample(seen)[0] if explore else squash(self.average_actor(seen)[0])

    def random(self, count: int) -> Tensor:
        """Give uniform actions, (count, 2) in [-1, 1]."""
        return 2.0 * torch.rand(count, ACTIONS, generator=self.generator) - 1.0

    def sample(self, seen: Seen) -> tuple[Tensor, Tensor]:
        """Draw actions, (B, 2), with their log densities, (B,); gradients flow through both."""
        with wide(self.settings.bfloat16, self.device.type):
            mean, log_sigma = self.actor(seen)
        mean, log_sigma = mean.float(), log_sigma.float()
        white = torch.randn(mean.shape, generator=self.generator).to(self.device)
        x = mean + log_sigma.exp() * white
        return squash(x), log_density(x, mean, log_sigma)

    def update(self, batch: Batch, progress: float) -> Metrics:
        """Take one step of critics, actor and temperature."""
        s = self.settings
        anneal(self.critic_optimizer, s.learning_rate, s.final_rate, progress)
        anneal(self.actor_optimizer, s.actor_rate, s.final_rate, progress)
        seen, following = self.see(batch.observations), self.see(batch.next_observations)
        critic_loss = self.critic_loss(batch, seen, following)
        descend(self.critic_optimizer, critic_loss, self.critics.parameters(), s.gradient_norm)
        self.critics.requires_grad_(False)
        action, density = self.sample(seen)
        alpha = self.temperature.log.detach().exp()
        value = (self._worse(self.critics, seen, action) - alpha * density).mean()
        descend(self.actor_optimizer, -value, self.actor.parameters(), s.gradient_norm)
        self.critics.requires_grad_(True)
        if s.learn_temperature:
            surplus = (density.detach() + s.target_entropy).mean()
            loss = -self.temperature.log * surplus
            descend(
                self.temperature_optimizer, loss, self.temperature.parameters(), s.gradient_norm
            )
        self.updates += 1
        if self.updates % s.target_every == 0:
            blend(self.target_critics, self.critics, s.target_rate)
        blend(self.average_actor, self.actor, s.average_rate)
        return {
            "critic_loss": critic_loss.detach(),
            "actor_value": value.detach(),
            "temperature": alpha,
            "entropy": -density.detach().mean(),
        }

    def critic_loss(self, batch: Batch, seen: Seen, following: Seen) -> Tensor:
        """Give both critics' Huber loss against r + gamma (min Q'(s', a') - alpha log pi(a'))."""
        with torch.no_grad():
            action, density = self.sample(following)
            worse = self._worse(self.target_critics, following, action)
            soft = worse - self.temperature.log.exp() * density
        goal = td_target(batch.reward, batch.discount, soft[:, None]).squeeze(1)
        with wide(self.settings.bfloat16, self.device.type):
            values = [critic(seen, batch.action) for critic in self.critics]
        losses = torch.stack([huber(goal - value.float(), 1.0).mean() for value in values])
        return losses.sum()

    def _worse(self, critics: nn.ModuleList, seen: Seen, action: Tensor) -> Tensor:
        with wide(self.settings.bfloat16, self.device.type):
            one, other = (critic(seen, action) for critic in critics)
        return torch.minimum(one, other).float()

    def deployed(self, radius_margin: float) -> Pilot:
        """Give the squashed mean of the averaged actor."""
        return Pilot(self.see, SquashedMean(self.average_actor), radius_margin)
