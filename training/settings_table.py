"""The paper's six settings, read from config/experiments/settings.toml."""

from __future__ import annotations

from functools import lru_cache

from twinscrew.runtime.settings import Settings, load, shipped
from twinscrew.training.scenarios import ScenarioSettings


class _Table(Settings, frozen=True):
    scenarios: tuple[ScenarioSettings, ...]


@lru_cache(maxsize=1)
def six_settings() -> tuple[ScenarioSettings, ...]:
    """Give the rows of the paper's table I."""
    return load(shipped("experiments", "settings"), _Table).scenarios


def published_distance_m(robots: int) -> float:
    """Give the least distance [m] from start to goal that the paper uses with so many vessels."""
    rows = sorted(six_settings(), key=lambda row: row.robots)
    enough = (row.min_distance_m for row in rows if row.robots >= robots)
    return next(enough, rows[-1].min_distance_m)
