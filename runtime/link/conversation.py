"""Requests that are repeated until they are answered: a message may always be lost."""

from __future__ import annotations

import math

from twinscrew.runtime.link.commands import message_interval
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


class Wanted:
    """A message that the autopilot shall send at a rate; asked for again when it stops coming.

    Parameters
    ----------
    target, message_id, rate_hz
        Who shall send which message how often.
    """

    RETRY_S = 1.0
    """[s] Between two requests, and the shortest silence that counts as stopped."""

    def __init__(self, target: int, message_id: int, rate_hz: float) -> None:
        self._id = message_id
        self._request = message_interval(target, message_id, rate_hz)
        self._patience_s = max(self.RETRY_S, 5.0 / rate_hz)
        self._heard_s = -math.inf
        self._asked_s = -math.inf

    def heard(self, message_id: int, now_s: float) -> None:
        """Note a message that came."""
        if message_id == self._id:
            self._heard_s = now_s

    def ask(self, now_s: float) -> list[Message]:
        """Give the request if the message does not come."""
        if now_s - max(self._heard_s, self._asked_s) < self._patience_s:
            return []
        self._asked_s = now_s
        return [self._request]
