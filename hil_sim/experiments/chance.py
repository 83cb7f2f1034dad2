"""A policy of pure chance: what the assurance and the measures are held against."""

from __future__ import annotations

import numpy as np

from twinscrew.runtime.messages.types import Float64, Observation
from twinscrew.runtime.policy.observation import PAPER
from twinscrew.runtime.policy.vessel_model import LEVELS

NAME = "random"
"""What `--methods` calls it."""


class RandomPolicy:
    """Asks for any rates, whatever it sees; the seed says which."""

    name = NAME
    period_s = 0.5
    shown = PAPER

    def __init__(self, seed: tuple[int, ...]) -> None:
        self._rng = np.random.default_rng(seed)

    def act(self, observation: Observation) -> Float64:  # noqa: ARG002
        """Give thrust rates, (2,) [N/s], uniform over what an action can be."""
        return self._rng.uniform(LEVELS[0], LEVELS[-1], 2)

    def reset(self) -> None:
        """Go on drawing: nothing is remembered."""
