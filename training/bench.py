"""`twinscrew bench --only training`: how fast the environment and the learner are, on one core."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import msgspec
import numpy as np

from twinscrew.runtime.settings import shipped
from twinscrew.training.environment import EnvironmentSettings, VectorEnv, steer_at_goal
from twinscrew.training.scenarios import six_settings

if TYPE_CHECKING:
    from twinscrew.training.settings import TrainSettings

EPISODES = 64
WARM_UP = 60
"""[-] Decisions before the clock starts: by then the slots are in all phases of an episode."""
ROUND = 60
"""[-] Decisions in a round."""
ROUNDS = 12
UPDATES = 50
TOGETHER = 4
"""[-] Seeds of the stacked figure."""
TRIAL_S = 0.5
"""[s] Given to each precision before a training run."""


def run() -> dict[str, Any]:
    """Give the figures under the key "training"."""
    return {"training": {**vessel_steps_per_s(), **update_speed()}}


def vessel_steps_per_s(episodes: int = EPISODES, rounds: int = ROUNDS) -> dict[str, float]:
    """Sail the six settings mixed and time `step` alone.

    Only vessels that are on the water count, and only processor time: what else runs on the
    machine is not the environment's. The median over rounds, and the best.
    """
    env = VectorEnv(EnvironmentSettings(scenarios=six_settings()), episodes, seed=0)
    seen = env.reset()
    rates = []
    for number in range(rounds + 1):
        decisions, seconds = 0, 0.0
        for _ in range(ROUND if number else WARM_UP):
            action = steer_at_goal(seen.ego)
            begin = time.process_time()
            result = env.step(action)
            seconds += time.process_time() - begin
            seen = result.observation
            decisions += int(result.active.sum())
        if number:
            rates.append(decisions / seconds)
    return {
        "vessel_steps_per_s": round(float(np.median(rates))),
        "vessel_steps_per_s_best": round(max(rates)),
    }


def update_speed(config: str = "ac_iqn") -> dict[str, Any]:
    """Time updates on random transitions, one thread.

    Returns
    -------
    update_float32_ms, update_bfloat16_ms
        [ms] Median processor time of one update in each precision, the draw included.
    precision, update_ms
        The faster one, and its time.
    samples_per_s
        [1/s] Transitions learnt from in that time.
    together_ms_per_seed
        [ms] The same of one update of several seeds as one, for each of them.
    """
    import torch

    from twinscrew.training.settings import load_training

    settings = load_training(shipped("training", config))
    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        precision, times = faster_precision(settings, updates=UPDATES)
        update = _updates(_in_precision(settings, precision), TOGETHER)
        together = _median_s(update, UPDATES // TOGETHER)
    finally:
        torch.set_num_threads(threads)
    return {
        "precision": precision,
        "update_ms": times[precision] * 1e3,
        **{f"update_{name}_ms": seconds * 1e3 for name, seconds in times.items()},
        "samples_per_s": settings.batch / times[precision],
        "together_ms_per_seed": together * 1e3 / TOGETHER,
    }


def faster_precision(
    settings: TrainSettings, updates: int | None = None
) -> tuple[str, dict[str, float]]:
    """Try updates in both precisions: so many, or for `TRIAL_S` each.

    Returns
    -------
    precision, times
        The faster one, "float32" if they are equal; [s] an update's median processor time in each.
    """
    times = {
        name: _median_s(_updates(_in_precision(settings, name), 1), updates)
        for name in ("float32", "bfloat16")
    }
    return min(times, key=lambda name: times[name]), times


def _in_precision(settings: TrainSettings, name: str) -> TrainSettings:
    agent = msgspec.structs.replace(settings.agent, precision=name, bfloat16=None)
    return msgspec.structs.replace(settings, agent=agent)


def _updates(settings: TrainSettings, seeds: int) -> Callable[[], object]:
    """Give what makes one update of so many seeds, on random transitions."""
    import torch

    from twinscrew.training.agents import make_agent
    from twinscrew.training.learner import Alone, Learner, Stack
    from twinscrew.training.replay import TRANSITION_COLUMNS, Drawn

    agents = [make_agent(settings.agent, seed) for seed in range(seeds)]
    learner: Learner = Alone(agents[0]) if seeds == 1 else Stack(agents)
    rows = torch.randn(20_000, TRANSITION_COLUMNS, generator=agents[0].generator)
    count = settings.batch
    weight, extra = torch.ones(count), torch.zeros(count, 3)

    def update() -> object:
        places = [torch.randint(len(rows), (count,), generator=a.generator) for a in agents]
        return learner.update([Drawn(rows[p], weight, None, extra) for p in places], 0.0)

    return update


def _median_s(update: Callable[[], object], count: int | None) -> float:
    """Give the median processor time [s] of calls, after a few to warm up."""
    for _ in range(3 if count is None else 10):
        update()
    times: list[float] = []
    end = time.monotonic() + TRIAL_S
    while len(times) < (count or 3) or (count is None and time.monotonic() < end):
        start = time.process_time()
        update()
        times.append(time.process_time() - start)
    return sorted(times)[len(times) // 2]
