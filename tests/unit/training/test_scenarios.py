"""Scenarios keep the distances that they promise, and cover the map."""

from __future__ import annotations

import numpy as np
import pytest

from twinscrew.runtime.errors import ConfigError
from twinscrew.runtime.settings import convert
from twinscrew.training.episodes import episode_stream
from twinscrew.training.scenarios import (
    MapSettings,
    Scenarios,
    ScenarioSettings,
    published_distance_m,
    sample,
    six_settings,
)


def draw(number: int, area: MapSettings, row: ScenarioSettings, seed: int = 0) -> Scenarios:
    generators = [episode_stream(seed, 0, k) for k in range(number)]
    shape = (row.robots, row.buoys)
    return sample([row], np.zeros(number, np.intp), area, generators, shape)


def gaps(points: np.ndarray) -> np.ndarray:
    apart = np.abs(points[:, :, None] - points[:, None, :])
    i, j = np.triu_indices(points.shape[1], 1)
    return apart[:, i, j]


def test_the_hardest_of_the_six_settings_keeps_every_distance() -> None:
    row = six_settings()[-1]
    s = draw(200, MapSettings(), row)
    assert (np.abs(s.start - s.goal) >= 40.0).all()
    assert (gaps(s.start) >= 10.0).all()
    assert (gaps(s.goal) >= 10.0).all()
    assert (gaps(s.buoy) >= 2.0).all()
    for ends in (s.start, s.goal):
        assert (np.abs(s.buoy[:, :, None] - ends[:, None, :]) >= 11.0).all()
        assert ((ends.real >= 2) & (ends.real <= 53) & (ends.imag >= 2) & (ends.imag <= 53)).all()
    assert ((s.buoy.real >= 5) & (s.buoy.real <= 50)).all()


def test_a_start_may_lie_on_a_goal_only_if_that_is_allowed() -> None:
    row = ScenarioSettings(robots=5, min_distance_m=40.0)

    def nearest(area: MapSettings) -> float:
        s = draw(100, area, row)
        apart = np.abs(s.start[:, :, None] - s.goal[:, None, :])
        return float(apart.min())

    assert nearest(MapSettings()) < 5.0
    assert nearest(MapSettings(goals_on_starts=False)) >= 10.0


def test_a_single_vessel_starts_anywhere_and_heads_anywhere() -> None:
    s = draw(4000, MapSettings(), ScenarioSettings(robots=1, min_distance_m=0.0))
    assert abs(s.start.real.mean() - 27.5) < 1.0
    assert abs(s.start.imag.std() - 51 / np.sqrt(12)) < 0.5
    assert abs(np.exp(1j * s.heading).mean()) < 0.05


def test_an_episode_does_not_depend_on_those_drawn_with_it() -> None:
    row = six_settings()[-1]
    together, fewer = draw(30, MapSettings(), row), draw(7, MapSettings(), row)
    for all_, first in zip(together[:-1], fewer[:-1], strict=True):
        assert np.array_equal(all_[:7], first)
    assert together.strangers is None


def test_more_buoys_than_could_ever_be_placed_are_refused_at_once() -> None:
    with pytest.raises(ConfigError, match=r"buoys: .*<= 50, got 1000000"):
        convert({"buoys": 1_000_000}, ScenarioSettings)


def test_the_published_distance_grows_with_the_number_of_vessels() -> None:
    assert [published_distance_m(n) for n in (1, 3, 4, 5, 8)] == [30, 30, 35, 40, 40]
