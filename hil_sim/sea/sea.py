"""The sea: what waves, wind and current are at a place and a time."""

from __future__ import annotations

from typing import Annotated

import numpy as np
from msgspec import Meta
from numpy.typing import NDArray

from twinscrew.hil_sim.sea import waves
from twinscrew.hil_sim.sea.waves import WaveSettings
from twinscrew.hil_sim.sea.wind import Wind, WindSettings
from twinscrew.runtime.settings import Settings

Array = NDArray[np.float64]
Current = Annotated[float, Meta(ge=-20.0, le=20.0)]
"""[m/s] North or east; the fastest tidal streams run at 10."""


class SeaSettings(Settings, frozen=True):
    """The sea of a scenario. The defaults are the paper's."""

    waves: WaveSettings = WaveSettings()
    wind: WindSettings = WindSettings()
    current_mps: tuple[Current, Current] = (0.0, 0.0)
    """[m/s] [N] Velocity of the water over ground: steady, the same everywhere."""


class Sea:
    """Waves, wind and current over time, fully determined by settings and generator.

    Two independent streams, for waves and gusts, are seeded with one draw from `rng`; nothing
    is drawn from `rng` later, so that the sea does not depend on what else uses it.
    """

    def __init__(self, settings: SeaSettings, rng: np.random.Generator) -> None:
        seed = np.random.SeedSequence(int(rng.integers(2**63)))
        for_waves, for_wind = (np.random.default_rng(child) for child in seed.spawn(2))
        self.waves = waves.sample(settings.waves, for_waves)
        self.wave_table = self.waves.table()
        self.current_N = np.array(settings.current_mps)
        self._wind = Wind(settings.wind, for_wind)

    def elevation(self, p_N: Array, time_s: float) -> Array:
        """Give the surface's height over still water, (...) [m] up, at p_N, (..., 2) [m]."""
        return waves.elevation(self.waves, p_N, time_s)

    def wave_growth(self, time_s: float) -> float:
        """Give the share of their height that the waves have reached, in [0, 1]."""
        return waves.growth(self.waves.ramp_s, time_s)

    def wind(self, time_s: float) -> Array:
        """Give the velocity of the air over ground, (2,) [m/s], frame N."""
        return self._wind.velocity(time_s)
