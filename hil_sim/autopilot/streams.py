"""Who wants which message how often: a schedule without drift."""

from __future__ import annotations

import math

_SLACK_S = 1e-6
"""[s] A message is due if its time is nearer than this: simulated time is a sum of steps."""


class Streams:
    """Message ids with their intervals."""

    def __init__(self, intervals_s: dict[int, float]) -> None:
        self._defaults = dict(intervals_s)
        self._intervals = dict(intervals_s)
        self._due = dict.fromkeys(intervals_s, -math.inf)
        self._next = -math.inf

    def interval_s(self, message_id: int) -> float | None:
        """Give a message's interval [s], or None if it is not sent."""
        return self._intervals.get(message_id)

    def every(self, message_id: int, interval_s: float | None) -> None:
        """Send a message at an interval [s]; None stops it."""
        self._intervals.pop(message_id, None)
        self._due.pop(message_id, None)
        if interval_s is not None:
            self._intervals[message_id] = interval_s
            self._due[message_id] = self._next = -math.inf

    def reset(self, message_id: int) -> None:
        """Send a message as often as before anyone asked."""
        self.every(message_id, self._defaults.get(message_id))

    def at_once(self, message_id: int) -> None:
        """Make a scheduled message due now."""
        if message_id in self._due:
            self._due[message_id] = self._next = -math.inf

    def due(self, now_s: float) -> list[int]:
        """Give the messages to send now, and plan their next time."""
        if now_s + _SLACK_S < self._next:
            return []
        ready = [id_ for id_, due_s in self._due.items() if due_s <= now_s + _SLACK_S]
        for id_ in ready:
            planned = self._due[id_] + self._intervals[id_]
            behind = planned <= now_s + _SLACK_S
            self._due[id_] = now_s + self._intervals[id_] if behind else planned
        self._next = min(self._due.values(), default=math.inf)
        return ready
