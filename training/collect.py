"""Gathering experience: the environment, exploration and n-step transitions together.

K seeds sail side by side in one environment, each with its own streams: what a seed gathers does
not depend on who sails beside it.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from twinscrew.runtime.messages.types import Float32
from twinscrew.training import perception
from twinscrew.training.agents.base import Agent
from twinscrew.training.agents.registry import risk_levels
from twinscrew.training.environment import StepResult, VectorEnv
from twinscrew.training.exploration import CorrelatedNoise, HeldLevels, epsilon
from twinscrew.training.learner import Learner
from twinscrew.training.nstep import NStep, Step
from twinscrew.training.observations import PACKED_COLUMNS, unpack
from twinscrew.training.train_settings import PhaseSettings, TrainSettings


def pack_slots(seen: perception.Observations) -> Float32:
    """Lay out what all vessels of all episodes see as rows, (E V, 37), episode by episode."""
    slots = seen.mask.shape[0] * seen.mask.shape[1]
    parts = [part.reshape(slots, -1) for part in (seen.ego, seen.objects, seen.mask)]
    return np.concatenate(parts, axis=1)


class _Chances:
    """What is random in one seed's exploration of M slots."""

    def __init__(self, settings: TrainSettings, told: PhaseSettings, seed: int, slots: int) -> None:
        self.generator = np.random.default_rng(seed)
        self.noise = CorrelatedNoise(settings.exploration, slots, self.generator)
        self.risk = HeldLevels(risk_levels(told.agent), slots, self.generator)

    def disturb(self, action: Float32, agent: Agent[Any], noisy: bool, chance: float) -> Float32:
        """Give actions (M, 2) with noise, and now and then random ones instead."""
        if noisy:
            action = np.clip(action + self.noise.step(), -1.0, 1.0)
        dice = self.generator.random(len(action)) < chance
        if dice.any():
            action[dice] = agent.random(int(dice.sum())).numpy()
        return action


class Collector:
    """Sails every parallel episode of K seeds, calm or rough, one decision at a time."""

    def __init__(
        self, settings: TrainSettings, told: PhaseSettings, seeds: Sequence[int], step: int
    ) -> None:
        """Begin fresh episodes at an environment step, on which the streams depend."""
        streams = [np.random.SeedSequence([seed, step]).generate_state(2) for seed in seeds]
        rough = round(settings.parallel_episodes * settings.rough_share)
        calm = settings.parallel_episodes - rough
        kinds = ((told.calm, calm, 0), (told.rough, rough, calm))
        self.settings, self._seeds = settings, len(seeds)
        self._environments = [
            VectorEnv(environment, count, [int(one[0]) for one in streams], first_slot=first)
            for environment, count, first in kinds
            if count
        ]
        self._rows = self._join_rows(environment.reset() for environment in self._environments)
        slots = self._rows.shape[1]
        self._chances = [_Chances(settings, told, int(one[1]), slots) for one in streams]
        self._join = NStep(settings.n_steps, settings.discount, self._seeds * slots)

    def step(self, learner: Learner, step: int, *, random: bool) -> list[Float32]:
        """Make one decision for every vessel.

        Returns
        -------
        K of (n, 78)
            Each seed's transitions that are now complete.
        """
        action = self._choose(learner, step, random=random)
        results = self._sail(action)
        ended = self._slots(result.terminated | result.truncated for result in results)
        rows, slots = self._join.push(
            Step(
                observation=_flat(self._rows),
                action=_flat(action),
                reward=_flat(self._slots(result.reward for result in results)),
                terminated=_flat(self._slots(result.terminated for result in results)),
                truncated=_flat(self._slots(result.truncated for result in results)),
                active=_flat(self._slots(result.active for result in results)),
                next_observation=_flat(self._join_rows(one.final_observation for one in results)),
            )
        )
        self._rows = self._join_rows(result.observation for result in results)
        for chances, over in zip(self._chances, ended, strict=True):
            chances.risk.renew(over)
        seed = slots // self._rows.shape[1]
        return [rows[seed == k] for k in range(self._seeds)]

    def _sail(self, action: Float32) -> list[StepResult]:
        """Let every vessel act, (K, M, 2)."""
        shapes = [(env.episodes // self._seeds * env.vessels, env) for env in self._environments]
        ends = np.cumsum([slots for slots, _ in shapes])[:-1]
        parts = zip(self._environments, np.split(action, ends, axis=1), strict=True)
        return [env.step(part.reshape(env.episodes, env.vessels, 2)) for env, part in parts]

    def _choose(self, learner: Learner, step: int, *, random: bool) -> Float32:
        """Give actions, (K, M, 2): the agents' with noise, or now and then random ones."""
        exploration, first = self.settings.exploration, learner.agents[0]
        seen = unpack(torch.from_numpy(self._rows).to(first.device))
        levels = [chances.risk.levels for chances in self._chances]
        told = [level for level in levels if level is not None]
        risk = torch.from_numpy(np.stack(told)).to(first.device) if told else None
        action = learner.act(seen, risk).cpu().numpy()
        noisy = first.continuous and exploration.noise > 0.0
        chance = 1.0 if random else epsilon(exploration, step)
        mine = zip(self._chances, action, learner.agents, strict=True)
        return np.stack([one.disturb(row, agent, noisy, chance) for one, row, agent in mine])

    def _join_rows(self, seen: Iterable[perception.Observations]) -> Float32:
        """Lay out what all vessels see as rows, (K, M, 37)."""
        rows = [pack_slots(one).reshape(self._seeds, -1, PACKED_COLUMNS) for one in seen]
        return np.concatenate(rows, axis=1)

    def _slots(self, values: Iterable[NDArray[Any]]) -> NDArray[Any]:
        """Join values of all vessels of all environments, (E, V), as (K, M)."""
        return np.concatenate([one.reshape(self._seeds, -1) for one in values], axis=1)


def _flat(values: NDArray[Any]) -> NDArray[Any]:
    """Give (K, M, ...) as (K M, ...)."""
    return values.reshape(-1, *values.shape[2:])
