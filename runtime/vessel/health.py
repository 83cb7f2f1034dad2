"""The vessel's state, and what an operator is told about it.

The first that fits, from above; nothing else is remembered, so that any state but STANDBY may
follow any other::

    an input or the autopilot never heard --------------------------> STANDBY
    an input stale, the autopilot silent, a fault, or the
    surroundings not seen for long enough ---------------------------> SAFE
    not armed, not MANUAL, not obeyed; no goal, or all reached ------> READY
    a warning within the last second --------------------------------> DEGRADED
    else ------------------------------------------------------------> ACTIVE

SAFE and STANDBY mean neutral thrust. READY means that somebody else drives: the autopilot is
disarmed, a pilot has taken the mode, or there is nowhere to go. No state needs a restart to leave.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

from twinscrew.runtime.messages.types import HealthEvent, Severity
from twinscrew.runtime.safety.events import STATE


class State(Enum):
    """What the vessel is doing, in one word."""

    STANDBY = "standby"
    READY = "ready"
    ACTIVE = "active"
    DEGRADED = "degraded"
    SAFE = "safe"


@dataclass(frozen=True, slots=True, kw_only=True)
class Facts:
    """What the state follows from."""

    inputs_heard: bool
    """Every watched input, the autopilot among them, has come at least once."""
    inputs_fresh: bool
    """None of them is stale now."""
    may_drive: bool
    """The autopilot is armed, in the right mode, and obeys."""
    fault: bool
    """The policy, perception or the guard failed in the last decision, or the runtime itself."""
    knows_surroundings: bool
    """What is around has been seen for long enough since the start, or since it was forgotten."""
    has_goal: bool
    """There is a goal that is not reached yet."""
    warned: bool
    """A warning was raised in the last second."""


def state_of(facts: Facts) -> State:
    """Give the state that follows from the facts; the first that fits, worst first."""
    if not facts.inputs_heard:
        return State.STANDBY
    if not facts.inputs_fresh or facts.fault or not facts.knows_surroundings:
        return State.SAFE
    if not facts.may_drive or not facts.has_goal:
        return State.READY
    return State.DEGRADED if facts.warned else State.ACTIVE


class Health:
    """Remembers the state, gives an event for every transition, and keeps warnings for a second."""

    WARNING_HOLD_S = 1.0

    def __init__(self) -> None:
        self.state = State.STANDBY
        self._warned_until_s = float("-inf")

    def note(self, events: tuple[HealthEvent, ...], now_s: float) -> None:
        """Look at new events: a warning degrades the state for a while."""
        if any(event.severity is Severity.WARNING for event in events):
            self._warned_until_s = now_s + self.WARNING_HOLD_S

    def warned(self, now_s: float) -> bool:
        """Tell whether a warning is still fresh."""
        return now_s < self._warned_until_s

    def step(self, facts: Facts, stamp_ns: int) -> HealthEvent | None:
        """Follow the facts; give an event if the state changed."""
        state = state_of(facts)
        if state is self.state:
            return None
        change = STATE.at(stamp_ns, f"{self.state.value} -> {state.value}")
        self.state = state
        return change
