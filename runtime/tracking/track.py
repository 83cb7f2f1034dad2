"""One track: a state, a radius, and the counts that decide whether it lives."""

from __future__ import annotations

import numpy as np

from twinscrew.runtime.messages.types import Float64
from twinscrew.runtime.tracking.displacement import Sight
from twinscrew.runtime.tracking.motion import STATES


class Track:
    """What is known of one object."""

    __slots__ = (
        "P",
        "age_s",
        "confirmed",
        "hits",
        "id",
        "known_s",
        "radius",
        "scans",
        "sight",
        "x",
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
        self.x = np.concatenate([z_N, np.zeros(STATES - 2)])
        self.P = first_covariance(H, R, prior)
        self.id = -1
        self.radius = radius
        self.sight = sight
        self.hits = self.scans = 1
        self.known_s = self.age_s = 0.0
        self.confirmed = False

    @property
    def stands(self) -> bool:
        """True if it was last seen as a piece of something long that stands."""
        return self.sight.stands is True

    def moved_on(self, dt: float, x: Float64, P: Float64) -> None:
        """Be what was predicted for `dt` [s] later."""
        self.x, self.P = x, P
        self.scans += 1
        self.known_s += dt
        self.age_s += dt

    def seen(self, x: Float64, P: Float64, radius: float, sight: Sight) -> None:
        """Be what a measurement has made of it."""
        self.x, self.P = x, P
        self.radius, self.sight = radius, sight
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
