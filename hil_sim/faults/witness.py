"""Who looks at the boat from outside: its propellers, its autopilot, what it says in public."""

from __future__ import annotations

import time
from collections.abc import Callable
from contextlib import suppress

import numpy as np

from twinscrew.hil_sim.faults.pilot import Bridge
from twinscrew.runtime.bus.base import Received
from twinscrew.runtime.errors import MessageError
from twinscrew.runtime.messages import cdr
from twinscrew.runtime.messages.types import Float64, HealthEvent


class Witness:
    """Remembers of one vessel what changed, and when [s] by the system's monotonic clock."""

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self.turns: list[tuple[float, bool]] = []
        """When the propellers were asked to turn, or to stand still."""
        self.events: list[tuple[float, HealthEvent]] = []
        """What the runtime said on `diagnostics`, when it came over the bus."""
        self.decisions = 0
        """[-] That came over the bus, if anybody asked to count them."""
        self.bridge = Bridge("", armed=False)
        """What the autopilot shows now."""
        self._clock = clock

    def look(self, thrust_N: Float64, bridge: Bridge) -> None:
        """See what the autopilot asks of the propellers, (2,) [N]."""
        turning = bool(np.any(thrust_N != 0.0))
        if not self.turns or self.turns[-1][1] != turning:
            self.turns.append((self._clock(), turning))
        self.bridge = bridge

    def hear(self, message: Received) -> None:
        """Take health events from the bus; in its thread."""
        with suppress(MessageError):
            now_s = self._clock()
            self.events += [(now_s, event) for event in cdr.decode_diagnostics(message.payload)]

    def count(self, message: Received) -> None:  # noqa: ARG002
        """Take note of a decision on the bus; in its thread."""
        self.decisions += 1

    def turning(self, at_s: float) -> bool:
        """Tell whether the propellers turned at a time."""
        return next((turning for t, turning in reversed(self.turns) if t <= at_s), False)

    def still_since(self, begin_s: float, end_s: float) -> float | None:
        """Give when [s] the propellers stopped for good between two times; None: they turn."""
        if self.turning(end_s):
            return None
        stops = [t for t, turning in self.turns if begin_s < t <= end_s and not turning]
        return stops[-1] if stops else begin_s

    def rests(self, begin_s: float, end_s: float) -> list[tuple[float, float]]:
        """Give from when to when [s] the propellers stood still, of rests that began in between."""
        ends = [t for t, _ in self.turns[1:]] + [end_s]
        return [
            (t, min(until, end_s))
            for (t, turning), until in zip(self.turns, ends, strict=False)
            if not turning and begin_s <= t <= end_s
        ]

    def turning_from(self, begin_s: float) -> float | None:
        """Give when [s] the propellers turned first from a time on; None: never."""
        if self.turning(begin_s):
            return begin_s
        return next((t for t, turning in self.turns if t > begin_s and turning), None)

    def heard(self, name: str, since_s: float) -> float | None:
        """Give when [s] an event of this name came first since a time; None: never."""
        return next((t for t, e in self.events if e.name == name and t >= since_s), None)

    def states(self, begin_s: float, end_s: float) -> set[str]:
        """Give the states that the boat said it was in between two times, as "safe"."""
        changes = [(t, e.detail.split(" -> ")[-1]) for t, e in self.events if e.name == "state"]
        before = [state for t, state in changes if t <= begin_s]
        return {*before[-1:], *(state for t, state in changes if begin_s < t <= end_s)}
