"""One track: a Kalman filter, a radius, and the counts that decide whether it lives."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from twinscrew.runtime.messages.types import Float64
from twinscrew.runtime.tracking.displacement import MeasuredVelocity, Sight
from twinscrew.runtime.tracking.light import kalman_filter
from twinscrew.runtime.tracking.motion import STATES

if TYPE_CHECKING:
    from filterpy.kalman import KalmanFilter
else:
    KalmanFilter = kalman_filter()

VELOCITY = np.eye(STATES)[2:4]
"""H of a measured velocity, (2, 6)."""


class Track:
    """What is known of one object."""

    __slots__ = (
        "age_s",
        "confirmed",
        "filter",
        "hits",
        "id",
        "known_s",
        "radius",
        "scans",
        "sight",
    )

    def __init__(
        self, z_N: Float64, H: Float64, R: Float64, radius: float, prior: Float64, sight: Sight
    ) -> None:
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
        sight
            Its strips.
        """
        self.filter: Any = KalmanFilter(dim_x=STATES, dim_z=2)
        self.filter.x = np.concatenate([z_N, np.zeros(STATES - 2)])
        self.filter.P = first_covariance(H, R, prior)
        self.filter.inv = inverse_2x2
        self.id = -1
        self.radius = radius
        self.sight = sight
        self.hits = self.scans = 1
        self.known_s = self.age_s = 0.0
        self.confirmed = False

    def predict(self, dt: float, F: Float64, Q: Float64) -> None:
        """Move on by `dt` [s]."""
        self.filter.predict(F=F, Q=Q)
        self.scans += 1
        self.known_s += dt
        self.age_s += dt

    def update(
        self,
        z_N: Float64,
        H: Float64,
        R: Float64,
        excess: float = 0.0,
        velocity: MeasuredVelocity | None = None,
    ) -> None:
        """Take in a measurement.

        A vessel does not move by decimetres between two scans; its visible side does. What of the
        innovation exceeds some Mahalanobis distance is therefore charged to the bias: before the
        filter's own update its variance is raised by `excess` times the innovation's covariance,
        which brings the innovation to that distance.

        Parameters
        ----------
        z_N, H, R
            The measurement, (2,) [m], and what it says, (2, 6), (2, 2).
        excess : float
            Squared Mahalanobis distance over the squared limit, less 1; nothing if negative.
        velocity
            How fast it went since it was last seen, if that is known.
        """
        if excess > 0.0:
            P, turn = self.filter.P, H[:, 4:]  # the bias's axes in N, but for the sign
            P[4:, 4:] += excess * turn.T @ (H @ P @ H.T + R) @ turn
        if velocity is None:
            self.filter.inv = inverse_2x2
            self.filter.update(z_N, R=R, H=H)
        else:
            self.filter.inv = np.linalg.inv
            both = np.zeros((4, 4))
            both[:2, :2], both[2:, 2:] = R, velocity.R
            z = np.concatenate([z_N, velocity.v_N])
            self.filter.update(z, R=both, H=np.concatenate([H, VELOCITY]))
        self.hits += 1
        self.age_s = 0.0


def doubted(
    velocity: MeasuredVelocity, x: Float64, P: Float64, limit_sigma: float
) -> MeasuredVelocity:
    """Give a velocity with as much noise as brings it within a Mahalanobis distance.

    Strips can be mistaken for others. A bad velocity does the less harm the farther it is off; and
    if it was the filter that was wrong, it is told so again and again.

    Parameters
    ----------
    velocity
        What was measured.
    x, P : (6,), (6, 6) float64
        What is expected.
    limit_sigma : float
        The distance [-].
    """
    y, S = velocity.v_N - x[2:4], P[2:4, 2:4] + velocity.R
    excess = _distance2(y, S) / limit_sigma**2 - 1.0
    return velocity if excess <= 0.0 else replace(velocity, R=velocity.R + excess * S)


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


def _distance2(y: Float64, S: Float64) -> float:
    """Give y S^-1 y of (2,) and (2, 2)."""
    (a, b), (c, d) = S.tolist()
    north, east = y.tolist()
    distance2: float = (d * north**2 + a * east**2 - (b + c) * north * east) / (a * d - b * c)
    return distance2


def inverse_2x2(S: Float64) -> Float64:
    """Invert a (2, 2) matrix: several times faster than the general inverse."""
    (a, b), (c, d) = S.tolist()
    det = a * d - b * c
    return np.array([[d / det, -b / det], [-c / det, a / det]])
