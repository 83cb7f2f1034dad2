"""From what the link knows to health events: each condition once when it begins, once when over."""

from __future__ import annotations

import math

from twinscrew.runtime.link import events
from twinscrew.runtime.link.listener import Listener
from twinscrew.runtime.link.parameters import GCS_ID, OTHER_NAMES
from twinscrew.runtime.link.status import AutopilotStatus
from twinscrew.runtime.messages.types import HealthEvent
from twinscrew.runtime.safety.events import GREATEST_DETAIL, EventKind

Holding = dict[EventKind, str]
"""The conditions that hold now, each with its detail in plain words."""


TOLD_AGAIN = frozenset(
    {events.MODE_TAKEN, events.PARAMETERS_WRONG, events.PARAMETERS_UNSAFE, events.OVERRIDE_IGNORED}
)
"""Conditions whose words matter: an event follows whenever they change."""


def conditions(status: AutopilotStatus, listener: Listener, now_s: float) -> Holding:
    """Give every condition that an operator should know."""
    if not status.connected:
        return {events.AUTOPILOT_SILENT: _silence(status)}
    if not status.is_boat:
        return {events.WRONG_VEHICLE: f"MAV_TYPE {status.vehicle_type}, must be 11 (FRAME_CLASS 2)"}
    authority, manual, arming = listener.authority, listener.manual, listener.arming
    holding: Holding = {}
    if status.pilot_has_it:
        holding[events.MODE_TAKEN] = _taken(status)
    if status.failsafe_hold:
        holding[events.FAILSAFE_HOLD] = "overrides had stopped"
    if authority.was_armed and not status.armed:
        holding[events.AUTOPILOT_DISARMED] = f"mode {status.mode}"
    if authority.asks_manual and manual.refusal is not None:
        holding[events.MODE_REFUSED] = f"result {manual.refusal} in mode {status.mode}"
    if authority.asks_arming and arming.refusal is not None:
        holding[events.ARMING_REFUSED] = arming.reason or f"result {arming.refusal}"
    if authority.arming_unknown and not authority.was_armed:
        holding[events.ARMING_REFUSED] = "no answer came, and messages were lost: arm it by hand"
    slow = [words for stream in listener.streams if (words := stream.refused(now_s)) is not None]
    if slow:
        holding[events.STREAM_SLOW] = "; ".join(slow)
    parameters = listener.parameters
    if parameters.done and parameters.wrong:
        holding[events.PARAMETERS_WRONG] = "; ".join(parameters.wrong)
    if parameters.done and parameters.unsafe:
        holding[events.PARAMETERS_UNSAFE] = "; ".join(parameters.unsafe)
    return holding


def why_ignored(listener: Listener, *, given_up: bool) -> str:
    """Say why the outputs do not follow, as far as the parameters show it."""
    parameters = listener.parameters
    ours = [words for words in parameters.wrong if words.startswith((GCS_ID, OTHER_NAMES[GCS_ID]))]
    causes = [*ours, *parameters.shaping]
    if causes:
        words = "; ".join(causes)
    elif parameters.has(GCS_ID):
        words = "the parameters that were read are right: is RCx_OPTION 46 or the safety switch on?"
    else:
        words = f"{GCS_ID} may be another system's id"
    return f"{words}; not tried again until something changes" if given_up else words


def _taken(status: AutopilotStatus) -> str:
    if status.mode != "MANUAL":
        return f"mode {status.mode}"
    return "mode MANUAL, but by a restart or a late request: choose another mode, then MANUAL"


class Conditions:
    """Remembers what held, and gives the changes."""

    def __init__(self) -> None:
        self._held: Holding = {}

    def changes(self, holding: Holding, stamp_ns: int) -> list[HealthEvent]:
        """Give an event for each condition that began, or is over."""
        begun = [
            kind.at(stamp_ns, part)
            for kind, words in holding.items()
            if kind not in self._held or (kind in TOLD_AGAIN and words != self._held[kind])
            for part in _parts(words)
        ]
        over = [
            events.AUTOPILOT_RECOVERED.at(stamp_ns, kind.name)
            for kind in self._held
            if kind not in holding
        ]
        self._held = holding
        return begun + over


def _parts(words: str) -> list[str]:
    """Divide a long list, so that no event's detail is cut."""
    parts = [""]
    for item in words.split("; "):
        if parts[-1] and len(parts[-1]) + len(item) + 2 > GREATEST_DETAIL:
            parts.append("")
        parts[-1] += f"; {item}" if parts[-1] else item
    return parts


def _silence(status: AutopilotStatus) -> str:
    if math.isfinite(status.message_age_s):
        return f"last message {status.message_age_s:.1f} s ago"
    if status.old_frames:
        return "it speaks MAVLink 1: set SERIALx_PROTOCOL to 2"
    if status.bad_frames:
        return f"{status.bad_frames} frames refused: damaged, or signed with another key"
    return "nothing heard yet"
