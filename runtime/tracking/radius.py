"""The radius of a track: a high quantile of what was seen, followed step by step.

A vessel seen end-on shows less than its length, so the largest radius seen lately is nearer to the
truth than the last; but one scan in which two objects were merged must not count. A quantile does
both: the estimate q-follows by steps of +q or -(1 - q), so that a share 1 - q of the measurements
lies above it (Robbins and Monro, 1951). One bad scan moves it by one step, whatever its size.
"""

from __future__ import annotations

from twinscrew.runtime.settings import Fraction, NonNegative, Settings


class RadiusSettings(Settings, frozen=True, kw_only=True):
    """How the radius is smoothed."""

    quantile: Fraction = 0.9
    """[-] Share of the measured radii that the track's covers."""
    step: NonNegative = 0.1
    """[-] Step of one scan as a share of the radius; 0 keeps the first radius."""


def smoothed_radius(radius: float, measured: float, settings: RadiusSettings) -> float:
    """Follow the quantile of the measured radii [m] by one step, never past the measurement."""
    step = settings.step * radius
    if measured > radius:
        return min(measured, radius + settings.quantile * step)
    return max(measured, radius - (1.0 - settings.quantile) * step)
