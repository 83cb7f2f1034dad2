"""The way that the vessel has sailed, thinned out, for those who look on."""

from __future__ import annotations

import math
import time
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from typing import Final

import numpy as np

from twinscrew.runtime.app.recorder import Recorder
from twinscrew.runtime.app.recording import DecisionHash
from twinscrew.runtime.bus.base import Bus
from twinscrew.runtime.errors import BusError, MessageError
from twinscrew.runtime.geometry.frames import flu_to_frd, quaternion_from_euler
from twinscrew.runtime.messages import cdr
from twinscrew.runtime.messages.header import VESSEL_FRAME
from twinscrew.runtime.messages.transforms import Transform, vessel_transform
from twinscrew.runtime.messages.types import (
    NANOSECONDS_PER_SECOND,
    Decision,
    Explanation,
    Float64,
    HealthEvent,
)
from twinscrew.runtime.perception.sensor import Sensor
from twinscrew.runtime.safety.events import STATE_NOW

APART_M: Final = 1.0
"""[m] Between two places of the way."""
PLACES: Final = 1000
"""[-] The last so many are kept: a kilometre."""
EVERY_NS: Final = NANOSECONDS_PER_SECOND
"""[ns] How often it is told (`TOPICS["path"]`)."""


class Wake:
    """Follows the odometry that comes in."""

    def __init__(self) -> None:
        self._places: deque[tuple[float, float]] = deque(maxlen=PLACES)
        self._told_ns: int | None = None

    def see(self, payload: bytes) -> bytes | None:
        """Look at an odometry message; gives the path to tell now and then, else None."""
        try:
            odometry = cdr.decode_odometry(payload)
        except MessageError:  # the core says so
            return None
        north, east, _ = odometry.position_N.tolist()
        if not self._places or math.dist(self._places[-1], (north, east)) >= APART_M:
            self._places.append((north, east))
        stamp_ns, told_ns = odometry.stamp_ns, self._told_ns
        if told_ns is not None and 0 <= stamp_ns - told_ns < EVERY_NS:
            return None
        self._told_ns = stamp_ns
        return cdr.encode_path(np.array(self._places), stamp_ns=stamp_ns)


# -- Where the frames are, so that RViz and Foxglove draw a recording in one picture.
#
# Recorded only, never published: a boat or a VRX has its own publisher of /tf.


class Frames:
    """Follows the vessel's pose and the LiDAR's frame through the messages that come in."""

    def __init__(self, sensor: Sensor) -> None:
        self._sensor = sensor
        self._lidar: Transform | None = None

    def see(self, topic: str, payload: bytes) -> bytes | None:
        """Look at a message; gives the transforms to record after odometry, else None."""
        try:
            if topic == "points" and self._lidar is None:
                self._lidar = self._mount(cdr.decode_point_cloud(payload).frame_id)
            if topic != "odometry":
                return None
            odometry = cdr.decode_odometry(payload)
        except MessageError:  # the core says so
            return None
        frames = [vessel_transform(odometry)]
        if self._lidar is not None:
            frames.append(self._lidar)
        return cdr.encode_transforms(frames, stamp_ns=odometry.stamp_ns)

    def _mount(self, frame_id: str) -> Transform | None:
        """Give the LiDAR's frame in the vessel's; both FLU."""
        mount = self._sensor.mount
        if mount is None or frame_id in ("", VESSEL_FRAME):
            return None
        q = quaternion_from_euler(mount.roll_rad, mount.pitch_rad, mount.yaw_rad)
        x, y, z = flu_to_frd(self._sensor.mount_position_B).tolist()
        return Transform(VESSEL_FRAME, frame_id, (x, y, z), tuple(q.tolist()))


# -- Where everything that a vessel's runtime tells goes: the bus, the recorder, the hash.

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
