"""What AC-IQN, DDPG and SAC share: an actor of continuous actions that is averaged for deployment.

AC-IQN and DDPG differ in their critic alone: one of quantiles, one of a mean.
"""

from __future__ import annotations

import copy
from abc import abstractmethod
from typing import TypeVar

import torch
from torch import Tensor, nn

from twinscrew.runtime.settings import Positive
from twinscrew.training.agents.base import Agent, AgentSettings
from twinscrew.training.agents.lesson import Descent, Draws, Lesson, Metrics
from twinscrew.training.agents.steps import adam, wide
from twinscrew.training.encoders import Seen
from twinscrew.training.networks import ACTIONS, Pilot


class ActorSettings(AgentSettings, frozen=True):
    """What agents with an actor are told."""

    actor_rate: Positive = 3e-4
    """[-] Adam's step for the actor, at the start."""


A = TypeVar("A", bound=ActorSettings)


class ActorAgent(Agent[A]):
    """A learner whose actions are continuous."""

    averages = (("average_actor", "actor"),)

    def random(self, count: int) -> Tensor:
        """Give uniform actions, (count, 2) in [-1, 1]."""
        return 2.0 * torch.rand(count, ACTIONS, generator=self.generator) - 1.0

    def rates(self) -> dict[str, float]:
        """Give the learning rates of critic and actor."""
        s = self.settings
        return {"critic_optimizer": s.learning_rate, "actor_optimizer": s.actor_rate}


class DeterministicAgent(ActorAgent[A]):
    """A learner with one deterministic actor, one critic, and targets of both."""

    targets = (("target_critic", "critic"), ("target_actor", "actor"))

    def furnish(self, actor: nn.Module, critic: nn.Module) -> None:
        """Take the networks, and make their targets and optimisers."""
        s = self.settings
        self.actor, self.critic = actor.to(self.device), critic.to(self.device)
        self.target_actor = copy.deepcopy(self.actor)
        self.target_critic = copy.deepcopy(self.critic)
        self.average_actor = copy.deepcopy(self.actor)
        self.keep(
            actor=self.actor,
            critic=self.critic,
            target_actor=self.target_actor,
            target_critic=self.target_critic,
            average_actor=self.average_actor,
            actor_optimizer=adam(self.actor, s.actor_rate),
            critic_optimizer=adam(self.critic, s.learning_rate),
        )

    def choose(self, seen: Seen, draws: Draws, *, explore: bool) -> Tensor:  # noqa: ARG002
        """Give the actor's actions, (B, 2); exploration is added outside."""
        actor = self.actor if explore else self.average_actor
        with wide(self.settings.bfloat16, self.device.type):
            action: Tensor = actor(seen)
        return action.float()

    def descents(self) -> tuple[Descent, ...]:
        """Give the critic's step, and the actor's."""
        return (
            Descent(self.critic_loss, (("critic", "critic_optimizer"),)),
            Descent(self.actor_loss, (("actor", "actor_optimizer"),)),
        )

    @abstractmethod
    def critic_loss(self, lesson: Lesson) -> tuple[Tensor, Metrics]:
        """Give what the critic goes down."""

    @abstractmethod
    def actor_value(self, lesson: Lesson) -> Tensor:
        """Give what the actor climbs."""

    def actor_loss(self, lesson: Lesson) -> tuple[Tensor, Metrics]:
        """Give minus the actor's value."""
        value = self.actor_value(lesson)
        return -value, {"actor_value": value}

    def deployed(self, radius_margin: float) -> Pilot:
        """Give the averaged actor."""
        return Pilot(self.see, self.average_actor, radius_margin)
