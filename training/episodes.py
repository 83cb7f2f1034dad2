"""Which episodes come next: every slot's own, drawn by the weights of the mixture."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from twinscrew.runtime.errors import ConfigError
from twinscrew.training.beginnings import begin
from twinscrew.training.environment_settings import EnvironmentSettings
from twinscrew.training.scenario_pool import Beginning, Pool
from twinscrew.training.streams import episode_stream


class Episodes:
    """Draws the episodes of every slot.

    Parameters
    ----------
    settings
        The environment.
    slots
        E pairs of a seed and a slot's number, which determine its episodes.
    ahead
        How many of a slot are drawn at a time.
    """

    def __init__(
        self, settings: EnvironmentSettings, slots: Sequence[tuple[int, int]], ahead: int
    ) -> None:
        self._settings, self._slots = settings, slots
        self._pool = Pool(self._draw, len(slots), ahead)
        self.set_weights([row.weight for row in settings.scenarios])

    def set_weights(self, weights: Sequence[float]) -> None:
        """Change how often each row of the mixture is drawn, for episodes yet to begin."""
        rows = self._settings.scenarios
        if len(weights) != len(rows) or min(weights) < 0.0 or sum(weights) <= 0.0:
            raise ConfigError(
                f"{len(rows)} numbers >= 0 with a positive sum are needed, got {list(weights)}",
                key="weight",
            )
        self._cumulative = np.cumsum(weights) / np.sum(weights)
        self._pool.forget()

    def take(self, slots: NDArray[np.intp]) -> Beginning:
        """Give the next episode of each of these slots (each at most once)."""
        return self._pool.take(slots)

    def _draw(self, slots: NDArray[np.intp], numbers: NDArray[np.intp]) -> Beginning:
        """Draw episodes, by slot and number."""
        which = [self._slots[slot] for slot in slots]
        generators = [
            episode_stream(seed, slot, number)
            for (seed, slot), number in zip(which, numbers.tolist(), strict=True)
        ]
        return begin(self._settings, generators, self._cumulative)
