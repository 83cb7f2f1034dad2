"""The health events of the estimation, by names that scripts can rely on, and when to tell them."""

from __future__ import annotations

from typing import Final

from twinscrew.runtime.messages.types import NANOSECONDS_PER_SECOND, HealthEvent, Severity
from twinscrew.runtime.safety.events import EventKind

ESTIMATE_READY: Final = EventKind(
    "estimate_ready", Severity.INFO, "Position and heading are known well enough to sail by."
)
GPS_LOST: Final = EventKind(
    "gps_lost",
    Severity.WARNING,
    "No fix that can be used for too long: the estimate coasts; told every second.",
)
GPS_BACK: Final = EventKind("gps_back", Severity.INFO, "Fixes are used again.")
GPS_DISAGREES: Final = EventKind(
    "gps_disagrees",
    Severity.WARNING,
    "Fixes lay too far from the estimate for too long: it starts from them anew.",
)
HEADING_UNKNOWN: Final = EventKind(
    "heading_unknown", Severity.ERROR, "The IMU tells no attitude: there is no odometry."
)
ESTIMATE_LOST: Final = EventKind(
    "estimate_lost", Severity.ERROR, "The position is too uncertain: there is no odometry."
)
IMU_GAP: Final = EventKind(
    "imu_gap", Severity.WARNING, "The IMU was silent for too long: the estimate starts anew."
)

KINDS: Final = (
    ESTIMATE_READY,
    GPS_LOST,
    GPS_BACK,
    GPS_DISAGREES,
    HEADING_UNKNOWN,
    ESTIMATE_LOST,
    IMU_GAP,
)

REMIND_NS: Final = NANOSECONDS_PER_SECOND
"""[ns] How often a lasting trouble is told."""


class Notes:
    """What is to be told."""

    def __init__(self) -> None:
        self._events: list[HealthEvent] = []
        self._told_ns: dict[str, int] = {}

    def add(self, event: HealthEvent) -> None:
        """Tell something."""
        self._events.append(event)

    def lasting(self, event: HealthEvent) -> None:
        """Tell of a lasting trouble: when it begins, and every second."""
        told_ns = self._told_ns.get(event.name)
        if told_ns is None or not 0 <= event.stamp_ns - told_ns < REMIND_NS:
            self._told_ns[event.name] = event.stamp_ns
            self._events.append(event)

    def over(self, kind: EventKind) -> None:
        """Note that a lasting trouble has ended."""
        self._told_ns.pop(kind.name, None)

    def take(self) -> tuple[HealthEvent, ...]:
        """Give what was noted since the last call."""
        events, self._events = tuple(self._events), []
        return events
