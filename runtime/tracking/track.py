"""One track: a Kalman filter, a radius, and the counts that decide whether it lives."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from twinscrew.runtime.messages.types import Float64
from twinscrew.runtime.tracking.light import kalman_filter
from twinscrew.runtime.tracking.motion import STATES

if TYPE_CHECKING:
    from filterpy.kalman import KalmanFilter
else:
    KalmanFilter = kalman_filter()


class Track:
    """What is known of one object."""

    __slots__ = ("age_s", "confirmed", "filter", "hits", "id", "known_s", "radius", "scans")

    def __init__(self, z_N: Float64, H: Float64, R: Float64, radius: float, prior: Float64) -> None:
        """Start from one measurement.

        Parameters
        ----------
        z_N : (2,) float64
            Where it was measured [m].
        H, R : (2, 6), (2, 2) float64
            What the measurement says, and its noise.
        radius : float
            Its radius [m].
        prior : (6,) float64
            Variances of velocity [m2/s2] and bias [m2] before it was seen (position unused).
        """
        self.filter: Any = KalmanFilter(dim_x=STATES, dim_z=2)
        self.filter.x = np.concatenate([z_N, np.zeros(STATES - 2)])
        self.filter.P = first_covariance(H, R, prior)
        self.filter.inv = inverse_2x2
        self.id = -1
        self.radius = radius
        self.hits = self.scans = 1
        self.known_s = self.age_s = 0.0
        self.confirmed = False

    def predict(self, dt: float, F: Float64, Q: Float64) -> None:
        """Move on by `dt` [s]."""
        self.filter.predict(F=F, Q=Q)
        self.scans += 1
        self.known_s += dt
        self.age_s += dt

    def update(self, z_N: Float64, H: Float64, R: Float64, jump_sigma: float) -> None:
        """Take in a measurement.

        A vessel does not move by decimetres between two scans; its visible side does. What of the
        innovation exceeds `jump_sigma` is therefore charged to the bias: its variance is raised
        until the innovation is `jump_sigma` away, before the filter's own update.
        """
        P = self.filter.P
        S = H @ P @ H.T + R
        y = z_N - H @ self.filter.x
        excess = float(y @ inverse_2x2(S) @ y) / jump_sigma**2 - 1.0
        if excess > 0.0:
            toward = H[:, 4:]  # a rotation: the bias's axes in N, but for signs
            P[4:, 4:] += excess * toward.T @ S @ toward
        self.filter.update(z_N, R=R, H=H)
        self.hits += 1
        self.age_s = 0.0


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


def inverse_2x2(S: Float64) -> Float64:
    """Invert a (2, 2) matrix: several times faster than the general inverse."""
    (a, b), (c, d) = S.tolist()
    det = a * d - b * c
    return np.array([[d / det, -b / det], [-c / det, a / det]])
