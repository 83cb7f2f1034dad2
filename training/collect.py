"""Gathering experience: the environment and exploration together.

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
from twinscrew.runtime.settings import Count, Fraction, NonNegative, Settings
from twinscrew.training.agents import risk_levels
from twinscrew.training.agents.base import Agent
from twinscrew.training.environment import EnvironmentSettings, StepResult, VectorEnv
from twinscrew.training.learner import Learner
from twinscrew.training.networks import unpack
from twinscrew.training.replay import Step
from twinscrew.training.scenarios import Mask


class ExplorationSettings(Settings, frozen=True):
    """How far, and for how long, experience departs from the policy."""

    epsilon_start: Fraction = 0.3
    """[-] Probability of a random action instead of the policy's, at first."""
    epsilon_end: Fraction = 0.02
    """[-] The same, later."""
    epsilon_steps: Count = 2000
    """[environment steps] From the first to the second, linearly."""
    noise: NonNegative = 0.4
    """[-] Standard deviation of the noise on the action of the noisiest vessel; actions are +-1."""
    correlation: Fraction = 0.8
    """[-] Of a vessel's noise from one decision to the next: white noise hardly turns a hull."""
    greedy: Fraction = 0.0
    """[-] Share of the slots that do as the policy says, always: where chance now and then kicks a
    vessel out of a circle around its goal, nobody learns that the circle has no end."""


def epsilon(settings: ExplorationSettings, step: int) -> float:
    """Give the probability of a random action at an environment step."""
    share = min(step / settings.epsilon_steps, 1.0)
    return settings.epsilon_start + share * (settings.epsilon_end - settings.epsilon_start)


class Exploration:
    """What is random in one seed's exploration of M slots.

    First-order Gauss-Markov noise on both thrust rates, another size for each slot, from none to
    the full one, so that the replay always holds the policy's own trajectories beside exploring
    ones. And risk levels, alpha = 1/L, ..., 1, that vessels gather at: each keeps its own to its
    end; with L = 0 there are none, and nothing is drawn.
    """

    def __init__(
        self,
        settings: ExplorationSettings,
        levels: int,
        slots: int,
        generator: np.random.Generator,
    ) -> None:
        self._rho, self._levels, self._generator = settings.correlation, levels, generator
        share = generator.permutation(np.linspace(0.0, 1.0, slots)[:, None])
        self._size = settings.noise * share
        self._greedy = share[:, 0] < settings.greedy
        self._state = generator.standard_normal((slots, 2))
        self.risk: Float32 | None = self._draw(slots) if levels else None
        """(M, 1) in (0, 1]"""

    def noise(self) -> Float32:
        """Give the noise of the next decision, (M, 2)."""
        fresh = self._generator.standard_normal(self._state.shape)
        # Stationary: the variance stays one whatever the correlation.
        self._state = self._rho * self._state + np.sqrt(1.0 - self._rho**2) * fresh
        return (self._size * self._state).astype(np.float32)

    def disturb(self, action: Float32, agent: Agent[Any], noisy: bool, chance: float) -> Float32:
        """Give actions (M, 2) with noise, and now and then random ones instead."""
        if agent.on_policy:
            return action
        if noisy:
            action = np.clip(action + self.noise() * ~self._greedy[:, None], -1.0, 1.0)
        dice = self._generator.random(len(action)) < chance
        if chance < 1.0:  # not while nothing has been learnt
            dice &= ~self._greedy
        if dice.any():
            action[dice] = agent.random(int(dice.sum())).numpy()
        return action

    def renew(self, ended: Mask) -> None:
        """Draw new levels for the slots, (M,), whose vessels have come to their end."""
        if self.risk is not None:
            self.risk = np.where(ended[:, None], self._draw(len(ended)), self.risk)

    def _draw(self, slots: int) -> Float32:
        level = self._generator.integers(1, self._levels + 1, (slots, 1))
        return (level / self._levels).astype(np.float32)


