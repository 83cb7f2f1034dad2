"""PPO: proximal policy optimisation (Schulman et al. 2017), on-policy.

Every `horizon` decisions all that the vessels did since becomes a rollout; its advantages are
generalised (GAE, Schulman et al. 2016), and the updates that are due are made on it:

    delta_t = r_t + gamma V(s_t+1) - V(s_t),   A_t = delta_t + gamma lambda A_t+1
    ratio   = pi(a | s) / pi_old(a | s)
    L       = -mean min(ratio A, clip(ratio, 1 - eps, 1 + eps) A) - c H(pi)        the actor's
    L_V     = mean Huber(V(s) - (A + V_old(s)))                                    the critic's

Then the rollout is forgotten. Vessels share the policy, and each vessel's way is one trajectory.
"""

from __future__ import annotations

import copy
import math
from typing import TYPE_CHECKING

import torch
from torch import Tensor, nn

from twinscrew.runtime.settings import Count, Fraction, NonNegative, Positive
from twinscrew.training.agents.base import (
    ActorAgent,
    ActorSettings,
    Descent,
    Draws,
    Lesson,
    Metrics,
    adam,
    huber,
)
from twinscrew.training.agents.sac import SquashedMean, log_density
from twinscrew.training.networks import ACTIONS, NetworkSettings, Pilot, Seen, Trunk, squash
from twinscrew.training.replay import Memory, Rollout

if TYPE_CHECKING:
    from twinscrew.training.settings import TrainSettings


class PpoSettings(ActorSettings, frozen=True, tag_field="algorithm", tag="ppo"):
    """PPO."""

    horizon: Count = 32
    """[decisions] Of every vessel in a rollout."""
    clip: Positive = 0.2
    """[-] eps: the ratio of probabilities counts no farther than this from 1."""
    trace: Fraction = 0.95
    """[-] lambda of the generalised advantages."""
    entropy: NonNegative = 0.002
    """[-] c: what an entropy of 1 is worth, in standard deviations of the advantage."""
    log_sigma: float = -0.5
    """[-] Logarithm of the actions' standard deviation before squashing, at first."""


class GaussianPolicy(nn.Module):
    """A Gaussian over actions before squashing, its spread the same in all states."""

    def __init__(self, settings: NetworkSettings, log_sigma: float) -> None:
        super().__init__()
        self.trunk = Trunk(settings)
        self.mean = nn.Linear(self.trunk.width, ACTIONS)
        self.log_sigma = nn.Parameter(torch.full((ACTIONS,), log_sigma))
        nn.init.zeros_(self.mean.bias)
        with torch.no_grad():
            self.mean.weight.mul_(0.01)  # at first the state hardly matters

    def forward(self, seen: Seen) -> tuple[Tensor, Tensor]:
        """Give mean and log standard deviation, (B, 2) each."""
        mean = self.mean(self.trunk(seen)).float()
        return mean, self.log_sigma.clamp(-4.0, 1.0).expand_as(mean)


class StateValue(nn.Module):
    """The value of a state."""

    def __init__(self, settings: NetworkSettings) -> None:
        super().__init__()
        self.trunk = Trunk(settings)
        self.output = nn.Linear(self.trunk.width, 1)

    def forward(self, seen: Seen) -> Tensor:
        """Give values (B,)."""
        value: Tensor = self.output(self.trunk(seen))
        return value.squeeze(-1).float()


class Ppo(ActorAgent[PpoSettings]):
    """The learner."""

    on_policy = True

    def __init__(self, settings: PpoSettings, seed: int, device: str = "cpu") -> None:
        super().__init__(settings, seed, device)
        self.actor = GaussianPolicy(settings.network, settings.log_sigma).to(self.device)
        self.critic = StateValue(settings.network).to(self.device)
        self.average_actor = copy.deepcopy(self.actor)
        self.keep(
            actor=self.actor,
            critic=self.critic,
            average_actor=self.average_actor,
            actor_optimizer=adam(self.actor, settings.actor_rate),
            critic_optimizer=adam(self.critic, settings.learning_rate),
        )

    def memory(self, settings: TrainSettings) -> Memory:
        """Give a rollout: what was done under older parameters is of no use."""
        return Rollout(self.settings.horizon, settings.discount)

    def choose(self, seen: Seen, draws: Draws, *, explore: bool) -> Tensor:
        """Give sampled actions, (B, 2), when exploring, else squashed means."""
        if not explore:
            return squash(self.average_actor(seen)[0])
        mean, log_sigma = self.actor(seen)
        return squash(mean + log_sigma.exp() * draws["white"])

    def acting_chance(self, count: int) -> Draws:
        """Draw white noise for the actions."""
        return {"white": torch.randn((count, ACTIONS), generator=self.generator)}

    def log_probability(self, seen: Seen, action: Tensor) -> tuple[Tensor, Tensor]:
        """Give log pi(a | s), (B,), and its entropy before squashing, (B,)."""
        mean, log_sigma = self.actor(seen)
        x = torch.tan(action.clamp(-0.9999, 0.9999) * (math.pi / 2))
        entropy = (log_sigma + 0.5 * math.log(2 * math.pi * math.e)).sum(-1)
        return log_density(x, mean, log_sigma), entropy

    def study(self, rollout: Rollout) -> Tensor:
        """Give each transition's advantage, value target and old log probability, (n, 3)."""
        batch = rollout.batch(self.device)
        with torch.no_grad():
            seen = self.see(batch.observations)
            value, after = self.critic(seen), self.critic(self.see(batch.next_observations))
            old, _ = self.log_probability(seen, batch.action)
            delta = batch.reward + batch.discount * after - value
        advantage = rollout.accumulate(delta.cpu(), self.settings.trace).to(self.device)
        target = advantage + value
        advantage = (advantage - advantage.mean()) / (advantage.std() + 1e-6)
        return torch.stack([advantage, target, old], dim=1).cpu()

    def descents(self) -> tuple[Descent, ...]:
        """Give the critic's step, and the actor's."""
        return (
            Descent(self.critic_loss, (("critic", "critic_optimizer"),)),
            Descent(self.actor_loss, (("actor", "actor_optimizer"),)),
        )

    def critic_loss(self, lesson: Lesson) -> tuple[Tensor, Metrics]:
        """Give L_V."""
        with self.mixed():
            value = self.critic(lesson.seen)
        loss = huber(lesson.extra[:, 1] - value, 1.0).mean()
        return loss, {"critic_loss": loss}

    def actor_loss(self, lesson: Lesson) -> tuple[Tensor, Metrics]:
        """Give the clipped surrogate with the entropy's share."""
        s, advantage = self.settings, lesson.extra[:, 0]
        with self.mixed():
            new, entropy = self.log_probability(lesson.seen, lesson.action)
        ratio = (new - lesson.extra[:, 2]).exp()
        clipped = ratio.clamp(1.0 - s.clip, 1.0 + s.clip)
        gain = torch.minimum(ratio * advantage, clipped * advantage).mean()
        loss = -gain - s.entropy * entropy.mean()
        outside = ((ratio - 1.0).abs() > s.clip).float().mean()
        return loss, {"actor_value": gain, "entropy": entropy.mean(), "clipped": outside}

    def deployed(self, radius_margin: float) -> Pilot:
        """Give the squashed mean of the averaged actor."""
        return Pilot(self.see, SquashedMean(self.average_actor), radius_margin)
