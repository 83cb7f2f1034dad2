"""The health events of the autopilot link, by name; docs/mavlink.md tells what each one means."""

from __future__ import annotations

from twinscrew.runtime.messages.types import Severity
from twinscrew.runtime.safety.events import EventKind

AUTOPILOT_SILENT = EventKind(
    "autopilot_silent", Severity.ERROR, "Nothing comes from the autopilot: neutral thrust."
)
AUTOPILOT_DISARMED = EventKind(
    "autopilot_disarmed", Severity.ERROR, "The autopilot was disarmed; only an operator arms again."
)
MODE_TAKEN = EventKind(
    "mode_taken", Severity.WARNING, "A pilot chose another mode: he has the boat until MANUAL."
)
FAILSAFE_HOLD = EventKind(
    "failsafe_hold", Severity.ERROR, "The autopilot's radio failsafe holds the boat."
)
OVERRIDE_IGNORED = EventKind(
    "override_ignored", Severity.ERROR, "The outputs do not follow the commands."
)
ARMING_REFUSED = EventKind("arming_refused", Severity.WARNING, "The autopilot refuses to arm.")
MODE_REFUSED = EventKind("mode_refused", Severity.WARNING, "The autopilot refuses MANUAL.")
WRONG_VEHICLE = EventKind(
    "wrong_vehicle", Severity.ERROR, "What answers is no ArduPilot boat: neutral thrust."
)
PARAMETERS_WRONG = EventKind(
    "parameters_wrong", Severity.WARNING, "Autopilot parameters are not what they must be."
)
PARAMETERS_UNSAFE = EventKind(
    "parameters_unsafe",
    Severity.ERROR,
    "Autopilot parameters on which safety rests are wrong: no driving, no arming.",
)
STREAM_SLOW = EventKind(
    "stream_slow", Severity.WARNING, "A message of the autopilot comes too seldom."
)
PARAMETERS_WRITTEN = EventKind(
    "parameters_written", Severity.INFO, "Autopilot parameters were put right."
)
MESSAGE_UNSENT = EventKind(
    "message_unsent", Severity.WARNING, "A message could not be written for the line: left out."
)
AUTOPILOT_RECOVERED = EventKind(
    "autopilot_recovered", Severity.INFO, "A condition of the autopilot link is over."
)
AUTOPILOT_SAYS = EventKind("autopilot_says", Severity.INFO, "The autopilot's own words.")

NAMES = frozenset(kind.name for kind in list(globals().values()) if isinstance(kind, EventKind))
"""Every event of the link."""
