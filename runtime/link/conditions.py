"""From what the link knows to health events: each condition once when it begins, once when over."""

from __future__ import annotations

import math

from twinscrew.runtime.link import events
from twinscrew.runtime.link.authority import Authority
from twinscrew.runtime.link.conversation import Retried
from twinscrew.runtime.link.status import AutopilotStatus
from twinscrew.runtime.messages.types import HealthEvent
from twinscrew.runtime.safety.events import EventKind

Holding = dict[EventKind, str]
"""The conditions that hold now, each with its detail in plain words."""


def conditions(
    status: AutopilotStatus, authority: Authority, manual: Retried, arming: Retried
) -> Holding:
    """Give every condition that an operator should know."""
    if not status.connected:
        return {events.AUTOPILOT_SILENT: _silence(status)}
    if not status.is_boat:
        return {events.WRONG_VEHICLE: f"MAV_TYPE {status.vehicle_type}, must be 11 (FRAME_CLASS 2)"}
    holding: Holding = {}
    if status.pilot_has_it:
        holding[events.MODE_TAKEN] = f"mode {status.mode}"
    if status.failsafe_hold:
        holding[events.FAILSAFE_HOLD] = "overrides had stopped"
    if authority.was_armed and not status.armed:
        holding[events.AUTOPILOT_DISARMED] = f"mode {status.mode}"
    if authority.asks_manual and manual.refusal is not None:
        holding[events.MODE_REFUSED] = f"result {manual.refusal} in mode {status.mode}"
    if authority.asks_arming and arming.refusal is not None:
        holding[events.ARMING_REFUSED] = arming.reason or f"result {arming.refusal}"
    if status.obeying is False:
        holding[events.OVERRIDE_IGNORED] = (
            f"outputs are {status.outputs_us} us; SYSID_MYGCS may be another system's id"
        )
    if status.parameters_wrong:
        holding[events.PARAMETERS_WRONG] = "; ".join(status.parameters_wrong)
    return holding


class Conditions:
    """Remembers what held, and gives the changes."""

    def __init__(self) -> None:
        self._held: Holding = {}

    def changes(self, holding: Holding, stamp_ns: int) -> list[HealthEvent]:
        """Give an event for each condition that began, or is over."""
        begun = [kind.at(stamp_ns, words) for kind, words in holding.items() if self._is_new(kind)]
        over = [
            events.AUTOPILOT_RECOVERED.at(stamp_ns, kind.name)
            for kind in self._held
            if kind not in holding
        ]
        self._held = holding
        return begun + over

    def _is_new(self, kind: EventKind) -> bool:
        return kind not in self._held


def _silence(status: AutopilotStatus) -> str:
    if math.isfinite(status.message_age_s):
        return f"last message {status.message_age_s:.1f} s ago"
    if status.old_frames:
        return "it speaks MAVLink 1: set SERIALx_PROTOCOL to 2"
    if status.bad_frames:
        return f"{status.bad_frames} frames refused: damaged, or signed with another key"
    return "nothing heard yet"
