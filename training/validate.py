"""How good a policy is on the paper's six settings, while it learns."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple, TypeAlias

import numpy as np
import torch
from torch import Tensor

from twinscrew.training.collect import pack_slots
from twinscrew.training.environment import EnvironmentSettings, VectorEnv
from twinscrew.training.observations import Observations, unpack
from twinscrew.training.scenarios import ScenarioSettings

Decide: TypeAlias = Callable[[Observations], Tensor]
"""A policy in batches: observations to actions (B, 2) in [-1, 1]."""

SETTINGS = ((3, 0, 30.0), (4, 0, 35.0), (5, 0, 40.0), (5, 2, 40.0), (5, 3, 40.0), (5, 4, 40.0))
"""Robots, buoys, least distance from start to goal [m]: the paper's six (table I)."""
TIME_LIMIT_S = 90.0
"""[s] An episode fails if a vessel is under way longer (paper, sec. VI)."""
SECONDS_WORTH = 0.001
"""[1/s] What a second of mean travel time counts against the mean success rate in selection."""


class Score(NamedTuple):
    """A policy on the six settings."""

    rates: tuple[float, ...]
    """[-] Success rate in each."""
    times_s: tuple[float, ...]
    """[s] Mean travel time in each, of vessels that reached their goals."""

    @property
    def success(self) -> float:
        """[-] Mean over the settings."""
        return float(np.mean(self.rates))

    @property
    def travel_time_s(self) -> float:
        """[s] Mean over the settings."""
        return float(np.mean(self.times_s))

    @property
    def value(self) -> float:
        """What selection maximises: success, and a little, speed."""
        return self.success - SECONDS_WORTH * self.travel_time_s

    def record(self) -> dict[str, Any]:
        """Give it as plain values."""
        return {
            "success": round(self.success, 5),
            "travel_time_s": round(self.travel_time_s, 3),
            "rates": [round(rate, 5) for rate in self.rates],
            "times_s": [round(time, 3) for time in self.times_s],
        }


def validate(policy: Decide, episodes: int, seed: int) -> Score:
    """Sail `episodes` in each setting, greedily, in the environment as published."""
    pairs = [_setting(policy, row, episodes, seed) for row in SETTINGS]
    return Score(tuple(rate for rate, _ in pairs), tuple(time for _, time in pairs))


def _setting(
    policy: Decide, row: tuple[int, int, float], episodes: int, seed: int
) -> tuple[float, float]:
    robots, buoys, distance = row
    scenario = ScenarioSettings(robots=robots, buoys=buoys, min_distance_m=distance)
    settings = EnvironmentSettings(scenarios=(scenario,))
    environment = VectorEnv(settings, episodes, seed, auto_reset=False)
    seen = environment.reset()
    failed = np.zeros(episodes, bool)
    times: list[float] = []
    for _ in range(round(TIME_LIMIT_S / settings.period_s)):
        with torch.no_grad():
            action = policy(unpack(torch.from_numpy(pack_slots(seen)))).numpy()
        result = environment.step(action.reshape(episodes, robots, 2))
        seen = result.observation
        failed |= result.collided.any(axis=1)
        times.extend(np.repeat(result.elapsed_s, result.reached.sum(axis=1)).tolist())
        if not environment.active.any():
            break
    failed |= environment.active.any(axis=1)
    return 1.0 - float(failed.mean()), float(np.mean(times)) if times else TIME_LIMIT_S
