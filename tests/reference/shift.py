"""A slow, plain reference of the shift: which strips are the same, and how they moved."""

import numpy as np

from twinscrew.runtime.messages.types import Float64
from twinscrew.runtime.tracking.lidar_motion import HullVelocitySettings


def shift(
    before: Float64,
    after: Float64,
    guess: Float64,
    centre: Float64,
    turn: float,
    settings: HullVelocitySettings,
) -> tuple[Float64, Float64] | None:
    """Give displacement (2,) and covariance (2, 2); None if too few strips are found again."""
    motion, search = np.array([*guess, 0.0]), settings.search_m
    for _ in range(3):
        pairs = _pairs(before, after, motion, centre, search, settings)
        if len(pairs) < settings.least_pairs:
            return None
        for _ in range(3):
            motion, covariance = _solve(pairs, motion, centre, turn, settings)
        search /= 2
    return motion[:2], covariance[:2, :2]


def _jacobian(place: Float64, centre: Float64) -> Float64:
    """Give how a place moves with (d, turn), (2, 3)."""
    x, y = place - centre
    return np.array([[1.0, 0.0, -y], [0.0, 1.0, x]])


def _pairs(before, after, motion, centre, search, settings):
    pairs = []
    for row in after:
        spacing = row[2] / max(row[3] - 1, 1)
        differ = settings.length_m + settings.length_spacing * spacing
        same = before[np.abs(before[:, 2] - row[2]) <= differ]
        moved = row[:2] - same[:, :2]
        off = np.linalg.norm(moved - _jacobian(row[:2], centre) @ motion, axis=1)
        if len(off) and off.min() < search:
            variance = settings.sigma_m**2 + (settings.spacing_sigma * spacing) ** 2
            pairs.append((row[:2], moved[off.argmin()], variance))
    return pairs


def _solve(pairs, motion, centre, turn, settings):
    information = np.diag([0.0, 0.0, 1.0 / turn**2])
    right = np.zeros(3)
    for place, moved, variance in pairs:
        A = _jacobian(place, centre)
        off2 = float(np.sum((moved - A @ motion) ** 2)) / variance
        weight = 1.0 / variance / (1.0 + off2 / settings.robust_sigma**2)
        information += weight * A.T @ A
        right += weight * A.T @ moved
    return np.linalg.solve(information, right), np.linalg.inv(information)
