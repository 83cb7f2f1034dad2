"""Waves: three long-crested components sampled from a Pierson-Moskowitz spectrum.

Source: VRX 2.3.2, its "PMS" wave field with steepness 0. Angles are clockwise from north here.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from msgspec import Meta
from numpy.typing import NDArray

from twinscrew.runtime.settings import NonNegative, Positive, Settings

Array = NDArray[np.float64]

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


def sample(settings: WaveSettings, rng: np.random.Generator) -> Waves:
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


def growth(ramp_s: float, time_s: float) -> float:
    """Give how much of their height the waves have reached, in [0, 1]."""
    return 1.0 if ramp_s == 0.0 else 1.0 - math.exp(-max(time_s, 0.0) / ramp_s)


def elevation(waves: Waves, p_N: Array, time_s: float) -> Array:
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
    height: Array = np.cos(angle) @ waves.amplitude * growth(waves.ramp_s, time_s)
    return height
