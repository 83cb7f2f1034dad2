"""What a scan corrects: a centroid and perhaps a velocity for each track that it shows."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from twinscrew.runtime.messages.types import Float64
from twinscrew.runtime.tracking.bank import MEASURED, FilterBank
from twinscrew.runtime.tracking.displacement import MeasuredVelocity
from twinscrew.runtime.tracking.motion import STATES

VELOCITY = np.eye(STATES)[2:4]
"""H of a measured velocity, (2, 6)."""
UNIT = np.eye(MEASURED)


def corrected(
    bank: FilterBank,
    x: Float64,
    P: Float64,
    centroids: tuple[Float64, Float64, Float64],
    excess: Float64,
    velocities: Sequence[MeasuredVelocity | None],
    limit_sigma: float,
) -> tuple[Float64, Float64]:
    """Take in what was measured of N tracks.

    Parameters
    ----------
    x, P : (N, 6), (N, 6, 6) float64
        States and covariances.
    centroids
        z, H, R of the centroids, (N, 2), (N, 2, 6), (N, 2, 2).
    excess : (N,) float64
        See `charge_jumps`.
    velocities
        How fast each went since it was last seen, if that is known.
    limit_sigma : float
        See `doubted`.
    """
    z, H, R = np.zeros((len(x), MEASURED)), np.zeros((len(x), MEASURED, STATES)), _units(len(x))
    z[:, :2], H[:, :2], R[:, :2, :2] = centroids
    told = np.array([n for n, velocity in enumerate(velocities) if velocity is not None], np.intp)
    if len(told):
        known = [velocity for velocity in velocities if velocity is not None]
        v_N, R_v = np.array([v.v_N for v in known]), np.array([v.R for v in known])
        z[told, 2:], H[told, 2:] = v_N, VELOCITY
        R[told, 2:, 2:] = doubted(v_N, R_v, x[told], P[told], limit_sigma)
    return bank.update(x, charge_jumps(P, centroids[1], centroids[2], excess), z, H, R)


def charge_jumps(P: Float64, H: Float64, R: Float64, excess: Float64) -> Float64:
    """Charge what is too large of an innovation to the bias.

    A vessel does not move by decimetres between two scans; its visible side does. What of the
    innovation exceeds some Mahalanobis distance is therefore charged to the bias: before the
    filter's own update its variance is raised by `excess` times the innovation's covariance, which
    brings the innovation to that distance.

    Parameters
    ----------
    P, H, R : (N, 6, 6), (N, 2, 6), (N, 2, 2) float64
        Covariances, and what the centroids say.
    excess : (N,) float64
        Squared Mahalanobis distance over the squared limit, less 1; nothing if negative.
    """
    jumped: NDArray[np.intp] = np.flatnonzero(excess > 0.0)
    if len(jumped) == 0:
        return P
    P, H = P.copy(), H[jumped]
    turn = H[:, :, 4:]  # the bias's axes in N, but for the sign
    S = H @ P[jumped] @ H.transpose(0, 2, 1) + R[jumped]
    P[jumped, 4:, 4:] += excess[jumped, None, None] * (turn.transpose(0, 2, 1) @ S @ turn)
    return P


def doubted(v_N: Float64, R: Float64, x: Float64, P: Float64, limit_sigma: float) -> Float64:
    """Give velocities as much noise as brings them within a Mahalanobis distance.

    Strips can be mistaken for others. A bad velocity does the less harm the farther it is off; and
    if it was the filter that was wrong, it is told so again and again.

    Parameters
    ----------
    v_N, R : (N, 2), (N, 2, 2) float64
        What was measured.
    x, P : (N, 6), (N, 6, 6) float64
        What is expected.
    limit_sigma : float
        The distance [-].

    Returns
    -------
    R : (N, 2, 2) float64
        The noise to reckon with.
    """
    y, S = v_N - x[:, 2:4], P[:, 2:4, 2:4] + R
    (a, b), (c, d) = S.transpose(1, 2, 0)
    north, east = y.T
    distance2 = (d * north**2 + a * east**2 - (b + c) * north * east) / (a * d - b * c)
    excess = np.maximum(distance2 / limit_sigma**2 - 1.0, 0.0)
    raised: Float64 = R + excess[:, None, None] * S
    return raised


def _units(count: int) -> Float64:
    """Give unit matrices: the noise of what is not measured, which no row of H asks for."""
    R = np.empty((count, MEASURED, MEASURED))
    R[:] = UNIT
    return R
