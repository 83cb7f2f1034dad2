"""Gathering experience: the environment, exploration and n-step transitions together."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from twinscrew.runtime.messages.types import Float32
from twinscrew.training import perception
from twinscrew.training.agents.base import Agent
from twinscrew.training.agents.registry import risk_levels
from twinscrew.training.environment import VectorEnv
from twinscrew.training.exploration import CorrelatedNoise, HeldLevels, epsilon
from twinscrew.training.nstep import NStep, Step
from twinscrew.training.observations import unpack
from twinscrew.training.train_settings import PhaseSettings, TrainSettings


def pack_slots(seen: perception.Observations) -> Float32:
    """Lay out what all vessels of all episodes see as rows, (E V, 37), episode by episode."""
    slots = seen.mask.shape[0] * seen.mask.shape[1]
    parts = [part.reshape(slots, -1) for part in (seen.ego, seen.objects, seen.mask)]
    return np.concatenate(parts, axis=1)


class Collector:
    """Sails every parallel episode, calm or rough, one decision at a time."""

    def __init__(self, settings: TrainSettings, told: PhaseSettings, seed: int, step: int) -> None:
        """Begin at an environment step; the streams depend on it.

        A resumed run does not see the same episodes again.
        """
        streams = np.random.SeedSequence([seed, step]).generate_state(2)
        rough = round(settings.parallel_episodes * settings.rough_share)
        calm = settings.parallel_episodes - rough
        kinds = ((told.calm, calm, 0), (told.rough, rough, calm))
        self.settings = settings
        self._environments = [
            VectorEnv(environment, count, int(streams[0]), first_slot=first)
            for environment, count, first in kinds
            if count
        ]
        self._generator = np.random.default_rng(int(streams[1]))
        self._rows = _rows(environment.reset() for environment in self._environments)
        self._noise = CorrelatedNoise(settings.exploration, len(self._rows), self._generator)
        levels = risk_levels(told.agent)
        self._risk = HeldLevels(levels, len(self._rows), self._generator)
        self._join = NStep(settings.n_steps, settings.discount, len(self._rows))

    def step(self, agent: Agent[Any], step: int, *, random: bool) -> Float32:
        """Make one decision for every vessel; give the transitions now complete, (K, 78)."""
        action = self._choose(agent, step, random=random)
        shapes = [(env.episodes, env.vessels, 2) for env in self._environments]
        ends = np.cumsum([episodes * vessels for episodes, vessels, _ in shapes])[:-1]
        parts = zip(self._environments, np.split(action, ends), shapes, strict=True)
        results = [env.step(part.reshape(shape)) for env, part, shape in parts]
        ended = _slots(result.terminated | result.truncated for result in results)
        transitions = self._join.push(
            Step(
                observation=self._rows,
                action=action,
                reward=_slots(result.reward for result in results),
                terminated=_slots(result.terminated for result in results),
                truncated=_slots(result.truncated for result in results),
                active=_slots(result.active for result in results),
                next_observation=_rows(result.final_observation for result in results),
            )
        )
        self._rows = _rows(result.observation for result in results)
        self._risk.renew(ended)
        return transitions

    def _choose(self, agent: Agent[Any], step: int, *, random: bool) -> Float32:
        """Give actions, (E V, 2): the agent's with noise, or now and then random ones."""
        slots = len(self._rows)
        chance = 1.0 if random else epsilon(self.settings.exploration, step)
        seen = unpack(torch.from_numpy(self._rows).to(agent.device))
        risk = self._risk.levels
        told = None if risk is None else torch.from_numpy(risk).to(agent.device)
        action: Float32 = agent.act(seen, explore=True, risk=told).cpu().numpy()
        if agent.continuous and self.settings.exploration.noise > 0.0:
            action = np.clip(action + self._noise.step(), -1.0, 1.0)
        dice = self._generator.random(slots) < chance
        if dice.any():
            action[dice] = agent.random(int(dice.sum())).numpy()
        return action


def _rows(seen: Iterable[perception.Observations]) -> Float32:
    """Lay out what all vessels of all episodes see as rows, (M, 37)."""
    return np.concatenate([pack_slots(one) for one in seen])


def _slots(values: Iterable[NDArray[Any]]) -> NDArray[Any]:
    """Join values of all vessels of all episodes, (M,)."""
    return np.concatenate([one.reshape(-1) for one in values])
