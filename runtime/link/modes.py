"""ArduPilot Rover's modes by number (`custom_mode` of its heartbeat)."""

from __future__ import annotations

MANUAL = 0
HOLD = 4
INITIALISING = 16

NAMES = {
    0: "MANUAL",
    1: "ACRO",
    3: "STEERING",
    4: "HOLD",
    5: "LOITER",
    6: "FOLLOW",
    7: "SIMPLE",
    8: "DOCK",
    9: "CIRCLE",
    10: "AUTO",
    11: "RTL",
    12: "SMART_RTL",
    15: "GUIDED",
    16: "INITIALISING",
}
"""https://ardupilot.org/rover/docs/rover-control-modes.html, numbers from MAVLink ROVER_MODE."""


def mode_name(number: int | None) -> str:
    """Give a mode's name, "mode 42" for a number without one, "unknown" for None."""
    return "unknown" if number is None else NAMES.get(number, f"mode {number}")
