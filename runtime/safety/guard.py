"""The last check before the propellers, and the watch over inputs that no longer come."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np

from twinscrew.runtime.messages.types import NANOSECONDS_PER_SECOND, Float64, HealthEvent
from twinscrew.runtime.safety.events import GUARD_TRIPPED, INPUT_RECOVERED, EventKind
from twinscrew.runtime.settings import Settings
from twinscrew.runtime.vessel_description import load_vessel

NEUTRAL: Float64 = np.zeros(2)
NEUTRAL.setflags(write=False)


class ThrustLimits(Settings, frozen=True):
    """What one propeller can do; by default, what the vessel's description says."""

    min_n: float = load_vessel().thrusters.min_n
    """[N] Full astern."""
    max_n: float = load_vessel().thrusters.max_n
    """[N] Full ahead."""

    def clip(self, thrust: Float64) -> Float64:
        """Bring thrusts [N] into the range."""
        return np.clip(thrust, self.min_n, self.max_n)


class Guard:
    """Lets a thrust pass if both values are finite and in range; else zero and an event."""

    TOLERANCE_N = 1e-6
    """[N] Rounding that is no fault."""

    def __init__(self, limits: ThrustLimits | None = None) -> None:
        self.limits = limits or ThrustLimits()

    def check(self, thrust: Float64, stamp_ns: int) -> tuple[Float64, HealthEvent | None]:
        """Check a command, (2,) [N] left and right.

        Returns
        -------
        thrust : (2,) float64
            The same thrust, or zeros.
        event : HealthEvent or None
            `guard_tripped`, with the refused values, where zeros were put.
        """
        low, high = self.limits.min_n - self.TOLERANCE_N, self.limits.max_n + self.TOLERANCE_N
        if thrust.shape == (2,) and low <= thrust[0] <= high and low <= thrust[1] <= high:
            return thrust, None
        allowed = f"[{self.limits.min_n:g}, {self.limits.max_n:g}] N"
        return NEUTRAL, GUARD_TRIPPED.at(stamp_ns, f"thrust {thrust.tolist()} is not in {allowed}")


GAP_S: Final = 0.25
"""[s] A caller that was away for longer has perhaps not run at all: less than any input's greatest
age, and longer than two ticks."""
BACKLOG_S: Final = 0.5
"""[s] For this long after a gap what comes may have waited; then all of it has been read."""


@dataclass(slots=True)
class _Input:
    kind: EventKind
    greatest_age_s: float
    last_stamp_ns: int | None = None
    last_seen_s: float | None = None
    stale: bool = True


class Watchdog:
    """Knows which inputs are stale: an input is as old as its last message with a new stamp.

    A message whose stamp does not advance (a frozen driver, a repeated packet) is not new. Time is
    the caller's: monotonic seconds on a boat, simulated seconds in lock-step.

    After a gap in which the whole program stood still (SIGSTOP, a suspended machine, one call that
    took too long) messages come that have waited in a socket, and nothing tells when they arrived
    there. So what comes just after a gap counts only if its stamp has gone on as the clock has.
    """

    def __init__(self, inputs: Mapping[str, tuple[EventKind, float]]) -> None:
        """Watch inputs: a name, the event when it is stale, and its greatest age [s]."""
        self._inputs = {name: _Input(kind, age) for name, (kind, age) in inputs.items()}
        self._awake_s: float | None = None
        self._backlog_until_s = float("-inf")

    @property
    def stale(self) -> tuple[str, ...]:
        """The names of the inputs that were stale, or had never come, at the last check."""
        return tuple(name for name, watched in self._inputs.items() if watched.stale)

    @property
    def all_heard(self) -> bool:
        """Whether every input has come at least once."""
        return all(watched.last_seen_s is not None for watched in self._inputs.values())

    def awake(self, now_s: float) -> None:
        """Note that the caller runs; a long time since the last call is a gap."""
        if self._awake_s is not None and now_s - self._awake_s > GAP_S:
            self._backlog_until_s = now_s + BACKLOG_S
        self._awake_s = now_s

    def too_old(self, now_s: float) -> bool:
        """Tell whether an input that has come before is too old now; no event, no memory."""
        return any(
            watched.last_seen_s is not None and now_s - watched.last_seen_s > watched.greatest_age_s
            for watched in self._inputs.values()
        )

    def seen(self, name: str, stamp_ns: int, now_s: float) -> None:
        """Note a message.

        One of an input that is not watched, one that is no newer than the last, and one that has
        waited while the caller was away are ignored.
        """
        watched = self._inputs.get(name)
        if watched is None or stamp_ns == watched.last_stamp_ns:
            return
        waited_s = _waited_s(watched, stamp_ns, now_s) if now_s < self._backlog_until_s else 0.0
        if waited_s <= watched.greatest_age_s:
            watched.last_stamp_ns, watched.last_seen_s = stamp_ns, now_s - waited_s

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


def _waited_s(watched: _Input, stamp_ns: int, now_s: float) -> float:
    """[s] How long a message has waited: by how much its stamp went on less than the clock."""
    if watched.last_stamp_ns is None or watched.last_seen_s is None:
        return 0.0
    advanced_s = (stamp_ns - watched.last_stamp_ns) / NANOSECONDS_PER_SECOND
    return max(0.0, now_s - watched.last_seen_s - advanced_s)
