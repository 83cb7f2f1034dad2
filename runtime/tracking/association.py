"""Which measurement belongs to which track: Mahalanobis gate, optimal assignment."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from twinscrew.runtime.messages.types import Float64
from twinscrew.runtime.tracking.light import linear_sum_assignment
from twinscrew.runtime.tracking.measurement import Measurements

_assign = linear_sum_assignment()

FORBIDDEN = 1e6
"""[-] Cost of a pair outside the gate: more than any number of pairs inside it can add up to."""


@dataclass(frozen=True, slots=True)
class Association:
    """Pairs, and what was left alone."""

    pairs: list[tuple[int, int]]
    """(track, measurement)"""
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
    distance2, log_det = innovations(x, P, measured)
    allowed = distance2 <= gate_sigma**2
    # Minus twice the log-likelihood: without log |S| a vague track would steal from a sure one.
    cost = np.where(allowed, distance2 + log_det, FORBIDDEN)
    rows, columns = _assign(cost)
    pairs = [(int(i), int(j)) for i, j in zip(rows, columns, strict=True) if allowed[i, j]]
    seen, used = {i for i, _ in pairs}, {j for _, j in pairs}
    return Association(
        pairs,
        [i for i in range(tracks) if i not in seen],
        [j for j in range(measurements) if j not in used],
    )


def innovations(
    x: Float64, P: Float64, measured: Measurements
) -> tuple[Float64, NDArray[np.float64]]:
    """Give squared Mahalanobis distances and log |S| of every pair, both (K, M)."""
    H = measured.H
    PHt = np.einsum("kab,mcb->kmac", P, H)
    S = np.einsum("mab,kmbc->kmac", H, PHt) + measured.R + measured.gate[:, None, None] * np.eye(2)
    y = measured.z_N - np.einsum("mab,kb->kma", H, x)
    det = S[..., 0, 0] * S[..., 1, 1] - S[..., 0, 1] * S[..., 1, 0]
    distance2 = (
        S[..., 1, 1] * y[..., 0] ** 2
        + S[..., 0, 0] * y[..., 1] ** 2
        - (S[..., 0, 1] + S[..., 1, 0]) * y[..., 0] * y[..., 1]
    ) / det
    return distance2, np.log(det)
