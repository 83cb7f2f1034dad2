"""DDPG: deterministic policy gradient with a scalar critic (Lillicrap et al. 2016)."""

from __future__ import annotations

import torch
from torch import Tensor

from twinscrew.training.agents.actor_critic import ActorSettings, DeterministicAgent
from twinscrew.training.agents.lesson import Lesson, Metrics
from twinscrew.training.agents.steps import wide
from twinscrew.training.losses import huber, td_target
from twinscrew.training.networks import Actor
from twinscrew.training.networks_value import ActionCritic


class DdpgSettings(ActorSettings, frozen=True, tag_field="algorithm", tag="ddpg"):
    """DDPG."""


class Ddpg(DeterministicAgent[DdpgSettings]):
    """The learner."""

    def __init__(self, settings: DdpgSettings, seed: int, device: str = "cpu") -> None:
        super().__init__(settings, seed, device)
        actor = Actor(settings.network)
        self.furnish(actor, ActionCritic(settings.network))

    def critic_loss(self, lesson: Lesson) -> tuple[Tensor, Metrics]:
        """Give the mean Huber loss of Q(s, a) against r + gamma Q'(s', pi'(s'))."""
        with torch.no_grad(), wide(self.settings.bfloat16, self.device.type):
            after = self.target_critic(lesson.following, self.target_actor(lesson.following))
        target = td_target(lesson.reward, lesson.discount, after.float()[:, None]).squeeze(1)
        with wide(self.settings.bfloat16, self.device.type):
            value = self.critic(lesson.seen, lesson.action)
        loss = huber(target - value.float(), 1.0).mean()
        return loss, {"critic_loss": loss}

    def actor_value(self, lesson: Lesson) -> Tensor:
        """Give the mean of Q(s, pi(s))."""
        with wide(self.settings.bfloat16, self.device.type):
            value = self.critic(lesson.seen, self.actor(lesson.seen))
        mean: Tensor = value.float().mean()
        return mean
