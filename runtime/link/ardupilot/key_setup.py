"""Puts the key that signs MAVLink frames into an autopilot, once, and looks whether it took it.

SETUP_SIGNING carries the key in the clear: whoever listens on that line has it. So this is no part
of the link that drives the boat, and is done by hand, over a cable (`twinscrew signing setup`).
Bytes in, bytes out, time as an argument. Source: ArduPilot, libraries/GCS_MAVLink/GCS_Signing.cpp.
"""

from __future__ import annotations

import math
from enum import Enum

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from twinscrew.runtime.link.ardupilot.commands import HEARTBEAT_S, heartbeat
from twinscrew.runtime.mavlink import Message, Refusal, Signing, Wire

FIND_S = 10.0
"""[s] How long an autopilot is looked for."""
CONFIRM_S = 5.0
"""[s] How long it may take to sign its first frame with the new key."""


class Step(Enum):
    """How far it has come."""

    LOOKING = "looking for the autopilot"
    CONFIRMING = "the key is sent"
    DONE = "the autopilot signs with the key"
    HAS_IT = "the autopilot has this key already"
    REFUSED = "refused"


class KeySetup:
    """Gives one autopilot a key.

    Parameters
    ----------
    key
        The new one.
    system_id, component_id
        The vehicle's id, and ours on it.
    old
        The key that the autopilot signs with now; None if it has none.
    """

    def __init__(
        self, key: Signing, system_id: int, component_id: int, old: Signing | None = None
    ) -> None:
        self.step = Step.LOOKING
        self.why = ""
        """Why it was refused."""
        self._key = key
        self._system_id = system_id
        self._now = Wire(system_id, component_id, old)
        self._then = Wire(system_id, component_id, key)
        self._begun_s: float | None = None
        self._beat_s = -math.inf
        self._sent_s = math.inf
        self._texts: list[str] = []

    @property
    def over(self) -> bool:
        """Whether there is nothing left to do."""
        return self.step in (Step.DONE, Step.HAS_IT, Step.REFUSED)

    def go(self, data: bytes, now_s: float) -> bytes:
        """Take what came, and give what is to be sent."""
        if self._begun_s is None:
            self._begun_s = now_s
        signed = any(_is_the_autopilots(message) for message in self._then.decode(data))
        heard = self._now.decode(data)
        self._texts += [message.text for message in heard if message.get_type() == "STATUSTEXT"]
        if self.step is Step.CONFIRMING:
            self._confirm(signed, now_s)
        elif not self.over:
            return self._look(signed, heard, now_s)
        return b""

    def _look(self, signed: bool, heard: list[Message], now_s: float) -> bytes:
        """Look who is there, and send the key to a disarmed ArduPilot that can take it."""
        assert self._begun_s is not None  # noqa: S101  (`go` set it)
        if signed:
            self.step = Step.HAS_IT
            return b""
        beats = [m for m in heard if m.get_type() == "HEARTBEAT" and _is_the_autopilots(m)]
        if beats:
            return self._send(beats[-1], now_s)
        if now_s - self._begun_s > FIND_S:
            self._refuse(self._why_not_found())
        if now_s - self._beat_s < HEARTBEAT_S:
            return b""
        self._beat_s = now_s
        return self._now.encode(heartbeat())  # TCP and UDP servers answer who has spoken

    def _send(self, beat: Message, now_s: float) -> bytes:
        if beat.autopilot != mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA:
            self._refuse("what answers is no ArduPilot")
        elif beat.base_mode & mavlink.MAV_MODE_FLAG_SAFETY_ARMED:
            self._refuse("the autopilot is armed: it takes no key; disarm it")
        elif self._now.hears_signed and not self._now.signs:
            self._refuse("the autopilot signs already, with another key: give it as --old-key")
        if self.over:
            return b""
        self.step, self._sent_s, self._texts = Step.CONFIRMING, now_s, []
        return self._now.encode(
            mavlink.MAVLink_setup_signing_message(
                self._system_id,
                mavlink.MAV_COMP_ID_AUTOPILOT1,
                list(self._key.key),
                self._key.now(),
            )
        )

    def _confirm(self, signed: bool, now_s: float) -> None:
        refusal = next((text for text in self._texts if "signing" in text.lower()), None)
        if signed:
            self.step = Step.DONE
        elif refusal is not None:
            self._refuse(f"the autopilot says: {refusal}")
        elif now_s - self._sent_s > CONFIRM_S:
            self._refuse(
                f"no frame signed with the key came within {CONFIRM_S:g} s; it was sent once, and "
                "may have been lost: try again"
            )

    def _why_not_found(self) -> str:
        refused = self._now.refused
        if refused[Refusal.OTHER_KEY]:
            return "the autopilot signs with neither --key nor --old-key"
        if refused[Refusal.UNSIGNED]:
            return "the autopilot does not sign: leave out --old-key"
        if self._now.old_frames:
            return "it speaks MAVLink 1, which cannot be signed: set SERIALn_PROTOCOL to 2"
        return f"no autopilot of system id {self._system_id} is heard"

    def _refuse(self, why: str) -> None:
        self.step, self.why = Step.REFUSED, why


def _is_the_autopilots(message: Message) -> bool:
    return bool(message.get_srcComponent() == mavlink.MAV_COMP_ID_AUTOPILOT1)
