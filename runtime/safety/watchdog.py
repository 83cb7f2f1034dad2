"""Watches that inputs keep coming: an input is as old as its last *new* message.

A message whose stamp does not advance (a frozen driver, a repeated packet) is not news.
Time is the caller's: monotonic seconds on a boat, simulated seconds in lock-step.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from twinscrew.runtime.messages.types import HealthEvent
from twinscrew.runtime.safety.events import INPUT_RECOVERED, EventKind


@dataclass(slots=True)
class _Input:
    kind: EventKind
    greatest_age_s: float
    last_stamp_ns: int | None = None
    last_seen_s: float | None = None
    stale: bool = True


class Watchdog:
    """Knows which of the inputs it was given are stale."""

    def __init__(self, inputs: Mapping[str, tuple[EventKind, float]]) -> None:
        """Watch inputs: a name, the event when it is stale, and its greatest age [s]."""
        self._inputs = {name: _Input(kind, age) for name, (kind, age) in inputs.items()}

    @property
    def stale(self) -> tuple[str, ...]:
        """The names of the inputs that were stale, or had never come, at the last check."""
        return tuple(name for name, watched in self._inputs.items() if watched.stale)

    @property
    def all_heard(self) -> bool:
        """Whether every input has come at least once."""
        return all(watched.last_seen_s is not None for watched in self._inputs.values())

    def seen(self, name: str, stamp_ns: int, now_s: float) -> None:
        """Note a message; one of an input that is not watched, or no newer one, is ignored."""
        watched = self._inputs.get(name)
        if watched is None or stamp_ns == watched.last_stamp_ns:
            return
        watched.last_stamp_ns, watched.last_seen_s = stamp_ns, now_s

    def check(self, now_s: float, stamp_ns: int) -> list[HealthEvent]:
        """Look at every input; give an event for each that became stale or fresh again."""
        events = []
        for name, watched in self._inputs.items():
            never = watched.last_seen_s is None
            age_s = 0.0 if watched.last_seen_s is None else now_s - watched.last_seen_s
            stale = never or age_s > watched.greatest_age_s
            if stale != watched.stale:
                watched.stale = stale
                detail = f"{name}: {age_s:.2f} s old, allowed {watched.greatest_age_s:g} s"
                kind = watched.kind if stale else INPUT_RECOVERED
                events.append(kind.at(stamp_ns, detail if stale else name))
        return events
