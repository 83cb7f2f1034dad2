"""Keeps a simulator on time while others use the machine: it stands for sensors and autopilots."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress

FIFO = 5
"""[-] Real-time priority, below the runtimes': a LiDAR is not late because a program is busy."""


@contextmanager
def punctual() -> Iterator[None]:
    """Have real-time priority inside it, where the system allows; what is started inherits it."""
    before = os.sched_getscheduler(0), os.sched_getparam(0)
    with suppress(PermissionError):
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(FIFO))
    try:
        yield
    finally:
        os.sched_setscheduler(0, *before)
