"""How fast an object went between two scans, from the strips that both scans show.

A strip is what one row of beams sees of an object from end to end (`messages.types.Strips`).
Strips appear and disappear as pitch and roll turn the beams, and the centroid of all echoes jumps
with them; but a strip that is found again, as long as it was, has moved as the object has. Hulls
are upright and their sides long, so it need not be the same beam, nor the same height, that finds
it. The rigid motion that most strips agree on is solved for by iteratively reweighted least squares
(``runtime/native/shift.hpp``): pairs by nearness and length, Cauchy's weights, again from there.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from twinscrew.runtime._native import ShiftFinder
from twinscrew.runtime.messages.types import NANOSECONDS_PER_SECOND, Float64
from twinscrew.runtime.settings import Count, NonNegative, Positive, Settings


class DisplacementSettings(Settings, frozen=True, kw_only=True):
    """How strips are found again, and how far what they say can be trusted."""

    search_m: Positive = 0.3
    """[m] A strip is looked for this far from where its object's velocity would have brought it."""
    length_m: NonNegative = 0.03
    """[m] Two strips may differ by this much in length, and be the same,"""
    length_spacing: NonNegative = 1.5
    """[-] and by this share of the distance between neighbouring echoes."""
    sigma_m: Positive = 0.01
    """[m] White noise of a strip's mean: sensor, and waves that turn the object,"""
    spacing_sigma: NonNegative = 0.4
    """[-] and of where it ends, as a share of the distance between neighbouring echoes."""
    robust_sigma: Positive = 2.0
    """[-] A strip that is this many sigmas off what the others say has half a weight."""
    least_pairs: Count = 2
    """[-] With fewer strips nothing is said."""
    turn_radps: Positive = 0.6
    """[rad/s] Standard deviation of an object's turn rate."""
    floor_m: Positive = 0.015
    """[m] White noise of a displacement, however many strips agree."""
    max_age_s: Positive = 0.5
    """[s] Strips are not looked for after this long."""
    limit_sigma: Positive = 2.0
    """[-] Velocities beyond this Mahalanobis distance are trusted less the farther they are off."""
    astray: Positive = 0.4
    """[-] A centroid that seems to be off by this share of the radius tells that the strips lie:
    while it is, they are not asked."""


@dataclass(frozen=True, slots=True)
class Sight:
    """The strips of one object, as seen in one scan."""

    stamp_ns: int
    """[ns] The scan's stamp."""
    rows_N: Float64
    """(S, 4) Mean, north and east [m]; length [m]; number of echoes."""
    stands: bool | None = None
    """See `standing.Standing.pieces`."""


@dataclass(frozen=True, slots=True)
class MeasuredVelocity:
    """A velocity over ground, and its noise."""

    v_N: Float64
    """[m/s] [N] (2,)"""
    R: Float64
    """[m2/s2] [N] (2, 2)"""


class Displacement:
    """Measures velocities. It keeps the kernel's memory: one serves one thread at a time."""

    def __init__(self, settings: DisplacementSettings) -> None:
        self.settings = settings
        self._find = ShiftFinder(
            search=settings.search_m,
            length=settings.length_m,
            spacing=settings.length_spacing,
            sigma=settings.sigma_m,
            ends=settings.spacing_sigma,
            robust=settings.robust_sigma,
            pairs=settings.least_pairs,
        )

    def measure(
        self,
        before: Sight,
        after: Sight,
        expected_N: tuple[float, float],
        centre_N: tuple[float, float],
    ) -> MeasuredVelocity | None:
        """Give an object's mean velocity between two scans; None if its strips do not tell.

        Parameters
        ----------
        before, after
            What the scans show of it.
        expected_N : (float, float)
            Its velocity as far as it is known [m/s].
        centre_N : (float, float)
            Its centre in the second scan [m]: the velocity is that of this place.
        """
        dt = (after.stamp_ns - before.stamp_ns) / NANOSECONDS_PER_SECOND
        if not 0.0 < dt <= self.settings.max_age_s:
            return None
        north, east = expected_N
        shift = self._find(
            before.rows_N,
            after.rows_N,
            (north * dt, east * dt),
            centre_N,
            self.settings.turn_radps * dt,
        )
        if not shift.pairs:
            return None
        floor, cross = self.settings.floor_m**2, shift.xy / dt**2
        R = [[(shift.xx + floor) / dt**2, cross], [cross, (shift.yy + floor) / dt**2]]
        return MeasuredVelocity(np.array([shift.x / dt, shift.y / dt]), np.array(R))
