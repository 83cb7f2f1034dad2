"""Programs that a run starts: none outlives it, however it ends."""

from __future__ import annotations

import signal
import subprocess
import threading
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from types import FrameType
from typing import Any


@contextmanager
def undisturbed() -> Iterator[None]:
    """Put off Ctrl-C and a request to end until the context is left.

    Between a program's start and the note of it there is a moment in which an exception would leave
    it behind, running and known to nobody.
    """
    if threading.current_thread() is not threading.main_thread():
        yield  # signals are the main thread's
        return
    came: list[int] = []

    def note(number: int, _frame: FrameType | None) -> None:
        came.append(number)

    before = {number: signal.signal(number, note) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, signal.SIG_DFL if handler is None else handler)
        for late in came:
            signal.raise_signal(late)


def end(process: subprocess.Popen[Any], patience_s: float) -> None:
    """Ask a program to end, wait for it [s], and see to it."""
    end_all([process], patience_s)


def end_all(processes: Sequence[subprocess.Popen[Any]], patience_s: float) -> None:
    """Ask programs to end, wait for all of them together [s], and see to it."""
    for process in processes:
        process.terminate()
    until_s = time.monotonic() + patience_s
    for process in processes:
        try:
            process.wait(max(0.0, until_s - time.monotonic()))
        except subprocess.TimeoutExpired:
            process.kill()
    for process in processes:
        process.wait()
