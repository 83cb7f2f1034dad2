"""How fast the environment is: decisions of vessels on the water, a second, on one core."""

from __future__ import annotations

import time

import numpy as np

from twinscrew.training.drive import steer_at_goal
from twinscrew.training.environment import EnvironmentSettings, VectorEnv
from twinscrew.training.settings_table import six_settings

EPISODES = 64
WARM_UP = 60
"""[-] Decisions before the clock starts: by then the slots are in all phases of an episode."""
ROUND = 60
"""[-] Decisions in a round."""
ROUNDS = 12


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
