import pytest
import torch

from twinscrew.training.networks import circles
from twinscrew.training.replay import Batch


def _observations(count, seed):
    generator = torch.Generator().manual_seed(seed)
    mask = (torch.rand(count, 5, generator=generator) > 0.5).float()
    objects = torch.randn(count, 5, 5, generator=generator) * 5 * mask[:, :, None]
    return circles(torch.randn(count, 7, generator=generator), objects, mask)


@pytest.fixture(scope="session")
def observations():
    """observations(count, seed): random ones."""
    return _observations


@pytest.fixture(scope="session")
def batch():
    """batch(count, seed, reward, discount, pairs): random transitions; reward is of the action."""

    def make(count=64, seed=0, reward=None, discount=0.9, pairs=False):
        generator = torch.Generator().manual_seed(seed)
        action = 2 * torch.rand(count, 2, generator=generator) - 1
        action = (action * 2).round() / 2 if pairs else action
        return Batch(
            _observations(count, seed),
            action,
            torch.zeros(count) if reward is None else reward(action),
            torch.full((count,), discount),
            _observations(count, seed + 1),
        )

    return make
