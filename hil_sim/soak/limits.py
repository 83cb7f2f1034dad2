"""What a soak measures and may not exceed: config/soak.toml, samples of processes, standstills."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections.abc import Sequence
from contextlib import suppress
from itertools import groupby
from pathlib import Path
from types import TracebackType
from typing import NamedTuple, Self

import numpy as np
import psutil

from twinscrew.hil_sim.children import undisturbed
from twinscrew.hil_sim.drivers.processes import ordinary
from twinscrew.hil_sim.faults.timeline import Span
from twinscrew.runtime.recording.settings import RecorderSettings
from twinscrew.runtime.settings import CONFIG_DIR, Count, Fraction, NonNegative, Positive, Settings
from twinscrew.runtime.settings import load as load_settings

SHIPPED = CONFIG_DIR / "soak.toml"


class Limits(Settings, frozen=True):
    """What a runtime that is well does not exceed."""

    memory_mb_per_h: Positive = 30.0
    """[MB/h] Growth of resident memory."""
    memory_slack_mb: NonNegative = 4.0
    """[MB] Less than this is no growth, however short the run."""
    files: NonNegative = 4
    """[-] File handles more than when it was warm."""
    threads: NonNegative = 4
    """[-] Threads more, likewise."""
    missed_share: Fraction = 0.001
    """[-] Of decisions, while no fault acts on the vessel and the machine runs, that came later
    than the next scan."""
    judged_share: Fraction = 0.5
    """[-] Of a vessel's faults, at least, that can be judged: it was under way, the machine ran."""
    standstill_share: Fraction = 0.01
    """[-] Of the time that a core stood still, at most: what was measured is worth little else."""


class SoakSettings(Settings, frozen=True):
    """A soak."""

    vessels: Count = 3
    """[-] Only the first one's runtime is ever killed."""
    sample_s: Positive = 2.0
    """[s] Between two samples of memory, file handles and threads."""
    pause_s: tuple[NonNegative, Positive] = (2.0, 8.0)
    """[s] Between two faults, at least and at most."""
    warm_share: Fraction = 0.4
    """[-] Share of the run after which growth counts."""
    limits: Limits = Limits()
    recording: RecorderSettings = RecorderSettings(rotate_mb=10.0, rotate_s=60.0, quota_mb=100.0)


def load_soak() -> SoakSettings:
    """Read the shipped settings."""
    return load_settings(SHIPPED, SoakSettings)


# -- What a process takes: sampled while it runs, judged when it is over.

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


# -- When the machine stood still: a watchman on every core, more urgent than the runtimes.
#
# He sleeps for a moment, again and again. When he wakes late, nothing of lower priority has run on
# his core meanwhile: its host took it away, or the kernel did (of every second it grants real-time
# programs 95 %). What a boat was late for then is not its own doing. One that keeps its cores busy
# does not hold him up.

FIFO = 20
"""[-] Real-time priority, above the runtimes' 10; without the right to it he is like any other."""
LOOK_S = 0.01
"""[s] How long he sleeps."""
LATE_S = 0.02
"""[s] So late is a standstill: less than half a tick of the runtimes' loop."""


class Watch:
    """Watchmen, one a core; a context."""

    def __init__(self, folder: Path) -> None:
        """Prepare them; they write down what they see in `folder`."""
        cores = sorted(os.sched_getaffinity(0))
        self.files = {core: folder / f"core{core}.txt" for core in cores}
        """What each writes down."""
        self._processes: list[subprocess.Popen[bytes]] = []

    def __enter__(self) -> Self:
        try:
            with undisturbed():
                for core, file in self.files.items():
                    words = [sys.executable, "-m", __name__, str(core), str(file)]
                    with ordinary():
                        self._processes.append(subprocess.Popen(words))
        except BaseException:
            self._bury()
            raise
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self._bury()

    def _bury(self) -> None:
        for process in self._processes:
            process.kill()
            process.wait()

    @property
    def pids(self) -> list[int]:
        """The watchmen's process ids."""
        return [process.pid for process in self._processes]

    def standstills(self) -> list[Span]:
        """Give when a core stood still, by the monotonic clock, in order."""
        lines = [line for file in self.files.values() for line in _whole_lines(file)]
        return sorted(Span(*map(float, line.split())) for line in lines)


def watch(core: int, file: Path) -> None:
    """Watch a core, and write a line for every standstill: from when to when [s]."""
    with suppress(OSError):
        os.sched_setaffinity(0, [core])
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(FIFO))
    with file.open("w", buffering=1) as diary:
        while True:
            due_s = time.monotonic() + LOOK_S
            time.sleep(LOOK_S)
            woke_s = time.monotonic()
            if woke_s - due_s > LATE_S:
                diary.write(f"{due_s:.6f} {woke_s:.6f}\n")


def within(standstills: list[Span], begin_s: float, end_s: float) -> float:
    """Give how much [s] of a time the cores stood still, of both together."""
    return sum(
        max(0.0, min(span.end_s, end_s) - max(span.begin_s, begin_s)) for span in standstills
    )


def _whole_lines(file: Path) -> list[str]:
    if not file.exists():  # nothing was written before he was told to go
        return []
    return [line for line in file.read_text().splitlines(keepends=True) if line.endswith("\n")]


if __name__ == "__main__":
    watch(int(sys.argv[1]), Path(sys.argv[2]))
