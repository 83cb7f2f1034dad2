"""Everything a LiDAR can see: which shape, where, how it moves."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from twinscrew.runtime.messages.types import Float64

ABSENT = -1
"""The shape number of a body that is not there."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Bodies:
    """K bodies at one moment."""

    shape: NDArray[np.int32]
    """(K,) Number of each body's shape, or `ABSENT`."""
    position_N: Float64
    """[m] [N] (K, 3)"""
    R_NB: Float64
    """(K, 3, 3) Turns a vector of a body's frame into N."""
    water_z: Float64
    """[m] [N] (K,) Down coordinate of the water surface around each body."""
    velocity_N: Float64 | None = None
    """[m/s] [N] (K, 3) Only scans that take time ask for it; None: all stand still."""
    rates_B: Float64 | None = None
    """[rad/s] [B] (K, 3) As `velocity_N`."""

    def moved(self, time_s: float) -> Bodies:
        """Give the bodies `time_s` later (or earlier), velocity and rates held."""
        position_N, R_NB = self.position_N, self.R_NB
        if self.velocity_N is not None:
            position_N = position_N + time_s * self.velocity_N
        if self.rates_B is not None:
            R_NB = R_NB @ turns(time_s * self.rates_B)
        return replace(self, position_N=position_N, R_NB=R_NB)


def turns(vectors: Float64) -> Float64:
    """Give rotations (K, 3, 3) by rotation vectors (K, 3) [rad]: Rodrigues' formula."""
    angle = np.linalg.norm(vectors, axis=1)[:, None, None]
    x, y, z = vectors.T
    zero = np.zeros_like(x)
    S = np.array([[zero, -z, y], [z, zero, -x], [-y, x, zero]]).transpose(2, 0, 1)
    # sinc keeps both quotients exact at angle zero: sin(a) / a, and (1 - cos(a)) / a^2.
    first, second = np.sinc(angle / np.pi), 0.5 * np.sinc(angle / (2 * np.pi)) ** 2
    R: Float64 = np.eye(3) + first * S + second * (S @ S)
    return R
