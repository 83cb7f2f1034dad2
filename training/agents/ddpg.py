"""DDPG: deterministic policy gradient, scalar critic (Lillicrap et al. 2016; paper, eq. 6)."""

from __future__ import annotations

import copy

import torch
from torch import Tensor, nn

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
from twinscrew.training.networks import ACTIONS, Actor, NetworkSettings, Pilot, Seen, make_encoder


class DdpgSettings(ActorSettings, frozen=True, tag_field="algorithm", tag="ddpg"):
    """DDPG."""


class ActionCritic(nn.Module):
    """The value of a continuous action: state -> 128 (.) action -> 128 -> 1."""

    def __init__(self, settings: NetworkSettings) -> None:
        super().__init__()
        self.encoder = make_encoder(settings)
        hidden = settings.hidden_width
        self.hidden1 = nn.Linear(self.encoder.width, hidden)
        self.action = nn.Linear(ACTIONS, hidden)
        self.hidden2 = nn.Linear(hidden, hidden)
        self.output = nn.Linear(hidden, 1)

    def forward(self, seen: Seen, action: Tensor) -> Tensor:
        """Give values (B,)."""
        hidden = torch.relu(self.hidden1(self.encoder(seen)))
        hidden = torch.relu(self.hidden2(hidden * torch.relu(self.action(action))))
        value: Tensor = self.output(hidden)
        return value.squeeze(-1)


class Ddpg(ActorAgent[DdpgSettings]):
    """The learner."""

    targets = (("target_critic", "critic"), ("target_actor", "actor"))

    def __init__(self, settings: DdpgSettings, seed: int, device: str = "cpu") -> None:
        super().__init__(settings, seed, device)
        self.actor = Actor(settings.network).to(self.device)
        self.critic = ActionCritic(settings.network).to(self.device)
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

    def choose(self, seen: Seen, draws: Draws, *, explore: bool) -> Tensor:  # noqa: ARG002
        """Give the actor's actions, (B, 2); exploration is added outside."""
        with self.mixed():
            action: Tensor = (self.actor if explore else self.average_actor)(seen)
        return action.float()

    def descents(self) -> tuple[Descent, ...]:
        """Give the critic's step, and the actor's."""
        return (
            Descent(self.critic_loss, (("critic", "critic_optimizer"),)),
            Descent(self.actor_loss, (("actor", "actor_optimizer"),)),
        )

    def critic_loss(self, lesson: Lesson) -> tuple[Tensor, Metrics]:
        """Give the mean Huber loss of Q(s, a) against r + gamma Q'(s', pi'(s'))."""
        with torch.no_grad(), self.mixed():
            after = self.target_critic(lesson.following, self.target_actor(lesson.following))
        target = td_target(lesson.reward, lesson.discount, after.float()[:, None]).squeeze(1)
        with self.mixed():
            value = self.critic(lesson.seen, lesson.action)
        loss = huber(target - value.float(), 1.0).mean()
        return loss, {"critic_loss": loss}

    def actor_loss(self, lesson: Lesson) -> tuple[Tensor, Metrics]:
        """Give minus the mean of Q(s, pi(s))."""
        with self.mixed():
            value = self.critic(lesson.seen, self.actor(lesson.seen))
        mean = value.float().mean()
        return -mean, {"actor_value": mean}

    def deployed(self, radius_margin: float) -> Pilot:
        """Give the averaged actor."""
        return Pilot(self.see, self.average_actor, radius_margin)
