"""How long things take: repeated, in milliseconds, with the garbage collector at rest."""

from __future__ import annotations

import gc
import time
from collections import defaultdict
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import numpy as np


class Stopwatch:
    """Collects durations by name, by the wall clock or another one, as `time.thread_time_ns`."""

    def __init__(self, clock_ns: Callable[[], int] = time.perf_counter_ns) -> None:
        self._clock_ns = clock_ns
        self._ms: defaultdict[str, list[float]] = defaultdict(list)

    @contextmanager
    def time(self, name: str) -> Iterator[None]:
        """Time a block."""
        begin = self._clock_ns()
        yield
        self._ms[name].append((self._clock_ns() - begin) / 1e6)

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
