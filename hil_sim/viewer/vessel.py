"""What is known of one vessel: follows its topics, live or recorded, and gives its view."""

from __future__ import annotations

from collections import deque
from typing import Final

import numpy as np
from msgspec import structs

from twinscrew.hil_sim.viewer.echoes import echoes_from_above
from twinscrew.hil_sim.viewer.picture import object_views, pair, track_views
from twinscrew.hil_sim.viewer.trail import Trail
from twinscrew.hil_sim.viewer.wire import POINT_BYTES, EventView, Part, VesselView, encode_part
from twinscrew.runtime.errors import MessageError
from twinscrew.runtime.geometry import rotation_2d, rotation_from_quaternion
from twinscrew.runtime.messages import cdr
from twinscrew.runtime.messages.cloud import POINT_CLOUD_TYPE
from twinscrew.runtime.messages.header import read_stamp
from twinscrew.runtime.messages.types import Decision, Float64, Odometry
from twinscrew.runtime.messages.wire import Reader
from twinscrew.runtime.perception.sensor import Sensor
from twinscrew.runtime.safety.events import STATE, STATE_NOW

SHOWN: Final = (
    "points",
    "odometry",
    "goal",
    "decision",
    "thrust_left",
    "thrust_right",
    "diagnostics",
    "path",
)
"""The topics that are looked at: decisions hold objects and tracks, bit for bit."""
FRESH_S = 1.0
"""[s] Older decisions, scans and thrusts are not shown: they tell of another moment."""
EVENTS = 6
"""[-] How many health events are kept."""
SCANS = 8
"""[-] How many scans may wait for their decision, to tell the latency."""


class Vessel:
    """Takes in a vessel's messages in the order of their times; never fails on their content."""

    def __init__(self, name: str, sensor: Sensor) -> None:
        self.name = name
        self.trail = Trail()
        self.refused = 0
        """[-] Messages that were not what they should be."""
        self._sensor = sensor
        self._odometry: Odometry | None = None
        self._decision: Decision | None = None
        self._cloud: bytes | None = None
        self._thrust_N = np.zeros(2)
        self._heard_s: dict[str, float] = {}
        self._goal: Float64 | None = None
        self._state = "unknown"
        self._events: deque[EventView] = deque(maxlen=EVENTS)
        self._sent_s: dict[int, float] = {}
        self._latency_ms: float | None = None
        self._decisions = 0

    def take(self, topic: str, payload: bytes, time_s: float, sent_s: float | None = None) -> None:
        """Take in a message.

        Parameters
        ----------
        topic
            A name of `TOPICS`; others than `SHOWN` are passed over.
        time_s
            [s] When it came, on the view's clock.
        sent_s
            [s] When it was sent, on one clock for all senders; the latency follows from it.
        """
        try:
            self._take(topic, payload, time_s, time_s if sent_s is None else sent_s)
        except MessageError:
            self.refused += 1
            return
        self._heard_s[topic] = time_s

    def part(self, now_s: float) -> Part:
        """Give the vessel's share of a frame at a time."""
        points = self._points() if self._is_fresh("points", now_s) else b""
        return encode_part(self._view(now_s, len(points) // POINT_BYTES), points)

    def _take(self, topic: str, payload: bytes, time_s: float, sent_s: float) -> None:
        match topic:
            case "odometry":
                self._odometry = cdr.decode_odometry(payload)
                north, east, _ = self._odometry.position_N.tolist()
                self.trail.add(time_s, north, east)
            case "points":
                self._cloud = payload
                self._note_scan(read_stamp(Reader(payload, POINT_CLOUD_TYPE)), sent_s)
            case "decision":
                self._decide(cdr.decode_decision(payload), sent_s)
            case "goal":
                self._goal = cdr.decode_goal(payload).position_N
            case "thrust_left" | "thrust_right":
                self._thrust_N[int(topic == "thrust_right")] = cdr.decode_thrust(payload)
            case "path":
                self.trail.precede(cdr.decode_path(payload)[1])
            case "diagnostics":
                self._hear(payload, time_s)

    def _note_scan(self, stamp_ns: int, sent_s: float) -> None:
        self._sent_s[stamp_ns] = sent_s
        while len(self._sent_s) > SCANS:
            del self._sent_s[next(iter(self._sent_s))]

    def _decide(self, decision: Decision, sent_s: float) -> None:
        self._decision = decision
        self._decisions = decision.sequence + 1
        since_s = self._sent_s.pop(decision.stamp_ns, None)
        latency_ms = 0.0 if since_s is None else round(1e3 * (sent_s - since_s), 2)
        if latency_ms > 0.0:  # none passes in lock-step, or on a clock that is not the sensor's
            self._latency_ms = latency_ms
        if decision.observation is None:
            return
        if self._state == "unknown":  # the policy is asked only while it drives
            self._state = "active"
        if self._odometry is not None:
            goal_L = decision.observation.ego[:2].astype(np.float64)
            heading = self._odometry.heading
            self._goal = self._odometry.position_N[:2] + rotation_2d(heading) @ goal_L

    def _hear(self, payload: bytes, time_s: float) -> None:
        for event in cdr.decode_diagnostics(payload):
            if event.name == STATE_NOW.name:
                self._state = event.detail
                continue
            if event.name == STATE.name:
                self._state = event.detail.rpartition(" ")[2]
            severity = event.severity.value
            self._events.append(EventView(round(time_s, 2), event.name, severity, event.detail))

    def _is_fresh(self, topic: str, now_s: float) -> bool:
        return now_s - self._heard_s.get(topic, -np.inf) <= FRESH_S

    def _points(self) -> bytes:
        if self._cloud is None or self._odometry is None:
            return b""
        try:
            cloud = cdr.decode_point_cloud(self._cloud)
        except MessageError:
            self.refused += 1
            return b""
        return echoes_from_above(cloud, self._odometry, self._sensor).tobytes()

    def _view(self, now_s: float, points: int) -> VesselView:
        odometry = self._odometry
        known = VesselView(name=self.name, state=self._state, events=tuple(self._events))
        if odometry is None:
            return known
        north, east, _ = odometry.position_N.tolist()
        velocity_N = (rotation_from_quaternion(odometry.q_NB) @ odometry.velocity_B)[:2]
        afloat = structs.replace(
            known,
            pose=(round(north, 2), round(east, 2), round(odometry.heading, 4)),
            velocity=pair(velocity_N),
            silent_s=round(now_s - self._heard_s["odometry"], 2),
            thrust=pair(self._thrust_N) if self._is_fresh("thrust_left", now_s) else None,
            goal=None if self._goal is None else pair(self._goal),
            decisions=self._decisions,
            points=points,
        )
        decision = self._decision
        if decision is None or not self._is_fresh("decision", now_s):
            return afloat
        return structs.replace(
            afloat,
            arrived=decision.arrived,
            latency_ms=self._latency_ms,
            tracks=track_views(decision.tracks, odometry.position_N[:2], velocity_N),
            objects=object_views(decision.objects, odometry),
        )
