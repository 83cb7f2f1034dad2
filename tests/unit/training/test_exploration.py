import numpy as np
import pytest
import torch

from twinscrew.training.collect import Exploration, ExplorationSettings, epsilon

SETTINGS = ExplorationSettings(noise=0.5, correlation=0.9)


def draw(steps=20_000, slots=3, seed=0):
    made = Exploration(SETTINGS, 0, slots, np.random.default_rng(seed))
    return np.stack([made.noise() for _ in range(steps)])


def test_sizes_go_from_none_to_the_full_one():
    spread = np.sort(draw().std(axis=(0, 2)))
    assert spread == pytest.approx([0.0, 0.25, 0.5], rel=0.1)


def test_neighbouring_decisions_share_the_stated_correlation():
    series = draw()
    loudest = series[:, series.std(axis=(0, 2)).argmax(), 0]
    assert np.corrcoef(loudest[1:], loudest[:-1])[0, 1] == pytest.approx(0.9, abs=0.02)


def test_both_thrusters_have_noise_of_their_own():
    series = draw()
    loudest = series[:, series.std(axis=(0, 2)).argmax()]
    assert abs(np.corrcoef(loudest.T)[0, 1]) < 0.15


def test_the_same_generator_gives_the_same_noise():
    assert np.array_equal(draw(10, seed=4), draw(10, seed=4))
    assert not np.array_equal(draw(10, seed=4), draw(10, seed=5))


def test_epsilon_falls_linearly_and_stays():
    settings = ExplorationSettings(epsilon_start=0.6, epsilon_end=0.1, epsilon_steps=100)
    falls = [epsilon(settings, step) for step in (0, 50, 100, 1000)]
    assert falls == pytest.approx([0.6, 0.35, 0.1, 0.1])


def test_a_vessel_keeps_its_risk_level_until_its_end():
    held = Exploration(SETTINGS, 8, 4000, np.random.default_rng(0))
    before = held.risk.copy()
    assert np.unique(before * 8).tolist() == [1, 2, 3, 4, 5, 6, 7, 8]
    ended = np.arange(4000) < 2000
    held.renew(ended)
    assert (held.risk[2000:] == before[2000:]).all()
    assert (held.risk[:2000] != before[:2000]).mean() == pytest.approx(7 / 8, abs=0.03)


def test_without_levels_none_is_held():
    held = Exploration(SETTINGS, 0, 4, np.random.default_rng(0))
    held.renew(np.ones(4, bool))
    assert held.risk is None


def test_greedy_slots_do_as_the_policy_says_once_something_has_been_learnt():
    settings = ExplorationSettings(noise=0.5, greedy=0.4)
    tries = Exploration(settings, 0, 100, np.random.default_rng(0))

    class Random:
        on_policy = False

        def random(self, count):
            return torch.full((count, 2), 0.9)

    asked = np.zeros((100, 2), np.float32)
    changed = np.zeros(100, bool)
    for _ in range(50):
        changed |= (tries.disturb(asked.copy(), Random(), True, 0.1) != 0.0).any(axis=1)
    assert changed.sum() == 60
    assert (tries.disturb(asked.copy(), Random(), True, 1.0) != 0.0).all()
