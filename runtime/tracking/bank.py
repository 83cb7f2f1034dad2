"""filterpy's Kalman filter for any number of tracks at a time.

Between small matrices it is calls that cost time, not multiplications. So the filter is given
stacks of matrices, one a track, and takes them for matrices: its equations are sums, products and
transposes, and what each of these means is the stack's own affair.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from twinscrew.runtime._native import invert_stack
from twinscrew.runtime.messages.types import Float64
from twinscrew.runtime.tracking.light import kalman_filter
from twinscrew.runtime.tracking.motion import STATES

if TYPE_CHECKING:
    from filterpy.kalman import KalmanFilter
else:
    KalmanFilter = kalman_filter()

MEASURED = 4
"""[-] A centroid's two coordinates, and a velocity's."""


class FilterBank:
    """Predicts and updates any number of tracks; it remembers none of them."""

    def __init__(self) -> None:
        self._filter: Any = KalmanFilter(dim_x=STATES, dim_z=MEASURED)
        self._filter.inv = invert_stack

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
        self._set(x, P)
        self._filter.predict(F=F, Q=Q)
        return self._state()

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
        self._set(x, P)
        self._filter.update(z[:, :, None], R=R, H=H.view(Stack))
        return self._state()

    def _set(self, x: Float64, P: Float64) -> None:
        self._filter.x, self._filter.P = x[:, :, None].view(Stack), P.view(Stack)

    def _state(self) -> tuple[Float64, Float64]:
        x, P = self._filter.x, self._filter.P
        return x.view(np.ndarray)[:, :, 0], P.view(np.ndarray)


class Stack(np.ndarray[tuple[int, int, int], np.dtype[np.float64]]):
    """Matrices, (K, n, m), that numpy.dot multiplies one by one and `T` transposes one by one."""

    __slots__ = ()

    @property
    def T(self) -> Any:
        """The transpose of each, as a view."""
        return self.transpose(0, 2, 1)

    def __array_function__(
        self,
        func: Callable[..., Any],
        types: Iterable[Any],
        args: Iterable[Any],
        kwargs: Mapping[str, Any],
    ) -> Any:
        """Say what numpy's functions do with stacks: all but `dot` what they always do."""
        if func is np.dot:
            return np.matmul(*args, **kwargs)
        return super().__array_function__(func, types, args, kwargs)
