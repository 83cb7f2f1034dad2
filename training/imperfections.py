"""What real perception does beyond the paper's noise; all of it is off by default.

A tracker's velocity lags and its errors last; objects are lost for a while, near ones melt into
one, and a catamaran can look like two.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from twinscrew.runtime.messages.types import Float32
from twinscrew.runtime.settings import Fraction, NonNegative, Positive, Settings
from twinscrew.training.scenarios import Index, Mask

Complex64 = NDArray[np.complex64]


class ImperfectionSettings(Settings, frozen=True):
    """How perception fails."""

    velocity_lag_s: NonNegative = 0.0
    """[s] Time constant with which a perceived velocity follows the true one."""
    drift_position_m: NonNegative = 0.0
    """[m] Standard deviation of a lasting error of each coordinate, besides the noise."""
    drift_velocity_mps: NonNegative = 0.0
    """[m/s] The same of each velocity component."""
    drift_time_s: Positive = 2.0
    """[s] How long such errors last: the correlation time."""
    lost_rate_hz: NonNegative = 0.0
    """[1/s] How often a seen object is lost by one observer,"""
    lost_time_s: Positive = 1.0
    """[s] for this long on average."""
    merge_gap_m: NonNegative = 0.0
    """[m] Objects whose surfaces are nearer to each other than this look like one; 0: never."""
    split_probability: Fraction = 0.0
    """[-] Chance that an observer sees one of the objects, any, as two halves."""

    @property
    def used(self) -> bool:
        """Whether anything at all is imperfect."""
        errors = self.velocity_lag_s + self.drift_position_m + self.drift_velocity_mps
        return errors + self.lost_rate_hz + self.merge_gap_m + self.split_probability > 0.0


class Imperfections:
    """Remembers, for every pair of observer and object, what it believes; draws per slot."""

    def __init__(
        self,
        settings: ImperfectionSettings,
        generators: Sequence[Generator],
        shape: tuple[int, int],
        period_s: float,
    ) -> None:
        self.settings = settings
        self._generators = generators
        self._period = period_s
        vessels, objects = shape
        pairs = (len(generators), vessels, objects)
        self._velocity = np.zeros((len(generators), objects), complex)
        self._drift = np.zeros((2, *pairs), np.complex64)
        self._lost = np.zeros(pairs, bool)

    def forget(self, slots: Index) -> None:
        """Begin new episodes in some slots."""
        self._velocity[slots] = 0.0
        self._drift[:, slots] = 0.0
        self._lost[slots] = False

    def lagged(self, velocity: NDArray[np.complex128]) -> NDArray[np.complex128]:
        """Give the velocities, (E, O) [m/s], as a tracker follows them."""
        lag = self.settings.velocity_lag_s
        if lag <= 0.0:
            return velocity
        self._velocity += (velocity - self._velocity) * -math.expm1(-self._period / lag)
        return self._velocity

    def distort(
        self, p: Complex64, v: Complex64, radius: Float32, seen: Mask
    ) -> tuple[Complex64, Complex64, Float32, Mask]:
        """Spoil what is seen: all (E, V, O); the result may have one more column, a half object.

        Parameters
        ----------
        p, v
            Place relative to the observer [m] and velocity over ground [m/s], frame N.
        radius : float32
            [m]
        seen : bool
        """
        s, shape = self.settings, seen.shape
        per_slot = [g.random((6, *shape[1:]), dtype=np.float32) for g in self._generators]
        uniform = np.stack(per_slot, axis=1)
        p, v = self._drifted(p, v, uniform[:4])
        seen = seen & ~self._now_lost(uniform[4])
        if s.merge_gap_m > 0.0:
            p, v, radius, seen = merge(p, v, radius, seen, s.merge_gap_m)
        if s.split_probability > 0.0:
            p, v, radius, seen = split(p, v, radius, seen, uniform[5], s.split_probability)
        return p, v, radius, seen

    def _drifted(self, p: Complex64, v: Complex64, uniform: Float32) -> tuple[Complex64, Complex64]:
        """Add errors that last: a first-order Gauss-Markov process a pair."""
        s = self.settings
        if s.drift_position_m + s.drift_velocity_mps <= 0.0:
            return p, v
        keep = math.exp(-self._period / s.drift_time_s)
        length = np.sqrt(-2.0 * np.log1p(-uniform[:2]))  # Box-Muller
        white = (length * np.exp(2j * np.pi * uniform[2:])).astype(np.complex64)
        self._drift = keep * self._drift + math.sqrt(1.0 - keep**2) * white
        place, velocity = self._drift
        return (
            p + np.float32(s.drift_position_m) * place,
            v + np.float32(s.drift_velocity_mps) * velocity,
        )

    def _now_lost(self, uniform: Float32) -> Mask:
        """Lose and find objects: a two-state Markov chain a pair."""
        s = self.settings
        lose = -math.expm1(-s.lost_rate_hz * self._period)
        find = -math.expm1(-self._period / s.lost_time_s)
        self._lost = np.where(self._lost, uniform >= find, uniform < lose)
        return self._lost


def merge(
    p: Complex64, v: Complex64, radius: Float32, seen: Mask, gap_m: float
) -> tuple[Complex64, Complex64, Float32, Mask]:
    """Replace each two seen objects with a gap below `gap_m` by the circle around both."""
    p, v, radius, seen = p.copy(), v.copy(), radius.copy(), seen.copy()
    for one in range(p.shape[-1]):
        for other in range(one + 1, p.shape[-1]):
            axis = p[..., other] - p[..., one]
            apart = np.abs(axis)
            melt = seen[..., one] & seen[..., other]
            melt &= apart - radius[..., one] - radius[..., other] < gap_m
            if not melt.any():
                continue
            a, b, d = radius[..., one][melt], radius[..., other][melt], apart[melt]
            around = np.maximum(np.maximum(a, b), (d + a + b) / 2)
            along = axis[melt] / np.maximum(d, np.float32(1e-6))
            shift = np.where(around > np.maximum(a, b), around - a, np.where(a >= b, 0.0, d))
            p[..., one][melt] += (along * shift).astype(np.complex64)
            v[..., one][melt] = (v[..., one][melt] + v[..., other][melt]) / 2
            radius[..., one][melt] = around
            seen[..., other] &= ~melt
    return p, v, radius, seen


def split(
    p: Complex64, v: Complex64, radius: Float32, seen: Mask, uniform: Float32, probability: float
) -> tuple[Complex64, Complex64, Float32, Mask]:
    """Let some observers see one object as two halves, side by side across the line of sight."""
    count = p.shape[-1]
    dice = uniform[..., 0] / max(probability, 1e-9)  # below 1: split, and uniform again
    which = np.minimum((dice * count).astype(np.intp), count - 1)[..., None]
    halved = (dice < 1.0)[..., None] & np.take_along_axis(seen, which, -1)
    centre, size = np.take_along_axis(p, which, -1), np.take_along_axis(radius, which, -1)
    across = 1j * centre / np.maximum(np.abs(centre), np.float32(1e-6)) * size / 2
    left = np.where(halved, centre + across, centre).astype(np.complex64)
    half = np.where(halved, size / 2, size)
    p, radius = p.copy(), radius.copy()
    np.put_along_axis(p, which, left, -1)
    np.put_along_axis(radius, which, half, -1)
    return (
        np.concatenate([p, (centre - across).astype(np.complex64)], axis=-1),
        np.concatenate([v, np.take_along_axis(v, which, -1)], axis=-1),
        np.concatenate([radius, half], axis=-1),
        np.concatenate([seen, halved], axis=-1),
    )
