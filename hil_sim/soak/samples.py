"""What a process takes: sampled while it runs, judged when it is over."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from typing import NamedTuple

import numpy as np
import psutil

BYTES_PER_MB = 1e6
S_PER_H = 3600.0


class Sample(NamedTuple):
    """A process at a moment."""

    time_s: float
    """[s] Since the soak began."""
    pid: int
    rss_mb: float
    """[MB] Resident memory."""
    files: int
    threads: int


class Growth(NamedTuple):
    """How much a process grew once it was warm."""

    memory_mb_per_h: float
    memory_mb: float
    """[MB] The slope's, over the time that was looked at."""
    files: int
    threads: int


def sample(time_s: float, pid: int) -> Sample | None:
    """Look at a process; None if it is gone."""
    with suppress(psutil.Error):
        process = psutil.Process(pid)
        with process.oneshot():
            rss_mb = process.memory_info().rss / BYTES_PER_MB
            return Sample(time_s, pid, rss_mb, process.num_fds(), process.num_threads())
    return None


def growth(samples: Sequence[Sample]) -> Growth:
    """Give how much a process grew, from the median of all pairs' slopes (Theil, 1950; Sen, 1968).

    Parameters
    ----------
    samples
        Of one process, in order; those taken before it was warm left out.
    """
    if len(samples) < 2:
        return Growth(0.0, 0.0, 0, 0)
    chosen = [
        samples[i] for i in np.linspace(0, len(samples) - 1, min(len(samples), 300)).astype(int)
    ]
    t = np.array([s.time_s for s in chosen])
    m = np.array([s.rss_mb for s in chosen])
    i, j = np.triu_indices(len(t), k=1)
    apart = t[j] > t[i]
    slope = float(np.median((m[j] - m[i])[apart] / (t[j] - t[i])[apart])) if apart.any() else 0.0
    tenth = max(1, len(chosen) // 10)
    first, last = chosen[:tenth], chosen[-tenth:]
    return Growth(
        slope * S_PER_H,
        slope * float(t[-1] - t[0]),
        min(s.files for s in last) - max(s.files for s in first),
        min(s.threads for s in last) - max(s.threads for s in first),
    )
