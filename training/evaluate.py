"""How often a policy brings every vessel to its goal, and how fast (paper, sec. VI).

Greedy, in the training environment, many episodes at once. An episode fails if anything is touched
or any vessel is under way for more than 90 s. Episode k of a seed is the same for every policy, in
any batch.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any, NamedTuple

import msgspec
import numpy as np
from numpy.typing import NDArray

from twinscrew.runtime.errors import ConfigError
from twinscrew.runtime.messages.types import Float64
from twinscrew.training.batch_policy import BatchPolicy
from twinscrew.training.environment import RATE_LIMIT, EnvironmentSettings, VectorEnv
from twinscrew.training.scenarios import ScenarioSettings

Mask = NDArray[np.bool_]

TIME_LIMIT_S = 90.0
"""[s] Longer than this under way, and the episode has failed (paper, sec. VI)."""
BATCH = 500
"""[-] Episodes at once; the results do not depend on it."""
Z95 = 1.959963984540054
"""[-] The 97.5 % quantile of the normal distribution."""


@dataclass(frozen=True, slots=True)
class Evaluation:
    """A policy's score in one setting; episodes = successes + collisions + timeouts."""

    episodes: int
    success_rate: float
    """[-] Share of the episodes in which every vessel arrived in time and nothing was touched."""
    wilson95: tuple[float, float]
    """[-] Wilson's 95 % confidence interval of the success rate."""
    travel_time_s: float | None
    """[s] Mean over the vessels that reached their goals; None if none did."""
    collisions: int
    """[-] Episodes in which anything was touched."""
    timeouts: int
    """[-] Other episodes in which a vessel took over 90 s."""
    seed: int
    cumulative_reward: float
    """[-] Mean over the vessels of the sum of their rewards, undiscounted."""

    def record(self) -> dict[str, Any]:
        """Give it as plain values, for JSON."""
        return {name: getattr(self, name) for name in self.__slots__}


def evaluate(
    policy: BatchPolicy,
    scenario: ScenarioSettings,
    episodes: int = 1000,
    seed: int = 0,
    *,
    environment: EnvironmentSettings | None = None,
    batch: int = BATCH,
    progress: Callable[[int], None] | None = None,
) -> Evaluation:
    """Sail fresh episodes of one scenario with one policy on every vessel.

    Parameters
    ----------
    policy
        Decides for all; its decision period is the environment's.
    scenario
        Vessels, buoys and least distance.
    episodes, seed
        How many, and of which stream.
    environment
        The conditions; the published ones by default. Its mixture is replaced by `scenario`.
    batch
        Episodes at once.
    progress
        Told the number of episodes that just ended.

    Raises
    ------
    ConfigError
        The scenario cannot be placed, or the policy's period does not fit the sub-steps.
    PolicyError
        The policy answered nonsense.
    """
    if episodes < 1:
        raise ConfigError(f"must be at least 1, got {episodes}", key="episodes")
    settings = msgspec.structs.replace(
        environment or EnvironmentSettings(), scenarios=(scenario,), period_s=policy.period_s
    )
    outcomes = []
    for first in range(0, episodes, batch):
        count = min(batch, episodes - first)
        env = VectorEnv(settings, count, seed, first_slot=first, auto_reset=False)
        outcomes.append(sail(env, policy))
        if progress is not None:
            progress(count)
    return score(Outcomes(*map(np.concatenate, zip(*outcomes, strict=True))), seed)


def evaluate_all(
    policy: BatchPolicy,
    rows: Iterable[ScenarioSettings],
    episodes: int,
    seed: int,
    *,
    environment: EnvironmentSettings | None = None,
    progress: Callable[[int], None] | None = None,
) -> tuple[Evaluation, ...]:
    """Give a policy's score in each of several scenarios; the arguments are those of `evaluate`."""
    return tuple(
        evaluate(policy, row, episodes, seed, environment=environment, progress=progress)
        for row in rows
    )


class Outcomes(NamedTuple):
    """How E episodes ended, with n vessels in all."""

    collided: Mask
    """(E,) Whether anything was touched."""
    late: Mask
    """(E,) Whether a vessel was still under way after the time limit."""
    times: Float64
    """(m,) [s] Travel times of the vessels that reached their goals."""
    rewards: Float64
    """(n,) [-] The sum of each vessel's rewards."""


def sail(env: VectorEnv, policy: BatchPolicy) -> Outcomes:
    """Sail one episode in every slot to its end."""
    seen, active = env.reset(), env.active
    sailed = active
    rewards = np.zeros(active.shape)
    policy.begin(*active.shape)
    collided = np.zeros(env.episodes, bool)
    times = [np.zeros(0)]
    for _ in range(int(TIME_LIMIT_S / env.settings.period_s + 1e-9)):
        result = env.step(policy.rates(seen, active) / RATE_LIMIT)
        collided |= result.collided.any(axis=1)
        rewards += result.reward
        times.append(np.repeat(result.elapsed_s, result.reached.sum(axis=1)))
        seen, active = result.observation, env.active
        if not active.any():
            break
    late = np.asarray(active.any(axis=1))
    return Outcomes(collided, late, np.concatenate(times), rewards[sailed])


def score(outcomes: Outcomes, seed: int) -> Evaluation:
    """Count what `sail` saw."""
    collided, late, times, rewards = outcomes
    episodes = len(collided)
    successes = int((~(collided | late)).sum())
    return Evaluation(
        episodes=episodes,
        success_rate=successes / episodes,
        wilson95=wilson95(successes, episodes),
        travel_time_s=float(times.mean()) if len(times) else None,
        collisions=int(collided.sum()),
        timeouts=int((late & ~collided).sum()),
        seed=seed,
        cumulative_reward=float(rewards.mean()),
    )


def wilson95(successes: int, trials: int) -> tuple[float, float]:
    """Give Wilson's score interval of a proportion at 95 % confidence.

    Source: Wilson (1927), Probable inference, the law of succession, and statistical inference.
    """
    share, z2 = successes / trials, Z95**2
    centre = (share + z2 / (2 * trials)) / (1 + z2 / trials)
    half = Z95 / (1 + z2 / trials) * (share * (1 - share) / trials + z2 / (4 * trials**2)) ** 0.5
    return max(0.0, centre - half), min(1.0, centre + half)
