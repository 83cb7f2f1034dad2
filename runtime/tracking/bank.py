"""filterpy's Kalman filter for several tracks at a time.

The states of independent tracks, one below the other, are one state whose matrices are block
diagonal: every product, and so every equation of the filter, falls apart into those of the single
tracks. Between small matrices it is calls that cost time, not multiplications, so that a filter of
four tracks takes hardly longer than a filter of one. (With more the zeros begin to cost.)
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.lib.stride_tricks import as_strided

from twinscrew.runtime._native import invert_blocks
from twinscrew.runtime.messages.types import Float64
from twinscrew.runtime.tracking.light import kalman_filter
from twinscrew.runtime.tracking.motion import STATES

if TYPE_CHECKING:
    from filterpy.kalman import KalmanFilter
else:
    KalmanFilter = kalman_filter()

TOGETHER = 4
"""[-] Tracks in one filter."""
MEASURED = 4
"""[-] A centroid's two coordinates, and a velocity's."""


class FilterBank:
    """Predicts and updates any number of tracks; it remembers none of them."""

    def __init__(self) -> None:
        self._filters = [_Joint(count) for count in range(1, TOGETHER + 1)]

    def predict(self, x: Float64, P: Float64, F: Float64, Q: Float64) -> tuple[Float64, Float64]:
        """Move tracks on.

        Parameters
        ----------
        x, P : (K, 6), (K, 6, 6) float64
            States and covariances.
        F : (6, 6) float64
            The transition of all.
        Q : (K, 6, 6) float64
            The process noise of each.
        """
        after, spread = np.empty_like(x), np.empty_like(P)
        for part in _parts(len(x)):
            joint = self._joint(part)
            after[part], spread[part] = joint.predict(x[part], P[part], F, Q[part])
        return after, spread

    def update(
        self, x: Float64, P: Float64, z: Float64, H: Float64, R: Float64
    ) -> tuple[Float64, Float64]:
        """Take in a measurement of each track.

        Parameters
        ----------
        x, P : (K, 6), (K, 6, 6) float64
            States and covariances.
        z, H, R : (K, 4), (K, 4, 6), (K, 4, 4) float64
            What was measured, what of the state that is, and its noise. A row of H that is zero
            says nothing.
        """
        after, spread = np.empty_like(x), np.empty_like(P)
        for part in _parts(len(x)):
            joint = self._joint(part)
            after[part], spread[part] = joint.update(x[part], P[part], z[part], H[part], R[part])
        return after, spread

    def _joint(self, part: slice[int, int, None]) -> _Joint:
        return self._filters[part.stop - part.start - 1]


class _Joint:
    """One filter of some tracks. Its matrices are kept: their zeros are written once."""

    def __init__(self, count: int) -> None:
        states, measured = count * STATES, count * MEASURED
        self._filter: Any = KalmanFilter(dim_x=states, dim_z=measured)
        self._filter.inv = lambda S: invert_blocks(S, MEASURED)
        self._P, self._in_P = _blocks(count, STATES, STATES)
        self._F, self._in_F = _blocks(count, STATES, STATES)
        self._Q, self._in_Q = _blocks(count, STATES, STATES)
        self._H, self._in_H = _blocks(count, MEASURED, STATES)
        self._R, self._in_R = _blocks(count, MEASURED, MEASURED)

    def predict(self, x: Float64, P: Float64, F: Float64, Q: Float64) -> tuple[Float64, Float64]:
        self._in_F[:] = F
        self._in_Q[:] = Q
        self._set(x, P)
        self._filter.predict(F=self._F, Q=self._Q)
        return self._state(x.shape)

    def update(
        self, x: Float64, P: Float64, z: Float64, H: Float64, R: Float64
    ) -> tuple[Float64, Float64]:
        self._in_H[:] = H
        self._in_R[:] = R
        self._set(x, P)
        self._filter.update(z.reshape(-1), R=self._R, H=self._H)
        return self._state(x.shape)

    def _set(self, x: Float64, P: Float64) -> None:
        self._in_P[:] = P
        self._filter.x, self._filter.P = x.reshape(-1), self._P

    def _state(self, shape: tuple[int, ...]) -> tuple[Float64, Float64]:
        P: Float64 = self._filter.P
        return self._filter.x.reshape(shape), _diagonal(P, shape[0], STATES, STATES)


def _parts(count: int) -> list[slice[int, int, None]]:
    return [slice(k, min(k + TOGETHER, count)) for k in range(0, count, TOGETHER)]


def _blocks(count: int, rows: int, columns: int) -> tuple[Float64, Float64]:
    """Give a block diagonal matrix of zeros, and its blocks as a view, (count, rows, columns)."""
    matrix = np.zeros((count * rows, count * columns))
    down, right = matrix.strides
    across = rows * down + columns * right
    return matrix, as_strided(matrix, (count, rows, columns), (across, down, right))


def _diagonal(matrix: Float64, count: int, rows: int, columns: int) -> Float64:
    """Give the blocks on the diagonal as a view, (count, rows, columns)."""
    blocks = matrix.reshape(count, rows, count, columns)
    return blocks.diagonal(axis1=0, axis2=2).transpose(2, 0, 1)
