"""How good a network is on the paper's six settings, while it learns and when it is exported."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import torch
from torch import nn

from twinscrew.runtime.messages.types import Float64
from twinscrew.training.batch_policy import BatchPolicy, Mask
from twinscrew.training.environment import RATE_LIMIT, EnvironmentSettings
from twinscrew.training.evaluate import TIME_LIMIT_S, Evaluation, evaluate_all
from twinscrew.training.observations import Observations
from twinscrew.training.perception import Observations as Seen
from twinscrew.training.settings_table import six_settings

SECONDS_WORTH = 0.001
"""[1/s] What a second of mean travel time counts against the mean success rate in selection."""


class NetworkPolicy:
    """A network (observations to actions) as what `evaluate` asks for thrust rates."""

    name = "network"

    def __init__(self, network: nn.Module, period_s: float) -> None:
        self._network = network
        self._device = next(network.parameters()).device
        self.period_s = period_s

    def begin(self, episodes: int, vessels: int) -> None:
        """Do nothing: a network remembers nothing."""

    def rates(self, seen: Seen, active: Mask) -> Float64:
        """Give thrust rates, (E, V, 2) [N/s]."""
        parts = [torch.from_numpy(part[active]).to(self._device) for part in seen]
        with torch.no_grad():
            action = self._network(Observations(*parts))
        rates = np.zeros((*active.shape, 2))
        rates[active] = action.cpu().numpy() * RATE_LIMIT
        return rates


class Score(NamedTuple):
    """A policy on the six settings."""

    settings: tuple[Evaluation, ...]
    """As published."""
    rough: tuple[Evaluation, ...] = ()
    """In rough conditions, where the run trains in them."""

    @property
    def success(self) -> float:
        """[-] Mean success rate as published."""
        return _success(self.settings)

    @property
    def travel_time_s(self) -> float:
        """[s] Mean travel time as published; where no vessel arrived, the time limit counts."""
        times = [one.travel_time_s for one in self.settings]
        return float(np.mean([TIME_LIMIT_S if time is None else time for time in times]))

    @property
    def cumulative_reward(self) -> float:
        """[-] Mean over the settings of a vessel's summed rewards, as published."""
        return float(np.mean([one.cumulative_reward for one in self.settings]))

    @property
    def value(self) -> float:
        """What selection maximises: success in both conditions, and a little, speed."""
        kinds = [_success(kind) for kind in (self.settings, self.rough) if kind]
        return float(np.mean(kinds)) - SECONDS_WORTH * self.travel_time_s

    def record(self) -> dict[str, Any]:
        """Give it as plain values."""
        record: dict[str, Any] = {
            "success": round(self.success, 5),
            "travel_time_s": round(self.travel_time_s, 3),
            "cumulative_reward": round(self.cumulative_reward, 4),
            "rates": [round(one.success_rate, 5) for one in self.settings],
            "times_s": [one.travel_time_s for one in self.settings],
        }
        if self.rough:
            record["rough_success"] = round(_success(self.rough), 5)
            record["rough_rates"] = [round(one.success_rate, 5) for one in self.rough]
        return record


def validate(
    policy: BatchPolicy, episodes: int, seed: int, rough: EnvironmentSettings | None = None
) -> Score:
    """Sail `episodes` in each of the six settings, greedily, and as many in rough conditions."""
    rows = six_settings()
    published = evaluate_all(policy, rows, episodes, seed)
    if rough is None:
        return Score(published)
    return Score(published, evaluate_all(policy, rows, episodes, seed, environment=rough))


def _success(kind: tuple[Evaluation, ...]) -> float:
    return float(np.mean([one.success_rate for one in kind]))
