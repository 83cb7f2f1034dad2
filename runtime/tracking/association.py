"""Which measurement belongs to which track: Mahalanobis gate, optimal assignment."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from twinscrew.runtime._native import innovations
from twinscrew.runtime.lean_imports import linear_sum_assignment
from twinscrew.runtime.messages.types import Float64
from twinscrew.runtime.tracking.lidar import Measurements

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
    strict2, distance2, log_det = innovations(
        x, P, measured.z_N, measured.H, measured.R, measured.gate, gate_sigma
    )
    allowed = distance2 <= gate_sigma**2
    # Minus twice the log-likelihood: without log |S| a vague track would steal from a sure one.
    cost = np.where(allowed, distance2 + log_det, FORBIDDEN)
    rows, columns = _assign(cost)
    near = allowed[rows, columns]
    rows, columns = rows[near], columns[near]
    unseen, new = np.ones(tracks, np.bool_), np.ones(measurements, np.bool_)
    unseen[rows] = new[columns] = False
    return Association(
        list(zip(rows.tolist(), columns.tolist(), strict2[rows, columns].tolist(), strict=True)),
        np.flatnonzero(unseen).tolist(),
        np.flatnonzero(new).tolist(),
    )
