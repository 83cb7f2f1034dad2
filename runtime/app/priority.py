"""How urgent the runtime is to the system: real-time priority and cores, where that is allowed.

Taken before the bus opens its threads, because threads inherit from the one that starts them: the
bus's, the recorder's and the loop's must not wait for each other behind somebody else's program.
"""

from __future__ import annotations

import os
import sys
from typing import Annotated

from msgspec import Meta

from twinscrew.runtime.settings import Settings

SWITCH_S = 0.0005
"""[s] A thread that holds the interpreter lets another one go on after this; Python's own 5 ms are
the longest that the recorder could hold up a decision (measured: docs/safety.md)."""


class PrioritySettings(Settings, frozen=True):
    """How urgent the runtime's threads are to the system; what it refuses is told, and no error."""

    fifo: Annotated[int, Meta(ge=0, le=99)] = 10
    """[-] Real-time priority (SCHED_FIFO); 0: none. Needs LimitRTPRIO, CAP_SYS_NICE or root."""
    nice: Annotated[int, Meta(ge=-20, le=19)] = -10
    """[-] Where that is refused or 0: this nice value, lower is more urgent."""
    cpus: tuple[Annotated[int, Meta(ge=0, le=1023)], ...] = ()
    """[-] Cores to run on; empty: those that the system gives."""


def take(settings: PrioritySettings) -> tuple[str, ...]:
    """Take priority and cores for this thread and all that it starts; say what was refused.

    Returns
    -------
    tuple of str
        One sentence for each thing that the system did not allow; empty if it allowed all.
    """
    sys.setswitchinterval(SWITCH_S)
    refused = [_take_cores(settings.cpus), *_take_urgency(settings)]
    return tuple(words for words in refused if words)


def _take_cores(cpus: tuple[int, ...]) -> str:
    if not cpus:
        return ""
    try:
        os.sched_setaffinity(0, cpus)
    except OSError as error:
        return f"cores {', '.join(map(str, cpus))}: {error.strerror}"
    return ""


def _take_urgency(settings: PrioritySettings) -> list[str]:
    refused = []
    if settings.fifo:
        try:
            os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(settings.fifo))
        except OSError as error:
            refused.append(f"SCHED_FIFO {settings.fifo}: {error.strerror}")
        else:
            return []
    try:
        os.setpriority(os.PRIO_PROCESS, 0, settings.nice)
    except OSError as error:
        refused.append(f"nice {settings.nice}: {error.strerror}")
    return refused
