"""How fast the shipped agent learns on one thread, alone and several seeds as one."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import TYPE_CHECKING

import torch

from twinscrew.runtime.settings import shipped

if TYPE_CHECKING:
    from twinscrew.training.train_settings import TrainSettings

WARM_UP, UPDATES = 10, 50
TOGETHER = 4
"""[-] Seeds of the stacked figure."""


def update_speed(config: str = "ac_iqn") -> dict[str, float]:
    """Time updates on random transitions.

    Returns
    -------
    update_ms
        [ms] Median processor time of one update, the draw from the replay included.
    samples_per_s
        [1/s] Transitions learnt from in that time.
    together_ms_per_seed
        [ms] The same of one update of several seeds as one, for each of them.
    """
    from twinscrew.training.train_settings import load_training

    settings = load_training(shipped("training", config))
    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        alone = _median_s(_updates(settings, 1), UPDATES)
        together = _median_s(_updates(settings, TOGETHER), UPDATES // TOGETHER)
    finally:
        torch.set_num_threads(threads)
    return {
        "update_ms": alone * 1e3,
        "samples_per_s": settings.batch / alone,
        "together_ms_per_seed": together * 1e3 / TOGETHER,
    }


def _updates(settings: TrainSettings, seeds: int) -> Callable[[], object]:
    """Give what makes one update of so many seeds, each with its own replay."""
    from twinscrew.training.agents.registry import make_agent
    from twinscrew.training.buffer import TRANSITION_COLUMNS
    from twinscrew.training.learner import Alone, Learner
    from twinscrew.training.stack import Stack
    from twinscrew.training.train import make_replay

    agents = [make_agent(settings.agent, seed, "cpu") for seed in range(seeds)]
    learner: Learner = Alone(agents[0]) if seeds == 1 else Stack(agents)
    replay = make_replay(settings)
    replay.add(torch.randn(100_000, TRANSITION_COLUMNS, generator=agents[0].generator))
    return lambda: learner.update(
        [replay.sample(settings.batch, agent.generator) for agent in agents], 0.0
    )


def _median_s(update: Callable[[], object], count: int) -> float:
    """Give the median processor time [s] of `count` calls, after some to warm up."""
    times = []
    for _ in range(WARM_UP + count):
        start = time.process_time()
        update()
        times.append(time.process_time() - start)
    return sorted(times[WARM_UP:])[count // 2]
