"""Which measurement belongs to which track: Mahalanobis gate, optimal assignment."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from twinscrew.runtime.messages.types import Float64
from twinscrew.runtime.tracking.light import linear_sum_assignment
from twinscrew.runtime.tracking.measurement import Measurements

_assign = linear_sum_assignment()

FORBIDDEN = 1e6
"""[-] Cost of a pair outside the gate: more than any number of pairs inside it can add up to."""


@dataclass(frozen=True, slots=True)
class Association:
    """Pairs, and what was left alone."""

    pairs: list[tuple[int, int, float]]
    """(track, measurement, squared Mahalanobis distance without the allowance for jumps)"""
    unseen: list[int]
    """Tracks without a measurement."""
    new: list[int]
    """Measurements without a track."""


def associate(x: Float64, P: Float64, measured: Measurements, gate_sigma: float) -> Association:
    """Assign measurements to predicted tracks, as many as the gate allows, likeliest in all.

    Parameters
    ----------
    x : (K, 6) float64
        Predicted states.
    P : (K, 6, 6) float64
        Their covariances.
    measured
        M measurements.
    gate_sigma : float
        Greatest Mahalanobis distance [-] of a pair.
    """
    tracks, measurements = len(x), len(measured.z_N)
    if not tracks or not measurements:
        return Association([], list(range(tracks)), list(range(measurements)))
    strict2, distance2, log_det = innovations(x, P, measured)
    allowed = distance2 <= gate_sigma**2
    # Minus twice the log-likelihood: without log |S| a vague track would steal from a sure one.
    cost = np.where(allowed, distance2 + log_det, FORBIDDEN)
    rows, columns = _assign(cost)
    pairs = [
        (i, j, float(strict2[i, j]))
        for i, j in zip(rows.tolist(), columns.tolist(), strict=True)
        if allowed[i, j]
    ]
    seen, used = {i for i, _, _ in pairs}, {j for _, j, _ in pairs}
    return Association(
        pairs,
        [i for i in range(tracks) if i not in seen],
        [j for j in range(measurements) if j not in used],
    )


def innovations(x: Float64, P: Float64, measured: Measurements) -> tuple[Float64, Float64, Float64]:
    """Give squared Mahalanobis distances without and with the gate's allowance, and log |S|.

    All are of every pair, (K, M); the logarithm is of the S with the allowance.
    """
    H = measured.H
    S = np.einsum("mab,kbc,mdc->kmad", H, P, H, optimize=False) + measured.R
    y = measured.z_N - np.einsum("mab,kb->kma", H, x)
    strict2, _ = _distance2(S, y)
    distance2, det = _distance2(S + measured.gate[:, None, None] * _EYE, y)
    return strict2, distance2, np.log(det)


def _distance2(S: Float64, y: Float64) -> tuple[Float64, Float64]:
    """Give y S^-1 y and |S| of (..., 2, 2) and (..., 2)."""
    det = S[..., 0, 0] * S[..., 1, 1] - S[..., 0, 1] * S[..., 1, 0]
    product: Float64 = (
        S[..., 1, 1] * y[..., 0] ** 2
        + S[..., 0, 0] * y[..., 1] ** 2
        - (S[..., 0, 1] + S[..., 1, 0]) * y[..., 0] * y[..., 1]
    )
    return product / det, det


_EYE = np.eye(2)
