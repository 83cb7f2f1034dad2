"""Wind: a mean and first-order Gauss-Markov gusts along it.

The gusts are drawn once on a fixed grid of times and interpolated, so that the wind at a time is
the same however often, and in whatever order, it is asked for.
"""

from __future__ import annotations

import math
from typing import Annotated

import numpy as np
from msgspec import Meta
from numpy.typing import NDArray

from twinscrew.runtime.settings import Positive, Settings

Array = NDArray[np.float64]

Speed = Annotated[float, Meta(ge=0.0, le=150.0)]
"""[m/s] No storm on earth blows harder; in far more, no vessel's motion can be computed."""
GRID_S = 0.05
"""[s] Spacing of the gusts' grid: VRX's physics step."""
BLOCK = 4096
"""[-] Grid points drawn at a time: 205 s, more than an episode."""


class WindSettings(Settings, frozen=True):
    """How the wind blows."""

    mean_mps: Speed = 10.0
    """[m/s] Mean speed over ground (paper, sec. VI)."""
    from_deg: float = 90.0
    """[deg] [N] Where it blows from, clockwise from north, as seamen say it."""
    gust_mps: Speed = 0.0
    """[m/s] Standard deviation of the gusts; VRX calls it the gain."""
    gust_time_constant_s: Positive = 2.0
    """[s] Time constant of the gusts."""


class Wind:
    """The wind over time, the same everywhere."""

    def __init__(self, settings: WindSettings, rng: np.random.Generator) -> None:
        towards = math.radians(settings.from_deg) + math.pi
        self._direction_N = np.array([math.cos(towards), math.sin(towards)])
        self._settings = settings
        self._rng = rng
        self._steady_N = settings.mean_mps * self._direction_N
        self._gusts = settings.gust_mps * rng.standard_normal(1)

    def velocity(self, time_s: float) -> Array:
        """Give the velocity of the air over ground, (2,) [m/s], frame N."""
        if self._settings.gust_mps == 0.0:
            return self._steady_N
        velocity: Array = (self._settings.mean_mps + self._gust(time_s)) * self._direction_N
        return velocity

    def _gust(self, time_s: float) -> float:
        index, fraction = divmod(max(time_s, 0.0) / GRID_S, 1.0)
        i = int(index)
        while i + 1 >= self._gusts.size:
            self._gusts = np.concatenate([self._gusts, self._draw(float(self._gusts[-1]))])
        gust = self._gusts[i] * (1.0 - fraction) + self._gusts[i + 1] * fraction
        return float(gust)

    def _draw(self, last: float) -> Array:
        """Continue the Gauss-Markov process exactly: x' = a x + sigma sqrt(1 - a^2) noise."""
        keep = math.exp(-GRID_S / self._settings.gust_time_constant_s)
        noise = self._settings.gust_mps * math.sqrt(1.0 - keep * keep)
        gusts = np.empty(BLOCK)
        for i, sample in enumerate(self._rng.standard_normal(BLOCK)):
            last = keep * last + noise * sample
            gusts[i] = last
        return gusts
