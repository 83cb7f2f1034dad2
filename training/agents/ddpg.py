"""DDPG: deterministic policy gradient with a scalar critic (Lillicrap et al. 2016)."""

from __future__ import annotations

import copy

import torch
from torch import Tensor

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
from twinscrew.training.networks import ACTIONS, Actor, Pilot
from twinscrew.training.networks_value import ActionCritic


class DdpgSettings(AgentSettings, frozen=True, tag_field="algorithm", tag="ddpg"):
    """DDPG."""

    actor_rate: Positive = 3e-4
    """[-] Adam's step for the actor, at the start."""


class Ddpg(Agent[DdpgSettings]):
    """The learner."""

    def __init__(self, settings: DdpgSettings, seed: int, device: str = "cpu") -> None:
        super().__init__(settings, seed, device)
        self.actor = Actor(settings.network).to(self.device)
        self.critic = ActionCritic(settings.network).to(self.device)
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
        """Take one step of critic and actor."""
        s = self.settings
        anneal(self.critic_optimizer, s.learning_rate, s.final_rate, progress)
        anneal(self.actor_optimizer, s.actor_rate, s.final_rate, progress)
        seen, following = self.see(batch.observations), self.see(batch.next_observations)
        critic_loss = self.critic_loss(batch, seen, following)
        descend(self.critic_optimizer, critic_loss, self.critic.parameters(), s.gradient_norm)
        self.critic.requires_grad_(False)
        with wide(s.bfloat16, self.device.type):
            value = self.critic(seen, self.actor(seen)).float().mean()
        descend(self.actor_optimizer, -value, self.actor.parameters(), s.gradient_norm)
        self.critic.requires_grad_(True)
        self.updates += 1
        if self.updates % s.target_every == 0:
            blend(self.target_critic, self.critic, s.target_rate)
            blend(self.target_actor, self.actor, s.target_rate)
        blend(self.average_actor, self.actor, s.average_rate)
        return {"critic_loss": critic_loss.detach(), "actor_value": value.detach()}

    def critic_loss(self, batch: Batch, seen: Seen, following: Seen) -> Tensor:
        """Give the mean Huber loss of Q(s, a) against r + gamma Q'(s', pi'(s'))."""
        with torch.no_grad(), wide(self.settings.bfloat16, self.device.type):
            after = self.target_critic(following, self.target_actor(following))
        goal = td_target(batch.reward, batch.discount, after.float()[:, None]).squeeze(1)
        with wide(self.settings.bfloat16, self.device.type):
            value = self.critic(seen, batch.action)
        return huber(goal - value.float(), 1.0).mean()

    def deployed(self, radius_margin: float) -> Pilot:
        """Give the averaged actor."""
        return Pilot(self.see, self.average_actor, radius_margin)
