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
from twinscrew.runtime.geometry import rotation_2d
from twinscrew.runtime.messages import cdr
from twinscrew.runtime.messages.navigation import WORLD_FRAME
from twinscrew.runtime.messages.types import (
    NANOSECONDS_PER_SECOND,
    Decision,
    Explanation,
    Float64,
    HealthEvent,
    Odometry,
    Tracks,
)
from twinscrew.runtime.messages.visual import Shape
from twinscrew.runtime.policy.colregs import CROSSING_ZONE, HEAD_ON_ZONE
from twinscrew.runtime.policy.colregs import DEFAULT as COLREGS
from twinscrew.runtime.recording.recorder import Recorder
from twinscrew.runtime.recording.recording import DecisionHash
from twinscrew.runtime.safety.events import AUTOPILOT_NOW, ENVELOPE_NOW, STATE_NOW
from twinscrew.runtime.safety.guard import NEUTRAL
from twinscrew.runtime.vessel.frames import Frames

STATE_EVERY_NS: Final = NANOSECONDS_PER_SECOND
"""[ns] How often the state is published while it stays as it is."""
CHART_EVERY_NS: Final = 5 * NANOSECONDS_PER_SECOND
"""[ns] How often the chart is published again while it stays as it is; it is recorded once."""
DRAW_EVERY_NS: Final = NANOSECONDS_PER_SECOND // 2
"""[ns] How often the situation is drawn (`TOPICS["situation"]`)."""
BUOY_RADIUS_M: Final = 2.0
"""[m] What stands still and is no larger is drawn as a buoy."""
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
    goals_N: Float64 | None = None
    """[m] [N] (K, 2) With a decision, the goals ahead; None elsewhere."""
    route_N: Float64 | None = None
    """[m] [N] (M, 2) With a decision, the route around what is fixed, from the boat to the goal;
    empty while the way is straight; None elsewhere."""
    thrust: Float64 = field(default_factory=lambda: NEUTRAL)
    """[N] (2,) What `autopilot` asks of the propellers, left and right."""
    targets: Tracks | None = None
    """Vessels that report themselves, once a second."""


class Publisher:
    """Publishes and records outputs; counts and hashes the decisions.

    Parameters
    ----------
    bus, recorder
        Where to; either may be missing.
    vessel
        Whose health events these are.
    frames
        The vessel's frames, whose places are recorded, and published where the settings say so;
        None: they are not.
    clock_ns
        [ns] Gives the recording's log times; replays do not depend on them.
    """

    def __init__(
        self,
        bus: Bus | None,
        recorder: Recorder | None,
        *,
        vessel: str = "",
        frames: Frames | None = None,
        clock_ns: Callable[[], int] = time.time_ns,
    ) -> None:
        self.decisions = 0
        self._bus = bus
        self._recorder = recorder
        self._vessel = vessel
        self._places = frames
        self._frames = frames or Frames()
        self._clock_ns = clock_ns
        self._hash = DecisionHash()
        self._path = SailedPath()
        self._state_ns: int | None = None
        self._drawn_ns: int | None = None
        self._planned_ns: int | None = None
        self._came: bytes | None = None
        self._chart: bytes | None = None
        self._chart_ns = 0
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
            self._decide(out.decision, out.thrust, explanation, out.goals_N)
            self._plan(out.decision.stamp_ns, out.route_N)
        if out.targets is not None and self.has_listeners:
            self._put("ais_targets", cdr.encode_detections(out.targets))
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
        self._repeat_chart(now_ns)
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
        if taken.topic == "chart":
            self._chart, self._chart_ns = taken.payload, self._clock_ns()
        if taken.made_here:
            self._put(taken.topic, taken.payload)
        elif taken.payload is not self._came:
            self._record(taken.topic, taken.payload)
        if isinstance(taken.message, Odometry):
            self._transforms(taken.message)
            path = self._path.step(taken.message, self._frames.world)
            if path is not None:
                self._put("path", path)

    def _transforms(self, odometry: Odometry) -> None:
        """Record where the frames are, so that RViz and Foxglove draw all in one picture."""
        if self._places is None:
            return
        give = self._put if self._places.settings.publish else self._record
        give("transforms", self._places.moving(odometry))
        static = self._places.static(odometry.stamp_ns)
        if static is not None:
            give("static_transforms", static)

    def _decide(
        self,
        decision: Decision,
        thrust: Float64,
        explanation: Explanation | None,
        goals_N: Float64 | None,
    ) -> None:
        payload = cdr.encode_decision(decision)
        self._hash.add(payload)
        self.decisions += 1
        if self.has_listeners:
            self._put("decision", payload)
            if explanation is not None:
                self._put("explanation", cdr.encode_explanation(explanation))
            frames = self._frames
            objects = cdr.encode_object_markers(decision.objects, frame_id=frames.vessel)
            self._put("objects", objects)
            tracks = cdr.encode_track_markers(decision.tracks, frame_id=frames.world)
            self._put("tracks", tracks)
            detections = cdr.encode_detections(decision.tracks, frame_id=frames.world)
            self._put("detections", detections)
            self._draw(decision.tracks, goals_N)
            self.thrust(thrust)

    def _draw(self, tracks: Tracks, goals_N: Float64 | None) -> None:
        """Draw goals, buoys and the zones of the COLREGs, twice a second."""
        last_ns, stamp_ns = self._drawn_ns, tracks.stamp_ns
        if last_ns is not None and 0 <= stamp_ns - last_ns < DRAW_EVERY_NS:
            return
        self._drawn_ns = stamp_ns
        shapes = situation_shapes(tracks, goals_N)
        frame_id = self._frames.world
        self._put("situation", cdr.encode_shapes(shapes, stamp_ns=stamp_ns, frame_id=frame_id))

    def _plan(self, stamp_ns: int, route_N: Float64 | None) -> None:
        """Publish the route once a second while there is one, and once that there is none."""
        count, last_ns = 0 if route_N is None else len(route_N), self._planned_ns
        if route_N is None or (not count and last_ns is None) or not self.has_listeners:
            return
        if count and last_ns is not None and 0 <= stamp_ns - last_ns < PATH_EVERY_NS:
            return
        self._planned_ns = stamp_ns if count else None
        frame_id = self._frames.world
        route = cdr.encode_path(route_N, stamp_ns=stamp_ns, frame_id=frame_id)
        self._put("planned_route", route)

    def _repeat_chart(self, now_ns: int) -> None:
        """Publish the chart again, for who begins to listen; a recording has it already."""
        if self._chart is None or self._bus is None:
            return
        if not 0 <= now_ns - self._chart_ns < CHART_EVERY_NS:
            self._chart_ns = now_ns
            with suppress(BusError):
                self._bus.publish("chart", self._chart)

    def _put(self, topic: str, payload: bytes) -> None:
        if self._bus is not None:
            with suppress(BusError):  # a broken bus must not stop the loop, nor can it carry news
                self._bus.publish(topic, payload)
        self._record(topic, payload)

    def _record(self, topic: str, payload: bytes) -> None:
        if self._recorder is not None:
            self._recorder.record(topic, payload, self._clock_ns())


