"""What the training environment can be told; the defaults are the published one (paper, sec. V)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from twinscrew.runtime.errors import ConfigError
from twinscrew.runtime.messages.types import OBSERVED_OBJECTS, Float64
from twinscrew.runtime.policy.vessel_model import VesselParameters
from twinscrew.runtime.settings import Count, Positive, Settings
from twinscrew.training import scenarios
from twinscrew.training.conditions import ConditionSettings
from twinscrew.training.imperfections import ImperfectionSettings
from twinscrew.training.perception_noise import NoiseSettings
from twinscrew.training.reward import RewardSettings
from twinscrew.training.scenarios import MapSettings, ScenarioSettings

RATE_LIMIT = 1000.0
"""[N/s] The rate of change of thrust that an action of 1 asks for (paper, sec. V)."""


class EnvironmentSettings(Settings, frozen=True):
    """The environment; the defaults are the published one (paper, sec. V)."""

    scenarios: tuple[ScenarioSettings, ...] = (ScenarioSettings(),)
    """The mixture: every episode follows one of these rows, drawn by weight."""
    map: MapSettings = MapSettings()
    vessel: VesselParameters = VesselParameters()
    noise: NoiseSettings = NoiseSettings()
    reward: RewardSettings = RewardSettings()
    conditions: ConditionSettings = ConditionSettings()
    imperfections: ImperfectionSettings = ImperfectionSettings()
    park: bool = False
    """Vessels that arrived stay at their goals as obstacles; as published they vanish."""
    period_s: Positive = 0.5
    """[s] Between two decisions; a multiple of the sub-step."""
    substep_s: Positive = 0.05
    """[s] Of the integration."""
    goal_radius_m: Positive = 2.0
    """[m] Nearer than this to its goal, a vessel has arrived."""
    range_m: Positive = 20.0
    """[m] Objects are perceived this far."""
    observed_objects: Count = OBSERVED_OBJECTS
    """[-] K: how many objects a vessel sees at most."""
    decision_limit: Count = 1000
    """[-] An episode is truncated after so many decisions."""

    @property
    def substeps(self) -> int:
        """[-] In one decision."""
        return round(self.period_s / self.substep_s)

    @property
    def shape(self) -> tuple[int, int]:
        """V and M: room for the vessels and buoys of the largest row."""
        return max(s.robots for s in self.scenarios), max(s.buoys for s in self.scenarios)

    @property
    def radius(self) -> Float64:
        """[m] (V + M,) Of the vessels and buoys."""
        vessels, buoys = self.shape
        return np.array([self.vessel.radius] * vessels + [self.map.buoy_radius_m] * buoys)


def check(settings: EnvironmentSettings, episodes: int, seeds: Sequence[int]) -> None:
    """Refuse settings that contradict each other, and a batch that cannot be.

    Raises
    ------
    ConfigError
        Names the key and what is allowed.
    """
    scenarios.check(settings.scenarios, settings.map)
    if episodes < 1:
        raise ConfigError(f"must be at least 1, got {episodes}", key="episodes")
    if not seeds or not all(0 <= seed < 2**63 for seed in seeds):
        got = ", ".join(map(str, seeds)) or "none"
        raise ConfigError(f"must be in [0, 2^63), got {got}", key="seed")
    if abs(settings.substeps * settings.substep_s - settings.period_s) > 1e-9:
        raise ConfigError(
            f"must be a multiple of substep_s {settings.substep_s}, got {settings.period_s}",
            key="period_s",
        )
