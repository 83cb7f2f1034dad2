"""Exploration: what is added to a policy's actions while it gathers experience."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from twinscrew.runtime.messages.types import Float32
from twinscrew.runtime.settings import Count, Fraction, NonNegative, Settings


class ExplorationSettings(Settings, frozen=True):
    """How far, and for how long, experience departs from the policy."""

    epsilon_start: Fraction = 0.3
    """[-] Probability of a random action instead of the policy's, at first."""
    epsilon_end: Fraction = 0.02
    """[-] The same, later."""
    epsilon_steps: Count = 2000
    """[environment steps] From the first to the second, linearly."""
    noise: NonNegative = 0.4
    """[-] Standard deviation of the noise on the action of the noisiest vessel; actions are +-1."""
    correlation: Fraction = 0.8
    """[-] Of a vessel's noise from one decision to the next: white noise hardly turns a hull."""


def epsilon(settings: ExplorationSettings, step: int) -> float:
    """Give the probability of a random action at an environment step."""
    share = min(step / settings.epsilon_steps, 1.0)
    return settings.epsilon_start + share * (settings.epsilon_end - settings.epsilon_start)


class CorrelatedNoise:
    """First-order Gauss-Markov noise on both thrust rates, another size for each slot.

    The sizes go from none to the full one, so that the buffer always holds the policy's own
    trajectories beside exploring ones.
    """

    def __init__(
        self, settings: ExplorationSettings, slots: int, generator: np.random.Generator
    ) -> None:
        self._rho = settings.correlation
        self._generator = generator
        size = settings.noise * np.linspace(0.0, 1.0, slots)[:, None]
        self._size = generator.permutation(size)
        self._state = generator.standard_normal((slots, 2))

    def step(self) -> Float32:
        """Give the noise of the next decision, (slots, 2)."""
        fresh = self._generator.standard_normal(self._state.shape)
        # Stationary: the variance stays one whatever the correlation.
        self._state = self._rho * self._state + np.sqrt(1.0 - self._rho**2) * fresh
        return (self._size * self._state).astype(np.float32)


class HeldLevels:
    """The risk levels, alpha = 1/L, ..., 1, that vessels gather at: each keeps its own to its end.

    With L = 0 there are none, and nothing is drawn.
    """

    def __init__(self, count: int, slots: int, generator: np.random.Generator) -> None:
        self._count = count
        self._generator = generator
        self.levels: Float32 | None = None
        """(slots, 1) in (0, 1]"""
        if count:
            self.levels = self._draw(slots)

    def renew(self, ended: NDArray[np.bool_]) -> None:
        """Draw new levels for the slots, (slots,), whose vessels have come to their end."""
        if self.levels is not None:
            self.levels = np.where(ended[:, None], self._draw(len(ended)), self.levels)

    def _draw(self, slots: int) -> Float32:
        level = self._generator.integers(1, self._count + 1, (slots, 1))
        return (level / self._count).astype(np.float32)
