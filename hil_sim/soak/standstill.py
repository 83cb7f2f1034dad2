"""When the machine stood still: a watchman on every core, more urgent than the runtimes.

He sleeps for a moment, again and again. When he wakes late, nothing of lower priority has run on
his core meanwhile: its host took it away, or the kernel did (of every second it grants real-time
programs 95 %). What a boat was late for then is not its own doing. One that keeps its cores busy
does not hold him up.
"""

from __future__ import annotations

import os
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path
from types import TracebackType
from typing import Self

from twinscrew.hil_sim.children import undisturbed
from twinscrew.hil_sim.drivers.punctual import ordinary
from twinscrew.hil_sim.faults.timeline import Span

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
