"""What a process takes: sampled while it runs, judged when it is over."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from itertools import groupby
from typing import NamedTuple

import numpy as np
import psutil

BYTES_PER_MB = 1e6
S_PER_H = 3600.0
WINDOW_S = 60.0
"""[s] In which memory may come and go."""


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
    """Give how much a process grew.

    Memory: the least of every minute, so that what is given back (a recording's index, with every
    file) is no growth; of these the median of all pairs' slopes (Theil, 1950; Sen, 1968). File
    handles and threads: those that stay.

    Parameters
    ----------
    samples
        Of one process, in order; those taken before it was warm left out.
    """
    if not samples:
        return Growth(0.0, 0.0, 0, 0)
    least = _least_by_minute(samples)
    t = np.array([sample.time_s for sample in least])
    m = np.array([sample.rss_mb for sample in least])
    i, j = np.triu_indices(len(t), k=1)
    slope = float(np.median((m[j] - m[i]) / (t[j] - t[i]))) if len(i) else 0.0
    tenth = max(1, len(samples) // 10)
    first, last = samples[:tenth], samples[-tenth:]
    return Growth(
        slope * S_PER_H,
        slope * float(t[-1] - t[0]),
        min(s.files for s in last) - max(s.files for s in first),
        min(s.threads for s in last) - max(s.threads for s in first),
    )


def _least_by_minute(samples: Sequence[Sample]) -> list[Sample]:
    """Give the sample with the least memory of every whole minute."""
    begin_s = samples[0].time_s
    minutes = groupby(samples, key=lambda sample: int((sample.time_s - begin_s) // WINDOW_S))
    whole = int((samples[-1].time_s - begin_s) // WINDOW_S)
    return [
        min(group, key=lambda sample: sample.rss_mb)
        for minute, group in minutes
        if minute < max(1, whole)
    ]
