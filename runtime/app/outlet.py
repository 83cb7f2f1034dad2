"""Where everything that a vessel's runtime tells goes: the bus, the recorder, the hash."""

from __future__ import annotations

import time
from collections.abc import Callable
from contextlib import suppress

from twinscrew.runtime.app.recorder import Recorder
from twinscrew.runtime.app.recording import DecisionHash
from twinscrew.runtime.app.transforms import Frames
from twinscrew.runtime.app.wake import Wake
from twinscrew.runtime.bus.base import Bus
from twinscrew.runtime.errors import BusError
from twinscrew.runtime.messages import cdr
from twinscrew.runtime.messages.types import (
    NANOSECONDS_PER_SECOND,
    Decision,
    Explanation,
    Float64,
    HealthEvent,
)
from twinscrew.runtime.safety.events import AUTOPILOT_NOW, STATE_NOW

STATE_EVERY_NS = NANOSECONDS_PER_SECOND
"""[ns] How often the state is told while it stays as it is."""


class Losses:
    """Remembers which losses were told, so that a flood of them is not a flood of words."""

    def __init__(self) -> None:
        self._told = 0

    def grew(self, count: int) -> bool:
        """Tell whether losses have begun, or doubled since they were told."""
        if count < max(1, 2 * self._told):
            return False
        self._told = count
        return True


class Outlet:
    """Publishes and records; counts and hashes the decisions."""

    def __init__(
        self,
        bus: Bus | None,
        recorder: Recorder | None,
        *,
        vessel: str = "",
        frames: Frames | None = None,
        clock_ns: Callable[[], int] = time.time_ns,
    ) -> None:
        """Tell things to a bus and a recorder, either of which may be missing.

        Parameters
        ----------
        vessel
            Whose health events these are.
        frames
            Follows where the frames are; None to record no transforms.
        clock_ns
            [ns] Gives the recording's log times; replays do not depend on them.
        """
        self.decisions = 0
        self._bus = bus
        self._recorder = recorder
        self._vessel = vessel
        self._frames = frames
        self._clock_ns = clock_ns
        self._hash = DecisionHash()
        self._wake = Wake()
        self._state_told_ns: int | None = None
        self._recorder_losses, self._bus_losses = Losses(), Losses()

    @property
    def sha256(self) -> str:
        """SHA-256 over the encoded decisions so far."""
        return self._hash.hexdigest()

    def record(self, topic: str, payload: bytes) -> None:
        """Keep a core input, before the core gets it, and tell the way that was sailed."""
        if self._recorder is not None:
            self._recorder.record(topic, payload, self._clock_ns())
            transforms = self._frames.see(topic, payload) if self._frames else None
            if transforms is not None:
                self._recorder.record("transforms", transforms, self._clock_ns())
        if topic == "odometry" and self.is_told:
            path = self._wake.see(payload)
            if path is not None:
                self._tell("path", path)

    def own_odometry(self, payload: bytes) -> None:
        """Keep odometry that came from the autopilot, and publish it: nobody else does."""
        self.record("odometry", payload)
        self._publish("odometry", payload)

    def engaged(self, payload: bytes) -> None:
        """Tell that the right to drive changed; it is a core input too, so tell it first."""
        self._tell("engagement", payload)

    def decided(
        self, decision: Decision, thrust: Float64, explanation: Explanation | None = None
    ) -> None:
        """Tell a decision, why it was made, what it was made of, and the thrust."""
        payload = cdr.encode_decision(decision)
        self._hash.add(payload)
        self.decisions += 1
        if not self.is_told:
            return
        self._tell("decision", payload)
        if explanation is not None:
            self._tell("explanation", cdr.encode_explanation(explanation))
        self._tell("objects", cdr.encode_object_markers(decision.objects))
        self._tell("tracks", cdr.encode_track_markers(decision.tracks))
        self.thrust(thrust)

    def happened(self, events: tuple[HealthEvent, ...]) -> None:
        """Tell health events."""
        if events:
            stamp_ns = max(event.stamp_ns for event in events)
            payload = cdr.encode_diagnostics(events, stamp_ns=stamp_ns, hardware_id=self._vessel)
            self._tell("diagnostics", payload)

    def state(self, state: str, stamp_ns: int, autopilot: str = "") -> None:
        """Tell the vessel's state once a second: who begins to look has not heard of its change.

        With it goes what is known of the autopilot, in words.
        """
        now_ns, told_ns = self._clock_ns(), self._state_told_ns
        if told_ns is None or not 0 <= now_ns - told_ns < STATE_EVERY_NS:
            self._state_told_ns = now_ns
            known = (AUTOPILOT_NOW.at(stamp_ns, autopilot),) if autopilot else ()
            self.happened((STATE_NOW.at(stamp_ns, state), *known))

    def thrust(self, thrust: Float64) -> None:
        """Tell what the propellers are asked for: a VRX takes it from here."""
        left, right = (float(side) for side in thrust)
        self._tell("thrust_left", cdr.encode_thrust(left))
        self._tell("thrust_right", cdr.encode_thrust(right))

    def recorder_trouble(self) -> str | None:
        """Say what the recorder has lost: when it begins, and each time the loss has doubled."""
        if self._recorder is None or not self._recorder_losses.grew(self._recorder.dropped):
            return None
        why = self._recorder.failure or "the disk cannot follow"
        return f"{self._recorder.dropped} messages lost: {why}"

    def bus_trouble(self) -> str | None:
        """Say what of the bus did not reach us: when it begins, and each time it has doubled."""
        missing = {} if self._bus is None else self._bus.missing
        if not self._bus_losses.grew(sum(missing.values())):
            return None
        return ", ".join(f"{count} {what}" for what, count in missing.items())

    @property
    def is_told(self) -> bool:
        """Whether anybody is told anything."""
        return self._bus is not None or self._recorder is not None

    def _tell(self, topic: str, payload: bytes) -> None:
        self._publish(topic, payload)
        if self._recorder is not None:
            self._recorder.record(topic, payload, self._clock_ns())

    def _publish(self, topic: str, payload: bytes) -> None:
        if self._bus is not None:
            with suppress(BusError):  # a broken bus must not stop the loop: it cannot be told by it
                self._bus.publish(topic, payload)
