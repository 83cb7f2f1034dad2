"""How good tracks are against true positions: GOSPA, identities, first tracks, false tracks.

Source: Rahmathullah, Garcia-Fernandez, Svensson (2017), Generalized optimal sub-pattern assignment
metric, Proc. FUSION 2017, with alpha = 2.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from scipy.optimize import linear_sum_assignment

from twinscrew.runtime.messages.types import Float64

CUTOFF_M = 20.0
"""[m] c: a track farther from a target than this does not follow it."""
NEES_95 = 5.991
"""[-] 95 % point of chi-squared with 2 degrees of freedom: a position's."""


@dataclass(frozen=True, slots=True)
class Gospa:
    """One frame's GOSPA with p = 2 and alpha = 2, in its parts."""

    localisation_m2: float
    """[m2] Sum of the squared errors of the pairs."""
    missed: int
    """[-] Targets without a track."""
    false: int
    """[-] Tracks without a target."""
    pairs: list[tuple[int, int]]
    """(target, track) in the order given."""

    @property
    def squared_m2(self) -> float:
        """[m2] The metric's square."""
        return self.localisation_m2 + 0.5 * CUTOFF_M**2 * (self.missed + self.false)


def gospa(targets_N: Float64, tracks_N: Float64) -> Gospa:
    """Compare true positions (K, 2) with tracks' (M, 2) [m]."""
    if not len(targets_N) or not len(tracks_N):
        return Gospa(0.0, len(targets_N), len(tracks_N), [])
    apart = np.linalg.norm(targets_N[:, None] - tracks_N[None], axis=2)
    squared = np.minimum(apart, CUTOFF_M) ** 2
    rows, columns = linear_sum_assignment(squared)
    near = apart[rows, columns] < CUTOFF_M
    pairs = list(zip(rows[near].tolist(), columns[near].tolist(), strict=True))
    localisation = float(squared[rows[near], columns[near]].sum())
    return Gospa(localisation, len(targets_N) - len(pairs), len(tracks_N) - len(pairs), pairs)


@dataclass(slots=True)
class TrackScore:
    """Collects the frames of one recording."""

    squared_m2: list[float] = field(default_factory=list)
    parts_m2: list[tuple[float, float, float]] = field(default_factory=list)
    switches: int = 0
    nees: dict[str, list[float]] = field(default_factory=dict)
    _identity: dict[int, int] = field(default_factory=dict)
    _first_s: dict[int, float] = field(default_factory=dict)
    _known: set[int] = field(default_factory=set)
    _followed: set[int] = field(default_factory=set)
    _targets: set[int] = field(default_factory=set)
    _span_s: tuple[float, float] | None = None

    def add(self, time_s: float, truth: dict[int, Float64], tracks: dict[int, Float64]) -> None:
        """Add a frame: true positions by target and reported ones by identity, (2,) [m]."""
        self._span_s = (self._span_s[0] if self._span_s else time_s, time_s)
        names, ids = sorted(truth), sorted(tracks)
        targets_N = np.array([truth[n] for n in names]).reshape(-1, 2)
        found = gospa(targets_N, np.array([tracks[i] for i in ids]).reshape(-1, 2))
        half = 0.5 * CUTOFF_M**2
        self.squared_m2.append(found.squared_m2)
        self.parts_m2.append((found.localisation_m2, half * found.missed, half * found.false))
        self._targets |= set(names)
        self._known |= set(ids)
        for row, column in found.pairs:
            target, identity = names[row], ids[column]
            self._followed.add(identity)
            self._first_s.setdefault(target, time_s - self._span_s[0])
            self.switches += self._identity.get(target, identity) != identity
            self._identity[target] = identity

    def add_nees(
        self, sensor: str, truth: Sequence[Float64], tracks: Sequence[tuple[Float64, Float64]]
    ) -> None:
        """Add how far tracks, each (2,) [m] and (2, 2) [m2], are off, by their own covariances.

        The normalised estimation error squared of each pair counts for the sensor whose record the
        tracks have just taken in. A tracker that states no covariance is left out.
        """
        if not truth or not tracks or not tracks[0][1].any():
            return
        found = gospa(np.array(truth), np.array([place for place, _ in tracks]))
        errors = self.nees.setdefault(sensor, [])
        for row, column in found.pairs:
            place, covariance = tracks[column]
            error = place - truth[row]
            errors.append(float(error @ np.linalg.solve(covariance, error)))

    def figures(self) -> dict[str, Any]:
        """Give the figures of the frames."""
        parts = np.mean(self.parts_m2, axis=0) if self.parts_m2 else np.full(3, np.nan)
        first, last = self._span_s or (0.0, 0.0)
        minutes = max(last - first, 1e-9) / 60.0
        return {
            "frames": len(self.squared_m2),
            "gospa_rms_m": math.sqrt(np.mean(self.squared_m2)) if self.squared_m2 else None,
            "localisation_m2": float(parts[0]),
            "missed_m2": float(parts[1]),
            "false_m2": float(parts[2]),
            "identity_switches": self.switches,
            "time_to_first_track_s": {
                str(target): self._first_s.get(target) for target in sorted(self._targets)
            },
            "false_tracks_per_minute": len(self._known - self._followed) / minutes,
            "nees": {
                sensor: {
                    "mean": float(np.mean(errors)),
                    "in_95_band": float(np.mean(np.array(errors) <= NEES_95)),
                }
                for sensor, errors in self.nees.items()
                if errors
            },
        }
