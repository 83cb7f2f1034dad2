"""Gathering experience: the environment, exploration and n-step transitions together."""

from __future__ import annotations

from typing import Any

import numpy as np
import torch

from twinscrew.runtime.messages.types import Float32
from twinscrew.training import perception
from twinscrew.training.agents.base import Agent
from twinscrew.training.environment import EnvironmentSettings, VectorEnv
from twinscrew.training.exploration import CorrelatedNoise, epsilon
from twinscrew.training.nstep import NStep, Step
from twinscrew.training.observations import unpack
from twinscrew.training.train_settings import TrainSettings


def pack_slots(seen: perception.Observations) -> Float32:
    """Lay out what all vessels of all episodes see as rows, (E V, 37), episode by episode."""
    slots = seen.mask.shape[0] * seen.mask.shape[1]
    parts = [part.reshape(slots, -1) for part in (seen.ego, seen.objects, seen.mask)]
    return np.concatenate(parts, axis=1)


class Collector:
    """Sails every parallel episode, one decision at a time."""

    def __init__(
        self, settings: TrainSettings, environment: EnvironmentSettings, seed: int, step: int
    ) -> None:
        """Begin at an environment step; the streams depend on it.

        A resumed run does not see the same episodes again.
        """
        streams = np.random.SeedSequence([seed, step]).generate_state(2)
        self.settings = settings
        self.environment = VectorEnv(environment, settings.parallel_episodes, int(streams[0]))
        self._generator = np.random.default_rng(int(streams[1]))
        first = self.environment.reset()
        self._shape = first.mask.shape[:2]
        self._rows = pack_slots(first)
        slots = len(self._rows)
        self._noise = CorrelatedNoise(settings.exploration, slots, self._generator)
        self._join = NStep(settings.n_steps, settings.discount, slots)

    def step(self, agent: Agent[Any], step: int, *, random: bool) -> Float32:
        """Make one decision for every vessel; give the transitions now complete, (K, 78)."""
        action = self._choose(agent, step, random=random)
        result = self.environment.step(action.reshape(*self._shape, 2))
        slots = len(self._rows)
        transitions = self._join.push(
            Step(
                observation=self._rows,
                action=action,
                reward=result.reward.reshape(slots),
                terminated=result.terminated.reshape(slots),
                truncated=result.truncated.reshape(slots),
                active=result.active.reshape(slots),
                next_observation=pack_slots(result.final_observation),
            )
        )
        self._rows = pack_slots(result.observation)
        return transitions

    def _choose(self, agent: Agent[Any], step: int, *, random: bool) -> Float32:
        """Give actions, (E V, 2): the agent's with noise, or now and then random ones."""
        slots = len(self._rows)
        chance = 1.0 if random else epsilon(self.settings.exploration, step)
        action: Float32 = agent.act(unpack(torch.from_numpy(self._rows)), explore=True).numpy()
        if self.settings.exploration.noise > 0.0:
            action = np.clip(action + self._noise.step(), -1.0, 1.0)
        dice = self._generator.random(slots) < chance
        if dice.any():
            action[dice] = agent.random(int(dice.sum())).numpy()
        return action
