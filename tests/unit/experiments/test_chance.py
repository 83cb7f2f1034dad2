"""The random policy: any action, and the same ones from the same seed."""

import numpy as np

from twinscrew.hil_sim.experiments.chance import RandomPolicy
from twinscrew.runtime.messages.types import Observation
from twinscrew.runtime.policy.load import Policy

SEEN = Observation(
    ego=np.zeros(7, np.float32), objects=np.zeros((5, 5), np.float32), mask=np.zeros(5, np.float32)
)


def test_the_seed_says_what_it_does() -> None:
    first, again, other = (RandomPolicy(seed) for seed in ((1, 0), (1, 0), (1, 1)))
    rates = first.act(SEEN)
    assert (rates == again.act(SEEN)).all()
    assert (rates != other.act(SEEN)).all()


def test_it_uses_all_that_an_action_may_be_and_no_more() -> None:
    policy = RandomPolicy((3,))
    rates = np.array([policy.act(SEEN) for _ in range(500)])
    assert np.abs(rates).max() <= 1000.0
    assert (rates.min(axis=0) < -950.0).all()
    assert (rates.max(axis=0) > 950.0).all()
    assert np.abs(rates.mean(axis=0)).max() < 100.0


def test_it_is_a_policy() -> None:
    assert isinstance(RandomPolicy((1,)), Policy)
