"""The paper's perception noise, eqs. (13) to (15), independent for every vessel and object.

The noise of a slot comes from the slot's own stream, drawn for many decisions at a time. Each
number is one of 65 536 equally likely values, the midpoints of the quantile bins: a look-up in
place of a rejection loop, and closer to the distribution than a run can tell.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import Annotated, NamedTuple

import numpy as np
from msgspec import Meta
from numpy.random import Generator
from numpy.typing import NDArray
from scipy.stats import norm, vonmises

from twinscrew.runtime.messages.types import Float32
from twinscrew.runtime.settings import Fraction, NonNegative, Settings

Complex64 = NDArray[np.complex64]

QUANTILES = 1 << 16
"""[-] Every noise takes one of so many equally likely values."""


class NoiseSettings(Settings, frozen=True):
    """How wrong perception is (parameters.md, Training environment: noise)."""

    position_m: NonNegative = 0.05
    """[m] Standard deviation of each coordinate."""
    velocity_mps: NonNegative = 0.05
    """[m/s] Standard deviation of each component."""
    radius_mean: Fraction = 0.8
    """[-] The perceived radius is the true one times this + (1 - this) w / pi,"""
    radius_kappa: Annotated[float, Meta(ge=0.0, le=500.0)] = 1.0
    """[-] w von Mises distributed around 0 with this concentration."""
    perfect: bool = False
    """True: no noise at all, the true radius."""


class Noise(NamedTuple):
    """One draw for V observers of O objects in E episodes; leading dimensions may differ."""

    position: Complex64
    """(E, V, O) [m]"""
    velocity: Complex64
    """(E, V, O) [m/s]"""
    radius: Float32
    """(E, V, O) [-] Factor of the true radius."""


def draw(
    settings: NoiseSettings, generators: Sequence[Generator], shape: tuple[int, ...], axis: int = 0
) -> Noise:
    """Draw noise of a shape from each generator, stacked along an axis."""
    if settings.perfect:
        full = (*shape[:axis], len(generators), *shape[axis:])
        zero = np.zeros(full, np.complex64)
        return Noise(zero, zero, np.ones(full, np.float32))
    bins = [g.integers(0, QUANTILES, (*shape, 5), dtype=np.uint16) for g in generators]
    bin_ = np.stack(bins, axis=axis)
    return Noise(
        normal_values(settings.position_m)[bin_[..., 0:2]].view(np.complex64)[..., 0],
        normal_values(settings.velocity_mps)[bin_[..., 2:4]].view(np.complex64)[..., 0],
        radius_factors(settings.radius_mean, settings.radius_kappa)[bin_[..., 4]],
    )


@lru_cache(maxsize=8)
def normal_values(deviation: float) -> Float32:
    """Give a centred normal distribution as `QUANTILES` equally likely values."""
    values: Float32 = (deviation * norm.ppf(_PROBABILITY)).astype(np.float32)
    return values


@lru_cache(maxsize=8)
def radius_factors(mean: float, kappa: float) -> Float32:
    """Give the radius factor, eq. (15), as `QUANTILES` equally likely values."""
    w = np.pi * (2 * _PROBABILITY - 1)
    if kappa > 0.0:  # the distribution function, read backwards: its own inverse takes a minute
        angle = np.linspace(-np.pi, np.pi, 4 * QUANTILES + 1)
        w = np.interp(_PROBABILITY, vonmises(kappa).cdf(angle), angle)
    return (mean + (1.0 - mean) * w / np.pi).astype(np.float32)


_PROBABILITY = (np.arange(QUANTILES) + 0.5) / QUANTILES


class NoiseBank:
    """Noise for E slots, drawn `block` decisions ahead so that a draw costs little."""

    def __init__(
        self,
        settings: NoiseSettings,
        generators: Sequence[Generator],
        shape: tuple[int, int],
        block: int = 32,
    ) -> None:
        self.settings = settings
        self._generators = generators
        self._shape = (block, *shape)
        self._noise: list[Noise] = []

    def next(self) -> Noise:
        """Give the noise of the next decision, (E, V, O)."""
        if not self._noise:
            ahead = draw(self.settings, self._generators, self._shape, axis=1)
            self._noise = [Noise(*rows) for rows in zip(*ahead, strict=True)][::-1]
        return self._noise.pop()
