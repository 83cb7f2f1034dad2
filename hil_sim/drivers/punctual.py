"""Keeps a simulator on time while others use the machine: it stands for sensors and autopilots.

What starts does so at ordinary priority: a second of imports would use up what the kernel grants
real-time programs (95 % of every second), and everybody would be held up for the rest of it.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress

FIFO = 5
"""[-] Real-time priority, below the runtimes': a LiDAR is not late because a program is busy."""


@contextmanager
def punctual() -> Iterator[None]:
    """Have real-time priority inside it, where the system allows; threads inherit it."""
    before = os.sched_getscheduler(0), os.sched_getparam(0)
    be_punctual()
    try:
        yield
    finally:
        os.sched_setscheduler(0, *before)


@contextmanager
def ordinary() -> Iterator[None]:
    """Have ordinary priority inside it: for starting programs, which inherit it."""
    before = os.sched_getscheduler(0), os.sched_getparam(0)
    os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
    try:
        yield
    finally:
        os.sched_setscheduler(0, *before)


def be_punctual() -> None:
    """Take real-time priority for good, where the system allows."""
    with suppress(PermissionError):
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(FIFO))


def is_punctual() -> bool:
    """Tell whether this thread has real-time priority."""
    return os.sched_getscheduler(0) == os.SCHED_FIFO
