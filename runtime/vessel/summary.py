"""Latencies of a run: how many, and their percentiles; memory does not grow with the run."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, slots=True)
class LatencySummary:
    """Percentiles of latencies [ms]."""

    count: int
    p50: float
    p99: float
    p999: float
    max: float

    def as_dict(self) -> dict[str, float]:
        """Give the percentiles alone, for JSON."""
        return {"p50": self.p50, "p99": self.p99, "p999": self.p999, "max": self.max}


class Latencies:
    """Counts latencies in bins a tenth of a per cent wide; the greatest is kept exactly."""

    LEAST_MS = 1e-3
    RATIO = 1.001
    BINS = 18_000  # to 65 s

    def __init__(self) -> None:
        self._counts: NDArray[np.int64] = np.zeros(self.BINS, dtype=np.int64)
        self._max_ms = 0.0

    def add(self, latency_ms: float) -> None:
        """Count one latency."""
        bin_ = int(np.log(max(latency_ms, self.LEAST_MS) / self.LEAST_MS) / np.log(self.RATIO))
        self._counts[min(bin_, self.BINS - 1)] += 1
        self._max_ms = max(self._max_ms, latency_ms)

    def summary(self) -> LatencySummary:
        """Give the percentiles so far; all zero if there is none."""
        count = int(self._counts.sum())
        if count == 0:
            return LatencySummary(0, 0.0, 0.0, 0.0, 0.0)
        ends = np.cumsum(self._counts)
        p50, p99, p999 = (self._at(ends, share * count) for share in (0.5, 0.99, 0.999))
        return LatencySummary(count, p50, p99, p999, self._max_ms)

    def _at(self, ends: NDArray[np.int64], rank: float) -> float:
        bin_ = int(np.searchsorted(ends, rank))
        return float(min(self.LEAST_MS * self.RATIO ** (bin_ + 0.5), self._max_ms))
