"""What the runtime asks of the system that it runs on, and how it is asked to end.

Priority and cores, the garbage collector, systemd's watchdog, signals, and the end of whoever
started it.
"""

from __future__ import annotations

import gc
import os
import socket
import sys
import threading
from collections.abc import Callable, Mapping
from contextlib import suppress
from types import TracebackType
from typing import Annotated, Final, Self

from msgspec import Meta

from twinscrew.runtime.settings import Settings

SWITCH_S: Final = 0.0005
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


def take_priority(settings: PrioritySettings) -> tuple[str, ...]:
    """Take priority and cores for this thread and all that it starts; say what was refused.

    It is called before the bus opens its threads, because threads inherit from the one that starts
    them: the bus's, the recorder's and the loop's must not wait for each other behind somebody
    else's program.

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


EVERY_S: Final = 1.0
"""[s] Between two collections of what is young, and"""
OLD_EVERY: Final = 30
"""[-] after so many of those one of everything that came since the start."""
ALL: Final = 2
"""The collector's oldest generation."""


class Garbage:
    """A context in which Python's cyclic garbage collector runs only when `collect` is called.

    By itself it would run in the middle of whatever allocates. Here what start-up made is never
    looked at again, and what came since is collected once a second, right after a tick, when
    nothing is due for a while. Afterwards the collector is as before.
    """

    def __init__(self) -> None:
        self._due_s = 0.0
        self._collections = 0

    def __enter__(self) -> Self:
        self._enabled = gc.isenabled()
        gc.collect()
        gc.freeze()
        gc.disable()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        gc.unfreeze()
        if self._enabled:
            gc.enable()

    def collect(self, now_s: float) -> bool:
        """Collect if it is time to; tell whether it was."""
        if now_s < self._due_s:
            return False
        self._due_s = now_s + EVERY_S
        self._collections += 1
        gc.collect(ALL if self._collections % OLD_EVERY == 0 else 0)
        return True


STANDARD_INPUT: Final = 0
SHARE: Final = 0.25
"""[-] Of the watchdog's time; sd_watchdog_enabled(3) recommends at most a half."""
MICROSECONDS: Final = 1e-6


class ServiceManager:
    """systemd, which starts the runtime anew if its loop hangs. Never blocks, never raises.

    The protocol is sd_notify(3): lines of KEY=VALUE in a datagram to the socket that $NOTIFY_SOCKET
    names. Outside of systemd there is no such socket, and nothing is sent.

    Parameters
    ----------
    environment
        Holds NOTIFY_SOCKET if somebody listens, WATCHDOG_USEC if silence is fatal, and WATCHDOG_PID
        if that is meant for one process only.
    """

    def __init__(self, environment: Mapping[str, str] = os.environ) -> None:
        self._address = _address(environment.get("NOTIFY_SOCKET", ""))
        self._every_s = SHARE * _watchdog_s(environment)
        self._next_s = float("-inf")
        self._said = ""

    def alive(self, now_s: float, status: str) -> None:
        """Say that the loop goes round; to be called by the loop itself, however often.

        Parameters
        ----------
        now_s
            [s] Monotonic clock.
        status
            One line for `systemctl status`, told when it changes.
        """
        words = []
        if not self._said:
            words.append("READY=1")
        if status != self._said:
            words.append(f"STATUS={status}")
            self._said = status
        if self._every_s > 0 and now_s >= self._next_s:
            words.append("WATCHDOG=1")
            self._next_s = now_s + self._every_s
        if words:
            self._send("\n".join(words))

    def stopping(self) -> None:
        """Say that the end has begun."""
        self._send("STOPPING=1")

    def _send(self, words: str) -> None:
        if not self._address:
            return
        # A service manager that went away, or does not read, is no reason to stop a boat.
        with suppress(OSError), socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as line:
            line.setblocking(False)
            line.sendto(words.encode(), self._address)


def _address(name: str) -> str:
    """Give the socket's address: a path, or an abstract name, which sd_notify(3) writes with @."""
    return f"\0{name[1:]}" if name.startswith("@") else name


def _watchdog_s(environment: Mapping[str, str]) -> float:
    """Give after how much silence we are ended [s]; 0: never."""
    if environment.get("WATCHDOG_PID", str(os.getpid())) != str(os.getpid()):
        return 0.0
    try:
        return max(0.0, int(environment.get("WATCHDOG_USEC", "0")) * MICROSECONDS)
    except ValueError:
        return 0.0


class StopRequest:
    """Is made once, and stays.

    It is no `threading.Event`: setting that takes a lock, and a second signal, whose handler runs
    in the middle of the first one's, would wait for ever for the lock which that one holds.
    """

    def __init__(self) -> None:
        self._is_made = False

    def make(self, *_signal: object) -> None:
        """Ask to stop; also as a signal's handler, and from any thread."""
        self._is_made = True

    def __call__(self) -> bool:
        """Tell whether somebody asked to stop."""
        return self._is_made


def at_end_of_input(do: Callable[[], object]) -> None:
    """Call something, in a thread of its own, when standard input ends.

    Who starts a program holds the other end of a pipe. It closes when that one ends, even if it
    is killed: nothing else tells of that.
    """
    threading.Thread(target=_wait, args=(do,), daemon=True, name="tether").start()


def _wait(do: Callable[[], object]) -> None:
    try:
        while os.read(STANDARD_INPUT, 4096):
            pass
    except OSError:
        pass  # closed already
    do()
