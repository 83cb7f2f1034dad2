"""Tells systemd that the loop is alive, so that it is started anew if it hangs.

The protocol is sd_notify(3): lines of KEY=VALUE in a datagram to the socket that $NOTIFY_SOCKET
names. Outside of systemd there is no such socket, and nothing is sent.
"""

from __future__ import annotations

import os
import socket
from collections.abc import Mapping
from contextlib import suppress
from typing import Final

SHARE: Final = 0.25
"""[-] Of the watchdog's time; sd_watchdog_enabled(3) recommends at most a half."""
MICROSECONDS: Final = 1e-6


class ServiceManager:
    """Who started us, and wants to hear from us. Never blocks, never raises."""

    def __init__(self, environment: Mapping[str, str] = os.environ) -> None:
        """Find out who listens.

        Parameters
        ----------
        environment
            Holds NOTIFY_SOCKET if somebody does, WATCHDOG_USEC if silence is fatal, and
            WATCHDOG_PID if that is meant for one process only.
        """
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
