"""The fit: multiple shooting with scipy's least squares, and how well its numbers are known."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares
from scipy.signal import savgol_filter

from twinscrew.hil_sim.identification.model import (
    DAY,
    HULL,
    STEPS,
    Prior,
    Windows,
    predict,
    values,
)
from twinscrew.hil_sim.identification.recorded import AHEAD_S, DT_S, Piece
from twinscrew.runtime.vessel_description import VesselDescription

Array = NDArray[np.float64]

STRIDE_S: Final = 3.0
"""[s] Between the beginnings of two windows."""
BLOCK_S: Final = 12.0
"""[s] Every `HOLD_OUT`-th block of this length is held out of the fit and validates it."""
HOLD_OUT: Final = 4


def cut(pieces: Sequence[Piece]) -> Windows:
    """Cut pieces into windows; every `HOLD_OUT`-th block is held out, and what reaches into one."""
    steps, stride = round(AHEAD_S / DT_S), round(STRIDE_S / DT_S)
    block = round(BLOCK_S / DT_S)
    rows: list[tuple[Array, Array, int, int, int, int]] = []
    before = blocks = 0
    for piece in pieces:
        state = np.hstack([piece.pose, piece.nu])
        smooth = _smoothed(state)
        for first in range(0, len(state) - steps - 1, stride):
            begin, end = first // block, (first + steps) // block
            kind = {(number + blocks) % HOLD_OUT == HOLD_OUT - 1 for number in (begin, end)}
            if len(kind) > 1:
                continue  # partly held out: neither
            window = state[first + 1 : first + 1 + steps]
            rows.append(
                (smooth[first], window, before + first, piece.day, blocks + begin, kind.pop())
            )
        before += len(state)
        blocks += len(state) // block + 1
    start, measured, at, day, number, held = zip(*rows, strict=True)
    return Windows(
        np.array(start),
        np.array(measured),
        np.array(at),
        np.array(day),
        np.array(number),
        np.array(held, dtype=np.bool_),
    )


def _smoothed(state: Array) -> Array:
    """Take noise off the beginnings: a quadratic through 0.4 s around (Savitzky and Golay)."""
    return np.asarray(savgol_filter(state, 9, 2, axis=0), dtype=np.float64)


class Problem:
    """Windows, commands and the vessel's file: what is to agree."""

    EVERY: Final = 5
    """[-] Every so many of the model's steps count."""

    def __init__(self, pieces: Sequence[Piece], vessel: VesselDescription) -> None:
        self.prior = Prior.of(vessel)
        self.windows = cut(pieces)
        self.command = np.vstack([piece.command for piece in pieces])
        self.days = 1 + max(piece.day for piece in pieces)
        sways = (*HULL, *(DAY * self.days))
        self.sigma = np.array([sway.sigma for sway in sways])
        self.names = [sway.name for sway in sways]
        speed, length = vessel.top_speed_mps, vessel.length_m
        slow = 0.05 * speed
        self.scale = np.array([0.1 * length, 0.1 * length, 0.05, slow, slow, slow / length])

    def errors(self, theta: Array, windows: Windows) -> Array:
        """Give predicted less measured, (P, W, H', 6); positions along and across the beginning."""
        found, every = values(theta, self.prior), self.EVERY * STEPS
        states = predict(found, self.prior, windows, self.command, self.EVERY)
        off = states - windows.measured[:, every - 1 :: every]
        c, s = np.cos(windows.start[:, 2]), np.sin(windows.start[:, 2])
        c, s = c[:, None], s[:, None]
        north, east = off[..., 0].copy(), off[..., 1].copy()
        off[..., 0], off[..., 1] = c * north + s * east, c * east - s * north
        return off

    def fit(
        self,
        windows: Windows,
        free: NDArray[np.bool_] | None = None,
        begin: Array | None = None,
    ) -> tuple[Array, Array]:
        """Fit, and give parameters (K,) and their covariance (K, K).

        `free` are the parameters to fit; `begin`, (K,), is where to look first.
        """
        use = np.ones(len(self.sigma), dtype=np.bool_) if free is None else free
        theta = np.zeros(len(self.sigma)) if begin is None else begin
        scale = np.tile(self.scale, (windows.measured.shape[1] // (self.EVERY * STEPS), 1))
        solution = None
        for _ in range(2):  # weights follow from what was left over, sample by sample
            theta, solution = self._solve(theta, windows, use, scale)
            left = self.errors(theta[None], windows)[0]
            scale = np.maximum(1.4826 * np.median(np.abs(left), axis=0), 0.02 * self.scale)
        assert solution is not None  # noqa: S101  (the loop ran)
        return theta, self._covariance(theta, windows, use, scale)

    def _residuals(self, theta: Array, windows: Windows, scale: Array) -> Array:
        """(P, R) Of the windows alone, whitened by channel; samples of a window count as one."""
        off = self.errors(theta, windows) / scale
        return off.reshape(len(theta), -1) / math.sqrt(off.shape[2])

    def _solve(
        self, theta: Array, windows: Windows, use: NDArray[np.bool_], scale: Array
    ) -> tuple[Array, Any]:
        sigma = self.sigma[use]

        def whole(x: Array) -> Array:
            full = np.tile(theta, (len(x), 1))
            full[:, use] = x
            return np.hstack([self._residuals(full, windows, scale), x / sigma])

        def residuals(x: Array) -> Array:
            return np.asarray(np.clip(whole(x[None])[0], -1e6, 1e6))

        def jacobian(x: Array) -> Array:
            step = 1e-4 * sigma
            nudged = np.vstack([x, x + np.diag(step)])
            found = np.clip(whole(nudged), -1e6, 1e6)
            return np.asarray((found[1:] - found[0]).T / step)

        bound = 4.0 * sigma
        solution = least_squares(
            residuals,
            np.clip(theta[use], -0.99 * bound, 0.99 * bound),
            jac=jacobian,
            bounds=(-bound, bound),
            x_scale=sigma,
            loss="soft_l1",
            ftol=1e-5,
            xtol=1e-4,
            max_nfev=10,
        )
        fitted = theta.copy()
        fitted[use] = solution.x
        return fitted, solution

    def _covariance(
        self, theta: Array, windows: Windows, use: NDArray[np.bool_], scale: Array
    ) -> Array:
        """Give the sandwich of the Gauss-Newton matrix and of the blocks' gradients.

        Errors within a block of time are one error (waves, gusts), not hundreds.
        """
        sigma = self.sigma
        step = 1e-4 * sigma
        nudged = np.vstack([theta, theta + np.diag(step)])
        found = self._residuals(nudged, windows, scale)
        jacobian = ((found[1:] - found[0]).T / step)[:, use]
        residual = found[0]
        weight = 1.0 / np.sqrt(1.0 + residual**2)
        bread = jacobian.T @ (weight[:, None] * jacobian) + np.diag(sigma[use] ** -2.0)
        each = len(residual) // len(windows.at)
        per_window = (jacobian * (weight * residual)[:, None]).reshape(-1, each, use.sum()).sum(1)
        blocks = np.unique(windows.block, return_inverse=True)[1]
        gradients = np.zeros((blocks.max() + 1, use.sum()))
        np.add.at(gradients, blocks, per_window)
        count = len(gradients)
        meat = gradients.T @ gradients * count / max(count - 1, 1) + np.diag(sigma[use] ** -2.0)
        inverse = np.linalg.inv(bread)
        covariance = np.zeros((len(sigma), len(sigma)))
        covariance[np.ix_(use, use)] = inverse @ meat @ inverse
        return covariance
