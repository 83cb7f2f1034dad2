"""What a vessel gives for every message and tick, and where it goes: bus, recorder, hash."""

from __future__ import annotations

import math
import time
from collections import deque
from collections.abc import Callable, Iterable
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np

from twinscrew.runtime.bus.base import Bus
from twinscrew.runtime.errors import BusError
from twinscrew.runtime.geometry import flu_to_frd, quaternion_from_euler
from twinscrew.runtime.messages import cdr
from twinscrew.runtime.messages.navigation import VESSEL_FRAME
from twinscrew.runtime.messages.types import (
    NANOSECONDS_PER_SECOND,
    Decision,
    Explanation,
    Float64,
    HealthEvent,
    Odometry,
)
from twinscrew.runtime.messages.visual import Transform, vessel_transform
from twinscrew.runtime.perception.sensor import Sensor
from twinscrew.runtime.recording.recorder import Recorder
from twinscrew.runtime.recording.recording import DecisionHash
from twinscrew.runtime.safety.events import AUTOPILOT_NOW, ENVELOPE_NOW, STATE_NOW
from twinscrew.runtime.safety.guard import NEUTRAL

STATE_EVERY_NS: Final = NANOSECONDS_PER_SECOND
"""[ns] How often the state is published while it stays as it is."""
PATH_STEP_M: Final = 1.0
"""[m] Between two places of the path."""
PATH_PLACES: Final = 1000
"""[-] The last so many are kept: a kilometre."""
PATH_EVERY_NS: Final = NANOSECONDS_PER_SECOND
"""[ns] How often the path is published (`TOPICS["path"]`)."""


@dataclass(slots=True)
class Taken:
    """A message that the vessel took in, to be recorded."""

    topic: str
    payload: bytes
    message: Any = None
    """The same, decoded; None if it could not be read, or nobody needs it."""
    made_here: bool = False
    """Whether nobody else publishes it: the vessel's own odometry, engagement."""


@dataclass(slots=True)
class Outputs:
    """What came of a message, or of a tick."""

    autopilot: bytes = b""
    """Bytes for the autopilot, to be sent first."""
    messages: list[Taken] = field(default_factory=list)
    """What was taken in, in this order."""
    events: list[HealthEvent] = field(default_factory=list)
    """What an operator should know, the decision's own events among it."""
    decision: Decision | None = None
    """The decision, if the message was a scan that could be used."""
    thrust: Float64 = field(default_factory=lambda: NEUTRAL)
    """[N] (2,) What `autopilot` asks of the propellers, left and right."""


