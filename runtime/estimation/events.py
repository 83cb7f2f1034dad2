"""The health events of the estimation, by names that scripts can rely on."""

from __future__ import annotations

from typing import Final

from twinscrew.runtime.messages.types import Severity
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