_GOAL, _BUOY = (0.2, 0.7, 0.2, 0.6), (0.9, 0.5, 0.1, 0.8)
_HEAD_ON, _CROSSING = (0.8, 0.1, 0.1, 0.9), (0.6, 0.1, 0.7, 0.9)
GOAL_RADIUS_M: Final = 1.0
"""[m] How large a goal is drawn."""


def situation_shapes(tracks: Tracks, goals_N: Float64 | None) -> list[Shape]:
    """Give what is drawn of goals, of what stands still, and of the zones of vessels under way.

    Namespaces: `goals`, in their order; `buoys`, `head_on` and `crossing`, numbered as the tracks.
    """
    shapes = [
        Shape("goals", number, _GOAL, goal_N[None, :], GOAL_RADIUS_M)
        for number, goal_N in enumerate(() if goals_N is None else goals_N)
    ]
    speeds = np.hypot(*tracks.v_N.T).tolist()
    for i, speed in enumerate(speeds):
        number, at_N = int(tracks.id[i]) % 2**31, tracks.p_N[i]
        if speed < COLREGS.min_speed_mps:
            if tracks.radius[i] <= BUOY_RADIUS_M:
                radius = float(tracks.radius[i])
                shapes.append(Shape("buoys", number, _BUOY, at_N[None, :], radius))
            continue
        turn = rotation_2d(math.atan2(tracks.v_N[i, 1], tracks.v_N[i, 0]))
        for name, corners, color in (
            ("head_on", HEAD_ON_ZONE, _HEAD_ON),
            ("crossing", CROSSING_ZONE, _CROSSING),
        ):
            shapes.append(Shape(name, number, color, at_N + corners @ turn.T))
    return shapes


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

    def step(self, odometry: Odometry, frame_id: str = WORLD_FRAME) -> bytes | None:
        """Follow the odometry; gives the encoded path once a second, else None."""
        north, east, _ = odometry.position_N.tolist()
        if not self._places or math.dist(self._places[-1], (north, east)) >= PATH_STEP_M:
            self._places.append((north, east))
        stamp_ns, last_ns = odometry.stamp_ns, self._last_ns
        if last_ns is not None and 0 <= stamp_ns - last_ns < PATH_EVERY_NS:
            return None
        self._last_ns = stamp_ns
        return cdr.encode_path(np.array(self._places), stamp_ns=stamp_ns, frame_id=frame_id)
