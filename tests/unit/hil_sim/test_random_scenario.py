from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from twinscrew.hil_sim.random_scenario import RandomSettings, draw
from twinscrew.runtime.errors import ConfigError
from twinscrew.runtime.settings import convert

seeds = st.integers(min_value=0, max_value=2**32 - 1)
sets = st.sampled_from([(1, 0), (3, 0), (4, 0), (5, 0), (5, 2), (5, 3), (5, 4), (8, 1)])


def pairwise(points: np.ndarray) -> np.ndarray:
    i, j = np.triu_indices(len(points), k=1)
    return np.linalg.norm(points[i] - points[j], axis=1)


def to_each(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return np.linalg.norm(a[:, None] - b[None], axis=2)


@given(seed=seeds, count=sets)
def test_every_layout_keeps_the_papers_rules(seed: int, count: tuple[int, int]) -> None:
    vessels, buoys = count
    starts, goals, circles = draw(RandomSettings(), vessels, buoys, np.random.default_rng(seed))
    places = starts[:, :2]
    assert starts.shape == (vessels, 3)
    assert goals.shape == (vessels, 2)
    assert circles.shape == (buoys, 3)
    for inside in (places, goals):
        assert ((inside >= 2) & (inside <= 53)).all()
    assert (pairwise(places) >= 10).all()
    assert (pairwise(goals) >= 10).all()
    least = {1: 30, 3: 30, 4: 35}.get(vessels, 40)
    assert (np.linalg.norm(goals - places, axis=1) >= least).all()
    assert (np.abs(starts[:, 2]) <= math.pi).all()
    assert ((circles[:, :2] >= 5) & (circles[:, :2] <= 50)).all()
    assert (circles[:, 2] == 0.75).all()
    assert (to_each(circles[:, :2], np.vstack([places, goals])) >= 10.75).all()
    assert (pairwise(circles[:, :2]) >= 1.5).all()


QUAYS = np.array([[20.0, 0.0, 30.0, 16.0, 1.5, math.pi / 2], [35.0, 40.0, 18.0, 4.0, 1.5, 0.6]])


def outside(places: np.ndarray, quay: np.ndarray, gap: float) -> np.ndarray:
    """Tell which places are further than this from a box, by walking along its sides."""
    ahead, abeam = np.meshgrid(*(np.linspace(-side / 2, side / 2, 60) for side in quay[2:4]))
    cos, sin = math.cos(quay[5]), math.sin(quay[5])
    box = quay[:2] + np.stack([cos * ahead - sin * abeam, sin * ahead + cos * abeam], axis=-1)
    return to_each(places, box.reshape(-1, 2)).min(axis=1) >= gap - 1e-9


@pytest.mark.parametrize("first", [0, 100])
def test_nothing_is_ever_placed_on_a_quay_or_so_near_that_a_hull_touches_it(first: int) -> None:
    for seed in range(first, first + 100):
        rng = np.random.default_rng(seed)
        starts, goals, circles = draw(RandomSettings(), 5, 3, rng, QUAYS)
        for quay in QUAYS:
            assert outside(starts[:, :2], quay, 5.0).all()
            assert outside(goals, quay, 5.0).all()
            assert outside(circles[:, :2], quay, 0.75).all()


@given(seed=seeds)
def test_starts_can_be_kept_off_the_others_goals(seed: int) -> None:
    settings = RandomSettings(start_to_other_goals_m=8.0)
    starts, goals, _ = draw(settings, 5, 0, np.random.default_rng(seed))
    assert (to_each(starts[:, :2], goals) >= 8.0).all()


def test_as_published_a_start_may_lie_on_anothers_goal() -> None:
    nearest = []
    for seed in range(200):
        starts, goals, _ = draw(RandomSettings(), 5, 0, np.random.default_rng(seed))
        nearest.append(to_each(starts[:, :2], goals).min())
    assert min(nearest) < 2.0


def test_headings_point_everywhere_alike() -> None:
    rng = np.random.default_rng(0)
    headings = np.concatenate([draw(RandomSettings(), 5, 0, rng)[0][:, 2] for _ in range(400)])
    quarters, _ = np.histogram(headings, bins=4, range=(-math.pi, math.pi))
    assert (np.abs(quarters - 500) < 5 * math.sqrt(500 * 0.75)).all()  # five standard deviations


def test_too_many_vessels_are_refused_with_words_that_help() -> None:
    with pytest.raises(ConfigError, match=r"no place found for 40 vessels .* ask for fewer"):
        draw(RandomSettings(), 40, 0, np.random.default_rng(0))


def test_a_distance_longer_than_the_map_is_refused() -> None:
    settings = RandomSettings(min_distance_m=(80.0,))
    with pytest.raises(ConfigError, match="80 m from start to goal"):
        draw(settings, 1, 0, np.random.default_rng(0))


def test_an_area_without_extent_is_refused() -> None:
    with pytest.raises(ConfigError, match=r"from low to high, not from 53\.0 to 2\.0"):
        convert({"vessel_area_m": [53.0, 2.0]}, RandomSettings)
