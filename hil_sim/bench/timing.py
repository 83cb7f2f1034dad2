"""How long things take: repeated, in milliseconds, with the garbage collector at rest."""

from __future__ import annotations

import gc
import time
from collections import defaultdict
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np


class Stopwatch:
    """Collects durations by name."""

    def __init__(self) -> None:
        self._ms: defaultdict[str, list[float]] = defaultdict(list)

    @contextmanager
    def time(self, name: str) -> Iterator[None]:
        """Time a block."""
        begin = time.perf_counter_ns()
        yield
        self._ms[name].append((time.perf_counter_ns() - begin) / 1e6)

    def figures(self, name: str) -> dict[str, float]:
        """Give p50, p99 and max [ms] of a name."""
        ms = np.array(self._ms[name])
        p50, p99 = np.percentile(ms, [50, 99])
        return {
            "p50_ms": round(float(p50), 4),
            "p99_ms": round(float(p99), 4),
            "max_ms": round(float(ms.max()), 4),
        }

    def all_figures(self) -> dict[str, dict[str, float]]:
        """Give the figures of every name, in the order of their first use."""
        return {name: self.figures(name) for name in self._ms}

    def median_ms(self, name: str) -> float:
        """[ms] Median of a name."""
        return float(np.median(self._ms[name]))


@contextmanager
def garbage_at_rest() -> Iterator[None]:
    """Keep the garbage collector out of a measurement."""
    gc.collect()
    gc.disable()
    try:
        yield
    finally:
        gc.enable()
