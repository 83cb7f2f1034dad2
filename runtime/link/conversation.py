"""Requests that are repeated until they are answered: a message may always be lost."""

from __future__ import annotations

import math

from twinscrew.runtime.link.wire import Message


class Retried:
    """A command that is sent again and again while it is wanted.

    Parameters
    ----------
    message
        The command.
    every_s
        [s] Between two tries.
    """

    def __init__(self, message: Message, every_s: float) -> None:
        self._message = message
        self._every_s = every_s
        self._last_s = -math.inf
        self.refusal: int | None = None
        """MAV_RESULT of the last refusal; None if there was none, or it was accepted since."""
        self.reason = ""
        """Why, in the autopilot's own words; empty if it said nothing."""

    def ask(self, now_s: float) -> list[Message]:
        """Give the command if it is time for the next try."""
        if now_s - self._last_s < self._every_s:
            return []
        self._last_s = now_s
        return [self._message]

    def answered(self, result: int) -> None:
        """Take the answer, a MAV_RESULT."""
        self.refusal = None if result == 0 else result
        if result == 0:
            self.reason = ""
