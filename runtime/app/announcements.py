"""Health events as a ground station shows them: plain words, not too many of them."""

from __future__ import annotations

import math
from collections.abc import Iterable

from twinscrew.runtime.estimation import estimator as estimation_events
from twinscrew.runtime.link.ardupilot import events as link_events
from twinscrew.runtime.messages.types import HealthEvent, Severity
from twinscrew.runtime.safety import events as safety_events
from twinscrew.runtime.safety.events import EventKind

AGAIN_S = 10.0
"""[s] The same event is said once in this time, unless it says something else."""
AT_ONCE = 8
"""[-] Texts that may wait; more at a time nobody reads, and a slow radio would fill up."""
SILENT = frozenset(
    kind.name for kind in (link_events.AUTOPILOT_SAYS, safety_events.STATE, safety_events.STATE_NOW)
)
"""Events that stations know already: the autopilot's own words, and what follows from others."""
MEANINGS = {
    kind.name: kind.meaning
    for module in (safety_events, link_events, estimation_events)
    for kind in vars(module).values()
    if isinstance(kind, EventKind)
}


class Announcements:
    """Chooses what is said, and when."""

    def __init__(self) -> None:
        self._waiting: list[tuple[str, Severity]] = []
        self._said_s: dict[tuple[str, str], float] = {}

    def happened(self, events: Iterable[HealthEvent], now_s: float) -> None:
        """Take events as they happen."""
        for event in events:
            told = (event.name, words_of(event))
            silent = event.name in SILENT
            if silent or now_s - self._said_s.get(told, -math.inf) < AGAIN_S:
                continue
            self._said_s = {key: at for key, at in self._said_s.items() if now_s - at < AGAIN_S}
            self._said_s[told] = now_s
            self.say(told[1], event.severity)

    def say(self, text: str, severity: Severity) -> None:
        """Say something else."""
        if len(self._waiting) < AT_ONCE:
            self._waiting.append((text, severity))

    def take(self) -> list[tuple[str, Severity]]:
        """Give what is to be said now: one text a call."""
        now, self._waiting = self._waiting[:1], self._waiting[1:]
        return now


def words_of(event: HealthEvent) -> str:
    """Give an event in plain words: what it means, and what there is to say about it."""
    meaning = MEANINGS.get(event.name, event.name)
    return f"{meaning} ({event.detail})" if event.detail else meaning