class Collector:
    """Sails every parallel episode of K seeds, calm or rough, one decision at a time.

    Parameters
    ----------
    kinds
        Environments and how many episodes of each a seed has.
    exploration
        How it tries out.
    agents
        One a seed.
    seeds, step
        On which the streams depend: fresh episodes begin at this environment step.
    """

    def __init__(
        self,
        kinds: Sequence[tuple[EnvironmentSettings, int]],
        exploration: ExplorationSettings,
        agents: Sequence[Agent[Any]],
        seeds: Sequence[int],
        step: int,
    ) -> None:
        streams = [np.random.SeedSequence([seed, step]).generate_state(2) for seed in seeds]
        self._exploration, self._seeds = exploration, len(seeds)
        self._environments, first = [], 0
        for settings, count in kinds:
            if count:
                own = [int(one[0]) for one in streams]
                self._environments.append(VectorEnv(settings, count, own, first_slot=first))
            first += count
        self._rows = self._join(env.reset().rows for env in self._environments)
        self.slots = slots = self._rows.shape[1]
        levels = risk_levels(agents[0].settings)
        self._chances = [
            Exploration(exploration, levels, slots, np.random.default_rng(int(one[1])))
            for one in streams
        ]
        self._earned = np.zeros((self._seeds, slots))
        self.ended: list[list[tuple[float, bool]]] = [[] for _ in seeds]
        """Of each seed: the return and the success of vessels that have come to their end."""

    def step(self, learner: Learner, step: int, *, random: bool) -> list[Step]:
        """Make one decision for every vessel; give each seed's, of its M slots."""
        rows, action = self._rows, self._choose(learner, step, random=random)
        results = self._sail(action)
        names = ("reward", "terminated", "truncated", "active", "reached")
        told = {name: self._join_slots(getattr(r, name) for r in results) for name in names}
        after = self._join(result.final_observation.rows for result in results)
        self._rows = self._join(result.observation.rows for result in results)
        ended = told["terminated"] | told["truncated"]
        reached = told.pop("reached")
        self._earned += told["reward"]
        steps = []
        for k, chances in enumerate(self._chances):
            chances.renew(ended[k])
            over = np.flatnonzero(ended[k])
            self.ended[k] += zip(self._earned[k, over].tolist(), reached[k, over], strict=True)
            parts = {name: values[k] for name, values in told.items()}
            steps.append(
                Step(observation=rows[k], action=action[k], next_observation=after[k], **parts)
            )
        self._earned[ended] = 0.0
        return steps

    def _sail(self, action: Float32) -> list[StepResult]:
        """Let every vessel act, (K, M, 2)."""
        widths = [env.episodes // self._seeds * env.vessels for env in self._environments]
        parts = np.split(action, np.cumsum(widths)[:-1], axis=1)
        pairs = zip(self._environments, parts, strict=True)
        return [env.step(part.reshape(env.episodes, env.vessels, 2)) for env, part in pairs]

    def _choose(self, learner: Learner, step: int, *, random: bool) -> Float32:
        """Give actions, (K, M, 2): the agents' with noise, or now and then random ones."""
        first = learner.agents[0]
        seen = unpack(torch.from_numpy(self._rows).to(first.device))
        levels = [chances.risk for chances in self._chances if chances.risk is not None]
        risk = torch.from_numpy(np.stack(levels)).to(first.device) if levels else None
        action = learner.act(seen, risk).cpu().numpy()
        noisy = first.continuous and self._exploration.noise > 0.0
        chance = 1.0 if random else epsilon(self._exploration, step)
        mine = zip(self._chances, action, learner.agents, strict=True)
        return np.stack([one.disturb(row, agent, noisy, chance) for one, row, agent in mine])

    def _join(self, rows: Iterable[Float32]) -> Float32:
        """Join what all vessels of all environments see, (E, V, W), as (K, M, W)."""
        return np.concatenate([r.reshape(self._seeds, -1, r.shape[-1]) for r in rows], axis=1)

    def _join_slots(self, values: Iterable[NDArray[Any]]) -> NDArray[Any]:
        """Join values of all vessels of all environments, (E, V), as (K, M)."""
        return np.concatenate([one.reshape(self._seeds, -1) for one in values], axis=1)
