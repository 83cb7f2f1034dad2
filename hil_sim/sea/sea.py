"""The sea: wind with gusts, waves, and currents, at a place and a time."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from msgspec import Meta
from numpy.typing import NDArray

from twinscrew.runtime.settings import NonNegative, Positive, Settings
from twinscrew.training.harbours import CurrentField

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


# -- Waves: three long-crested components sampled from a Pierson-Moskowitz spectrum.
#
# Source: VRX 2.3.2, its "PMS" wave field with steepness 0. Angles are clockwise from north here.

SPECTRUM_ALPHA = 0.0081
"""[-] Phillips' constant of the Pierson-Moskowitz spectrum."""
SPECTRUM_GRAVITY = 9.81
"""[m/s2] Gravity in the spectrum."""
DISPERSION_GRAVITY = 9.8
"""[m/s2] Gravity in the dispersion relation: VRX rounds here."""


class WaveSettings(Settings, frozen=True):
    """Which waves there are."""

    period_s: Positive = 5.0
    """[s] Period of the spectrum's peak (paper, sec. VI)."""
    gain: NonNegative = 0.3
    """[-] Factor on the amplitudes (paper, sec. VI); 0 is flat water."""
    scale: Annotated[float, Meta(gt=1.0)] = 1.1
    """[-] Ratio of neighbouring frequencies, above 1."""
    towards_deg: float = 90.0
    """[deg] [N] Where the middle component runs to, clockwise from north."""
    spread_rad: float = 0.4
    """[rad] Each higher frequency runs this much further to port."""
    ramp_s: NonNegative = 2.0
    """[s] Time constant with which the waves grow from flat water; 0: there from the start."""
    random_phase: bool = False
    """Draw the phases from the sea's generator; otherwise they are 0, as in VRX."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Waves:
    """The components of a wave field."""

    amplitude: Array
    """[m] (n,)"""
    wavenumber_N: Array
    """[rad/m] [N] (n, 2) Points where the component runs to."""
    frequency: Array
    """[rad/s] (n,)"""
    phase: Array
    """[rad] (n,)"""
    ramp_s: float
    """[s] Time constant of the growth from flat water."""

    def table(self) -> Array:
        """Give the components as rows: amplitude, wavenumber north and east, frequency, phase."""
        columns = [self.amplitude, *self.wavenumber_N.T, self.frequency, self.phase]
        return np.ascontiguousarray(np.column_stack(columns))


def spectrum(frequency: Array, peak: float) -> Array:
    """Give the Pierson-Moskowitz spectral density [m2 s] at frequencies [rad/s].

    Source: Fossen (2021), chapter 10, written with the peak frequency [rad/s].
    """
    density: Array = (
        SPECTRUM_ALPHA
        * SPECTRUM_GRAVITY**2
        / frequency**5
        * np.exp(-1.25 * (peak / frequency) ** 4)
    )
    return density


def sample_waves(settings: WaveSettings, rng: np.random.Generator) -> Waves:
    """Give the three components around the peak, each with the energy of its frequency band."""
    order = np.array([-1.0, 0.0, 1.0])
    scale, peak = settings.scale, 2.0 * math.pi / settings.period_s
    frequency = peak * scale**order
    band = peak * np.array([1.0 - 1.0 / scale, (scale - 1.0 / scale) / 2.0, scale - 1.0])
    amplitude = settings.gain * np.sqrt(2.0 * spectrum(frequency, peak) * band)
    towards = math.radians(settings.towards_deg) - order * settings.spread_rad
    direction_N = np.column_stack([np.cos(towards), np.sin(towards)])
    wavenumber_N = direction_N * (frequency**2 / DISPERSION_GRAVITY)[:, None]
    drawn = rng.uniform(0.0, 2.0 * math.pi, size=3)
    phase = drawn if settings.random_phase else np.zeros(3)
    return Waves(
        amplitude=amplitude,
        wavenumber_N=wavenumber_N,
        frequency=frequency,
        phase=phase,
        ramp_s=settings.ramp_s,
    )


def wave_growth(ramp_s: float, time_s: float) -> float:
    """Give how much of their height the waves have reached, in [0, 1]."""
    return 1.0 if ramp_s == 0.0 else 1.0 - math.exp(-max(time_s, 0.0) / ramp_s)


def wave_elevation(waves: Waves, p_N: Array, time_s: float) -> Array:
    """Give the height of the surface over still water.

    Parameters
    ----------
    waves : Waves
        The components.
    p_N : (..., 2) float64
        Positions [m], frame N (north, east).
    time_s : float
        Time [s] since the sea was flat.

    Returns
    -------
    elevation : (...) float64
        Height [m], up positive.
    """
    angle = p_N @ waves.wavenumber_N.T - waves.frequency * time_s + waves.phase
    height: Array = np.cos(angle) @ waves.amplitude * wave_growth(waves.ramp_s, time_s)
    return height


# -- The sea: what waves, wind and current are at a place and a time.

Current = Annotated[float, Meta(ge=-20.0, le=20.0)]
"""[m/s] North or east; the fastest tidal streams run at 10."""


class SeaSettings(Settings, frozen=True):
    """The sea of a scenario. The defaults are the paper's."""

    waves: WaveSettings = WaveSettings()
    wind: WindSettings = WindSettings()
    current_mps: tuple[Current, Current] = (0.0, 0.0)
    """[m/s] [N] Velocity of the water over ground: steady, the same everywhere."""


class Sea:
    """Waves, wind and currents over time, fully determined by settings, field and generator.

    Two independent streams, for waves and gusts, are seeded with one draw from `rng`; nothing
    is drawn from `rng` later, so that the sea does not depend on what else uses it.
    """

    def __init__(
        self, settings: SeaSettings, rng: np.random.Generator, field: CurrentField | None = None
    ) -> None:
        """Draw waves and gusts; `field` is a current that varies, beside the steady one."""
        seed = np.random.SeedSequence(int(rng.integers(2**63)))
        for_waves, for_wind = (np.random.default_rng(child) for child in seed.spawn(2))
        self.waves = sample_waves(settings.waves, for_waves)
        self.wave_table = self.waves.table()
        self.current_N = np.array(settings.current_mps)
        """[m/s] [N] (2,) The steady current, the same everywhere."""
        still = field is None or not (field.mean.any() or field.vortex.any())
        self._field = None if still else field
        self._wind = Wind(settings.wind, for_wind)

    def current(self, p_N: Array, time_s: float) -> Array:
        """Give the water's velocity over ground, (V, 2) [m/s], frame N, at p_N, (V, 2) [m]."""
        if self._field is None:
            return np.tile(self.current_N, (len(p_N), 1))
        return self.current_N + self._field.velocity(p_N, time_s)

    def elevation(self, p_N: Array, time_s: float) -> Array:
        """Give the surface's height over still water, (...) [m] up, at p_N, (..., 2) [m]."""
        return wave_elevation(self.waves, p_N, time_s)

    def wave_growth(self, time_s: float) -> float:
        """Give the share of their height that the waves have reached, in [0, 1]."""
        return wave_growth(self.waves.ramp_s, time_s)

    def wind(self, time_s: float) -> Array:
        """Give the velocity of the air over ground, (2,) [m/s], frame N."""
        return self._wind.velocity(time_s)