class Publisher:
    """Publishes and records outputs; counts and hashes the decisions.

    Parameters
    ----------
    bus, recorder
        Where to; either may be missing.
    vessel
        Whose health events these are.
    sensor
        The LiDAR, whose place on the vessel is recorded; None to record no transforms.
    clock_ns
        [ns] Gives the recording's log times; replays do not depend on them.
    """

    def __init__(
        self,
        bus: Bus | None,
        recorder: Recorder | None,
        *,
        vessel: str = "",
        sensor: Sensor | None = None,
        clock_ns: Callable[[], int] = time.time_ns,
    ) -> None:
        self.decisions = 0
        self._bus = bus
        self._recorder = recorder
        self._vessel = vessel
        self._frames = None if sensor is None else Frames(sensor)
        self._clock_ns = clock_ns
        self._hash = DecisionHash()
        self._path = SailedPath()
        self._state_ns: int | None = None
        self._came: bytes | None = None
        self._recorder_losses, self._bus_losses = Losses(), Losses()
        self.has_listeners = bus is not None or recorder is not None
        """Whether anything is published or recorded."""

    @property
    def sha256(self) -> str:
        """SHA-256 over the encoded decisions so far."""
        return self._hash.hexdigest()

    def came(self, topic: str, payload: bytes) -> None:
        """Record a message before it is handled: what brings a runtime down is in its recording."""
        self._record(topic, payload)
        self._came = payload

    def publish(self, out: Outputs, explanation: Explanation | None = None) -> None:
        """Publish and record what came of a message or a tick, and why it was so decided."""
        for taken in out.messages:
            self._take(taken)
        if out.decision is not None:
            self._decide(out.decision, out.thrust, explanation)
        self.report(out.events)

    def report(self, events: Iterable[HealthEvent]) -> None:
        """Publish and record health events."""
        events = tuple(events)
        if events and self.has_listeners:
            stamp_ns = max(event.stamp_ns for event in events)
            payload = cdr.encode_diagnostics(events, stamp_ns=stamp_ns, hardware_id=self._vessel)
            self._put("diagnostics", payload)

    def state(self, state: str, stamp_ns: int, autopilot: str = "", envelope: str = "") -> None:
        """Publish the state once a second: who begins to listen has not received its change.

        With it goes what is known of the autopilot, and of the operational envelope, in words.
        """
        now_ns, last_ns = self._clock_ns(), self._state_ns
        if last_ns is None or not 0 <= now_ns - last_ns < STATE_EVERY_NS:
            self._state_ns = now_ns
            known = ((AUTOPILOT_NOW, autopilot), (ENVELOPE_NOW, envelope))
            more = (kind.at(stamp_ns, words) for kind, words in known if words)
            self.report((STATE_NOW.at(stamp_ns, state), *more))

    def thrust(self, thrust: Float64) -> None:
        """Publish what the propellers are asked for: a VRX takes it from here."""
        left, right = thrust.tolist()
        self._put("thrust_left", cdr.encode_thrust(left))
        self._put("thrust_right", cdr.encode_thrust(right))

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

    def _take(self, taken: Taken) -> None:
        """Record a message that was taken in, and what is drawn from odometry."""
        if not self.has_listeners:
            return
        if taken.made_here:
            self._put(taken.topic, taken.payload)
        elif taken.payload is not self._came:
            self._record(taken.topic, taken.payload)
        if isinstance(taken.message, Odometry):
            if self._recorder is not None and self._frames is not None:
                self._record("transforms", self._frames.encoded(taken.message))
            path = self._path.step(taken.message)
            if path is not None:
                self._put("path", path)
        elif taken.topic == "points" and self._frames is not None and taken.message is not None:
            self._frames.see(taken.message.frame_id)

    def _decide(self, decision: Decision, thrust: Float64, explanation: Explanation | None) -> None:
        payload = cdr.encode_decision(decision)
        self._hash.add(payload)
        self.decisions += 1
        if self.has_listeners:
            self._put("decision", payload)
            if explanation is not None:
                self._put("explanation", cdr.encode_explanation(explanation))
            self._put("objects", cdr.encode_object_markers(decision.objects))
            self._put("tracks", cdr.encode_track_markers(decision.tracks))
            self.thrust(thrust)

    def _put(self, topic: str, payload: bytes) -> None:
        if self._bus is not None:
            with suppress(BusError):  # a broken bus must not stop the loop, nor can it carry news
                self._bus.publish(topic, payload)
        self._record(topic, payload)

    def _record(self, topic: str, payload: bytes) -> None:
        if self._recorder is not None:
            self._recorder.record(topic, payload, self._clock_ns())


class Losses:
    """Remembers which losses were reported, so that a flood of them is no flood of reports."""

    def __init__(self) -> None:
        self._reported = 0

    def grew(self, count: int) -> bool:
        """Tell whether losses have begun, or doubled since they were reported."""
        if count < max(1, 2 * self._reported):
            return False
        self._reported = count
        return True


class SailedPath:
    """The way that the vessel has gone, thinned out, for displays."""

    def __init__(self) -> None:
        self._places: deque[tuple[float, float]] = deque(maxlen=PATH_PLACES)
        self._last_ns: int | None = None

    def step(self, odometry: Odometry) -> bytes | None:
        """Follow the odometry; gives the encoded path once a second, else None."""
        north, east, _ = odometry.position_N.tolist()
        if not self._places or math.dist(self._places[-1], (north, east)) >= PATH_STEP_M:
            self._places.append((north, east))
        stamp_ns, last_ns = odometry.stamp_ns, self._last_ns
        if last_ns is not None and 0 <= stamp_ns - last_ns < PATH_EVERY_NS:
            return None
        self._last_ns = stamp_ns
        return cdr.encode_path(np.array(self._places), stamp_ns=stamp_ns)


class Frames:
    """Where the frames are, so that RViz and Foxglove draw a recording in one picture.

    Recorded only, never published: a boat or a VRX has its own publisher of /tf.
    """

    def __init__(self, sensor: Sensor) -> None:
        self._sensor = sensor
        self._lidar: Transform | None = None

    def see(self, frame_id: str) -> None:
        """Note what the LiDAR calls its frame."""
        mount = self._sensor.mount
        if self._lidar is not None or mount is None or frame_id in ("", VESSEL_FRAME):
            return
        q = quaternion_from_euler(mount.roll_rad, mount.pitch_rad, mount.yaw_rad)
        x, y, z = flu_to_frd(self._sensor.mount_position_B).tolist()
        self._lidar = Transform(VESSEL_FRAME, frame_id, (x, y, z), tuple(q.tolist()))

    def encoded(self, odometry: Odometry) -> bytes:
        """Give the transforms to record after odometry: the vessel's, and the LiDAR's on it."""
        frames = [vessel_transform(odometry)]
        if self._lidar is not None:
            frames.append(self._lidar)
        return cdr.encode_transforms(frames, stamp_ns=odometry.stamp_ns)
