"""The benchmark times real episodes."""

from __future__ import annotations

import numpy as np

from twinscrew.training.bench import steer_at_goal, vessel_steps_per_s
from twinscrew.training.environment import VectorEnv


def test_the_benchmark_gives_its_figures() -> None:
    figures = vessel_steps_per_s(episodes=4, rounds=2)
    assert figures["vessel_steps_per_s_best"] >= figures["vessel_steps_per_s"] > 0


def test_its_driver_brings_vessels_to_their_goals() -> None:
    env = VectorEnv(episodes=8, seed=0)
    seen, arrived = env.reset(), 0
    for _ in range(80):
        result = env.step(steer_at_goal(seen.ego))
        seen = result.observation
        arrived += int(result.reached.sum())
    assert arrived > 8
    assert np.isfinite(seen.ego).all()
