"""The filter of every track: a constant-velocity model, and filterpy's equations for many at once.

The state is x = (north, east, v_north, v_east, b_along, b_across): the object's centre and velocity
in frame N, and b, the distance of the *visible* centroid from that centre beyond what is expected
of it, along and across the line of sight. A LiDAR sees the side that faces it. As the aspect
changes, the visible centroid slides over the hull; a filter that took this for white noise would
report a velocity that is not there, and be sure of it. Position and velocity follow the white-noise
acceleration model; b is a first-order Gauss-Markov process.

Source: Bar-Shalom, Li, Kirubarajan (2001), Estimation with Applications to Tracking and Navigation,
sec. 6.2.2 (white-noise acceleration) and 8.2 (autocorrelated noise by state augmentation).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from twinscrew.runtime._native import invert_stack
from twinscrew.runtime.lean_imports import kalman_filter
from twinscrew.runtime.messages.types import Float64

if TYPE_CHECKING:
    from filterpy.kalman import KalmanFilter
else:
    KalmanFilter = kalman_filter()

STATES = 6


def transition(dt: float, bias_time_s: float) -> Float64:
    """Give F, (6, 6), over `dt` [s] for a bias that forgets with time constant `bias_time_s`."""
    F = np.eye(STATES)
    F[0, 2] = F[1, 3] = dt
    F[4, 4] = F[5, 5] = math.exp(-dt / bias_time_s)
    return F


def motion_noise(dt: float, acceleration_psd: float) -> Float64:
    """Give the part of Q, (6, 6), of a white acceleration of this density [m2/s3] over `dt` [s].

    Bar-Shalom et al. (2001), eq. 6.2.2-4, one block an axis.
    """
    Q = np.zeros((STATES, STATES))
    position = acceleration_psd * dt**3 / 3
    cross = acceleration_psd * dt**2 / 2
    velocity = acceleration_psd * dt
    for axis in (0, 1):
        Q[axis, axis] = position
        Q[axis, axis + 2] = Q[axis + 2, axis] = cross
        Q[axis + 2, axis + 2] = velocity
    return Q


def acceleration_psd(x: Float64, *, rest: float, under_way: float, speed_mps: float) -> Float64:
    """Give the density of each track's acceleration [m2/s3]: it rises with its speed.

    Parameters
    ----------
    x : (K, 6) float64
        States.
    rest, under_way
        The densities [m2/s3] of what lies still and of what is under way.
    speed_mps
        Half-way between the two at this speed [m/s].
    """
    speed2 = x[:, 2] ** 2 + x[:, 3] ** 2
    share = speed2 / (speed2 + speed_mps**2)
    psd: Float64 = rest + share * (under_way - rest)
    return psd


def add_bias_noise(Q: Float64, dt: float, bias_time_s: float, variance: Float64) -> None:
    """Add what keeps the biases' stationary variances.

    Parameters
    ----------
    Q : (K, 6, 6) float64
        The process noise; it is changed.
    dt : float
        Time step [s].
    bias_time_s : float
        Time constant [s].
    variance : (K, 2) float64
        Stationary variances [m2], along and across the line of sight.
    """
    forgotten = 1.0 - math.exp(-2.0 * dt / bias_time_s)
    added = forgotten * variance
    Q[:, 4, 4] += added[:, 0]
    Q[:, 5, 5] += added[:, 1]


def add_slide_noise(Q: Float64, dt: float, slide_mps: Float64) -> None:
    """Add that positions jump over `dt` [s] without any velocity.

    Parameters
    ----------
    Q : (K, 6, 6) float64
        The process noise; it is changed.
    dt : float
        Time step [s].
    slide_mps : (K,) float64
        Standard deviation of the jumps over the time [m/s]; 0 for what goes where it is moved.
    """
    jumps = (slide_mps * dt) ** 2
    Q[:, 0, 0] += jumps
    Q[:, 1, 1] += jumps


def first_covariance(H: Float64, R: Float64, prior: Float64) -> Float64:
    """Give P, (6, 6), of a state whose position comes from one measurement z = p + H_b b + w.

    Then p = z - H_b b - w: position and bias are correlated from the start.
    """
    P = np.diag(prior).astype(np.float64)
    H_b = H[:, 4:]
    P[:2, 4:] = -H_b @ P[4:, 4:]
    P[4:, :2] = P[:2, 4:].T
    P[:2, :2] = H_b @ P[4:, 4:] @ H_b.T + R
    return P


class FilterBank:
    """Predicts and updates any number of tracks with one filterpy filter; remembers none of them.

    Between small matrices it is calls that cost time, not multiplications. filterpy's equations are
    sums, products and transposes, so its filter is given a `MatrixStack` for each matrix.
    """

    def __init__(self) -> None:
        self._filter: Any = KalmanFilter(dim_x=STATES, dim_z=2)
        self._filter.inv = _inverses

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
        bank = self._filter
        bank.x, bank.P = MatrixStack(x[:, :, None]), MatrixStack(P)
        bank.predict(F=F, Q=MatrixStack(Q))
        return bank.x.values[:, :, 0], bank.P.values

    def update(
        self, x: Float64, P: Float64, z: Float64, H: Float64, R: Float64
    ) -> tuple[Float64, Float64]:
        """Take in a measurement of each track.

        Parameters
        ----------
        x, P : (K, 6), (K, 6, 6) float64
            States and covariances.
        z, H, R : (K, d), (K, d, 6), (K, d, d) float64
            What was measured, what of the state that is, and its noise. A row of H that is zero
            says nothing.
        """
        bank = self._filter
        bank.x, bank.P = MatrixStack(x[:, :, None]), MatrixStack(P)
        bank.update(MatrixStack(z[:, :, None]), R=MatrixStack(R), H=MatrixStack(H))
        return bank.x.values[:, :, 0], bank.P.values


class MatrixStack:
    """Matrices, (K, n, m), that are added, multiplied and transposed one by one.

    A type of its own that answers `numpy.dot` by numpy's dispatch protocol (NEP 18); a matrix of
    two axes among the operands counts for each of the stack.
    """

    __slots__ = ("values",)
    __array_ufunc__ = None  # numpy's operators leave sums to this class

    def __init__(self, values: Float64) -> None:
        self.values = values

    @property
    def T(self) -> MatrixStack:
        """The transpose of each, as a view."""
        return MatrixStack(self.values.transpose(0, 2, 1))

    def copy(self) -> MatrixStack:
        """Give matrices of their own."""
        return MatrixStack(self.values.copy())

    def __deepcopy__(self, memo: dict[int, Any]) -> MatrixStack:
        """Copy as `copy` does."""
        return self.copy()

    def __add__(self, other: Any) -> MatrixStack:
        """Add matrices, or one to each."""
        return MatrixStack(self.values + _values(other))

    def __sub__(self, other: Any) -> MatrixStack:
        """Subtract matrices, or one from each."""
        return MatrixStack(self.values - _values(other))

    def __rsub__(self, other: Any) -> MatrixStack:
        """Subtract each from a matrix."""
        return MatrixStack(_values(other) - self.values)

    def __rmul__(self, factor: float) -> MatrixStack:
        """Scale each."""
        return MatrixStack(factor * self.values)

    def __array_function__(
        self,
        func: Callable[..., Any],
        types: Iterable[Any],
        args: Iterable[Any],
        kwargs: Mapping[str, Any],
    ) -> Any:
        """Multiply matrices one by one; no other function of numpy takes stacks."""
        if func is not np.dot:
            return NotImplemented
        return MatrixStack(np.matmul(*map(_values, args)))


def _values(operand: Any) -> Any:
    return operand.values if isinstance(operand, MatrixStack) else operand


def _inverses(stack: MatrixStack) -> MatrixStack:
    return MatrixStack(invert_stack(np.ascontiguousarray(stack.values)))
