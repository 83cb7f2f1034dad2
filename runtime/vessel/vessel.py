"""One vessel's runtime without its sockets and its clock.

Messages and the autopilot's bytes come in with the time; bytes for the autopilot, and what is to be
published and recorded, go out. `run` drives it in real time, the lock-step driver in simulated
time, and `replay` feeds it what a recording took in: to the same decisions.
"""

from __future__ import annotations

import math
from collections import Counter, deque
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Literal, NamedTuple

import numpy as np
from msgspec import structs

from twinscrew.runtime.bus.base import Received
from twinscrew.runtime.charts.chart import (
    ChartSettings,
    as_map,
    as_message,
    read_chart,
    safety_depth_m,
)
from twinscrew.runtime.charts.static_map import Feature, StaticMap
from twinscrew.runtime.errors import ConfigError, MessageError
from twinscrew.runtime.estimation.estimator import Estimator
from twinscrew.runtime.ground.report import GroundReport
from twinscrew.runtime.ground.service import GroundService
from twinscrew.runtime.link.autopilot import Autopilot, AutopilotStatus, make_autopilot
from twinscrew.runtime.messages import cdr
from twinscrew.runtime.messages.marine import Sentence
from twinscrew.runtime.messages.navigation import as_read_back
from twinscrew.runtime.messages.topics import TOPICS
from twinscrew.runtime.messages.types import (
    NANOSECONDS_PER_SECOND,
    Berth,
    Decision,
    Engagement,
    Explanation,
    Fallback,
    Float64,
    Goal,
    HealthEvent,
    Odometry,
    Station,
)
from twinscrew.runtime.perception.segmentation import Perception
from twinscrew.runtime.safety.assurance import Assurance
from twinscrew.runtime.safety.envelope import (
    MOVING_MPS,
    TRAFFIC_M,
    Envelope,
    EnvelopeSettings,
    Response,
    SeaState,
    Visibility,
)
from twinscrew.runtime.safety.events import (
    BAD_MESSAGE,
    CHART_CHANGED,
    FENCES_REFUSED,
    GOAL_FORBIDDEN,
    GOAL_FRAME,
    INTERNAL_ERROR,
    KINDS,
    PLACE_ALLOWED,
    PLACE_FORBIDDEN,
    STATION_REFUSED,
)
from twinscrew.runtime.safety.explain import assurance_manoeuvre, explain
from twinscrew.runtime.safety.guard import NEUTRAL, Guard, ThrustLimits, Watchdog
from twinscrew.runtime.vessel.config import (
    SENSED,
    RuntimeConfig,
    autopilot_of,
    datum_of,
    sensor_of,
)
from twinscrew.runtime.vessel.frames import FrameError, Frames
from twinscrew.runtime.vessel.health import Facts, Health, State
from twinscrew.runtime.vessel.inputs import Alignment, Inputs, OdometryBufferSettings, Verdict
from twinscrew.runtime.vessel.outputs import Outputs, Taken
from twinscrew.runtime.vessel.pipeline import Pipeline, SpeedLimit, make_pipeline
from twinscrew.runtime.vessel.station import Berthing
from twinscrew.runtime.vessel_description import load_vessel

LATENESS_KEPT_S = 2.0
"""[s] The latest decision or tick of this time counts."""
FAULT_HOLD_S = 1.0
"""[s] After a fault of the runtime itself the thrust is neutral for this long."""


class _Order(NamedTuple):
    """A goal, a route or a place to hold, as it came."""

    kind: Literal["goal", "route", "hold", "berth"]
    stamp_ns: int
    places: Float64
    """[m] (K, 2) y and x in its frame: north and east if that is the frame of positions. Of a place
    to hold with a heading a second one: a metre ahead of the first."""
    frame_ids: tuple[str, ...]


class Vessel:
    """Inputs, pipeline, watchdog, guard, health, autopilot link and ground stations of one vessel.

    Parameters
    ----------
    pipeline
        Decides on scans.
    link
        Talks to the autopilot.
    report
        What ground stations are told.
    odometry
        How far odometry is trusted.
    alignment
        Given if odometry comes from the autopilot.
    estimator
        Given if odometry is made of GPS and IMU.
    limits
        What the last guard lets pass; the pipeline's by default.
    frames
        What the frames are called, and where those are in which goals may be given.
    looks_first
        Whether nothing may be driven before the surroundings have been seen for long enough, at the
        very start too. A simulation in lock-step begins with vessels that may.
    envelope
        What the boat was proved for; None: nothing is watched.
    slow
        How fast "slow" is.
    chart
        What is fixed around the boat; None: nothing is known.
    follows_fences
        Whether the fences that the autopilot holds count.
    """

    def __init__(
        self,
        pipeline: Pipeline,
        link: Autopilot,
        *,
        report: GroundReport | None = None,
        odometry: OdometryBufferSettings | None = None,
        alignment: Alignment | None = None,
        estimator: Estimator | None = None,
        limits: ThrustLimits | None = None,
        frames: Frames | None = None,
        looks_first: bool = True,
        envelope: Envelope | None = None,
        slow: SpeedLimit | None = None,
        chart: StaticMap | None = None,
        follows_fences: bool = True,
    ) -> None:
        self.pipeline = pipeline
        self.link = link
        self.report = report or GroundReport()
        self.health = Health()
        self.inputs = Inputs(odometry)
        self.frames = frames or Frames()
        self.decision: Decision | None = None
        """The last one."""
        self.engaged = False
        """Whether the pipeline's thrust goes to the propellers."""
        self.chart = StaticMap.empty()
        """What is fixed around the boat: chart and fences. Replaced as a whole when they change."""
        self._charted = chart or StaticMap.empty()
        self._next_chart = None if self._charted.is_empty else self._charted
        self._fences: dict[str, tuple[Feature, ...]] = {}
        self._follows_fences = follows_fences
        self._is_forbidden = False
        if link.stations is not None:
            link.stations.server.fence.honour = partial(self.fence, "station")
        self._alignment = alignment
        self._estimator = estimator
        self._ground = GroundService(
            link, self.report, pipeline.mission, lambda: self.inputs.newest
        )
        self._guard = Guard(limits or pipeline.guard.limits)
        self._watchdog = Watchdog(
            {
                topic.name: (KINDS[topic.stale], topic.max_age_s or math.inf)
                for topic in TOPICS.values()
                if topic.stale
            }
        )
        self._handlers: dict[str, Callable[[Taken, Outputs, float], None]] = {
            "points": self._scan,
            "odometry": self._odometry,
            "goal": self._goal,
            "route": self._route,
            "hold": self._hold,
            "berth": self._berth,
            "engagement": self._engagement,
            "fallback": self._fallback,
            "chart": self._chart,
            "gps": self._fix,
            "imu": self._imu,
            **dict.fromkeys(pipeline.senses.by_topic, self._sensed),
            **dict.fromkeys(link.topics, self._for_autopilot),
        }
        self.envelope = envelope or Envelope(EnvelopeSettings(enabled=False))
        self._slow = slow or slow_of(RuntimeConfig())
        self._sea = SeaState()
        self._visibility: Visibility | None = None
        self._lateness: deque[tuple[float, float]] = deque()
        self._fault = False
        self._has_looked = not looks_first
        self._inputs_too_old = False
        self._targets_ns = 0
        self._held_until_s = self._now_s = -math.inf
        self._manoeuvre = ""
        self._unplaced: _Order | None = None

    @property
    def state(self) -> State:
        """What the vessel is doing."""
        return self.health.state

    @property
    def stamp_ns(self) -> int:
        """[ns] The vessel's time, by the stamps of what it took in."""
        return self.inputs.latest_ns

    @property
    def follows_autopilot(self) -> bool:
        """Whether odometry comes from the autopilot: a scan wants the newest bytes taken first."""
        return self._alignment is not None

    @property
    def thrust(self) -> Float64:
        """[N] (2,) What the propellers should give now, left and right."""
        if not self.engaged or self._fault or self._inputs_too_old or self.decision is None:
            return NEUTRAL
        if self.pipeline.stopped:
            return NEUTRAL
        return NEUTRAL if self._now_s < self._held_until_s else self.decision.thrust

    # -- What comes in. Each call gives what is to be sent, published and recorded.

    def handle(self, message: Received, now_s: float) -> Outputs:
        """Take in a message; a scan that can be used becomes a decision and a command.

        It never raises on the message's content. A fault of the runtime itself is an
        `internal_error`, after which the surroundings are forgotten: the next scan starts afresh.
        """
        out = self._begin(now_s)
        self._take(Taken(message.topic, message.payload), out, now_s)
        if out.decision is not None or message.topic in self.link.topics:
            self._command(out, now_s)
        return out

    def receive(self, data: bytes, now_s: float) -> Outputs:
        """Take in bytes of the autopilot, which may hold odometry and orders of ground stations."""
        out = self._begin(now_s)
        if data:
            self.link.receive(data, now_s)
        outputs = self.link.take_outputs()
        if outputs is not None:
            for topic, pwm_us in zip(("pwm_left", "pwm_right"), outputs, strict=True):
                payload = cdr.encode_thrust(float(pwm_us))
                out.messages.append(Taken(topic, payload, made_here=True))
        if self._alignment is not None:
            for odometry in self.link.take_odometry():
                stamp_ns = self._alignment.lidar_ns(odometry.stamp_ns)
                if stamp_ns is not None:
                    aligned = replace(odometry, stamp_ns=stamp_ns)
                    self._own_odometry(aligned, out, now_s)
        fences = self.link.take_fences()
        if fences is not None and self._follows_fences:
            words = fences if isinstance(fences, str) else self.fence("autopilot", fences)
            if words:
                self._tell(out, now_s, FENCES_REFUSED.at(self.stamp_ns, words))
        for age_s, text in self.link.take_ais():
            if "nmea" in self._handlers and self.inputs.latest_ns:
                stamp_ns = self.inputs.latest_ns - round(age_s * NANOSECONDS_PER_SECOND)
                self._own_sentence(text, stamp_ns, out, now_s)
        return out

    def hear(self, sentence: str, now_s: float) -> Outputs:
        """Take in a sentence of NMEA 0183 that came by itself, not as a message."""
        out = self._begin(now_s)
        if self.inputs.latest_ns:  # before the first odometry nobody knows when that was
            self._own_sentence(sentence, self.inputs.latest_ns, out, now_s)
        return out

    def tick(self, now_s: float) -> Outputs:
        """Look at the inputs' ages and the autopilot, serve ground stations, command the thrust."""
        out = self._begin(now_s)
        stamp_ns = self.inputs.latest_ns
        link_events = (replace(event, stamp_ns=stamp_ns) for event in self.link.events(now_s))
        out.events += (*self._watchdog.check(now_s, stamp_ns), *link_events)
        self.note(tuple(out.events), now_s)
        status = self.link.status
        self._watch_envelope(status, out, now_s)
        change = self.health.step(self._facts(status, now_s), stamp_ns)
        if change is not None:
            self._tell(out, now_s, change)
        ready = self._has_looked and now_s >= self._held_until_s and not self._watchdog.stale
        self._engage(engaged=status.engaged and ready, out=out)
        self._ground.serve(
            lambda topic, payload: self._take(Taken(topic, payload), out, now_s), stamp_ns, now_s
        )
        self._command(out, now_s)
        return out

    def late(self, late_ms: float, now_s: float) -> None:
        """Take note of how late a decision or a tick was, by whoever drives this in real time."""
        self._lateness.append((now_s, late_ms))

    def note(self, events: tuple[HealthEvent, ...], now_s: float) -> None:
        """Let state and ground stations know of events; those of a driver come here too."""
        self.health.note(events, now_s)
        self.report.happened(events, now_s)

    def hold(self, now_s: float) -> bytes:
        """Hold the thrust neutral after a fault of the runtime, and give the bytes that say so."""
        self._held_until_s = now_s + FAULT_HOLD_S
        return self.link.command(NEUTRAL, now_s)

    def rest(self, now_s: float) -> bytes:
        """Give the last bytes of a run: propellers at stop."""
        self.engaged = False
        return self.link.command(NEUTRAL, now_s) + self.link.tick(now_s)

    def explain(self, decision: Decision) -> Explanation | None:
        """Say what the newest decision does and why; None before the first odometry.

        Words must never stop the boat: whatever fails in making them leaves them out.
        """
        self._manoeuvre = assurance_manoeuvre(decision, self._manoeuvre) if self.engaged else ""
        odometry, goal = self.inputs.newest, self.pipeline.mission.goal
        if odometry is None:
            return None
        goal_N = None if goal is None else goal.position_N
        acts = self.engaged and not self._inputs_too_old and self._now_s >= self._held_until_s
        try:
            said = explain(
                decision,
                odometry,
                goal_N,
                engaged=acts,
                assurance=self._manoeuvre,
                holding=self.pipeline.mission.station is not None,
            )
            if self.envelope.response is not Response.NONE:
                words = self.envelope.words
                return replace(said, sentence=f"{words[:1].upper()}{words[1:]}. {said.sentence}")
            return said
        except Exception:  # see above
            return None

    # -- One message.

    def _take(self, taken: Taken, out: Outputs, now_s: float) -> None:
        """Decode a message, once, and work on it; what that raises becomes an event."""
        topic = taken.topic
        out.messages.append(taken)
        if topic not in self._handlers or (topic in SENSED and self._estimator is None):
            return  # of a sensor that this vessel does not use
        try:
            self._handlers[topic](taken, out, now_s)
        except MessageError as error:
            self._tell(out, now_s, BAD_MESSAGE.at(self.inputs.latest_ns, f"{topic}: {error}"))
        except Exception as error:  # must stop the boat, not the loop
            self._fault = True
            self.pipeline.reset()
            if topic in SENSED and self._estimator is not None:
                self._estimator.restart()
            detail = f"{topic}: {type(error).__name__}: {error}"
            self._tell(out, now_s, INTERNAL_ERROR.at(self.inputs.latest_ns, detail))

    def _scan(self, taken: Taken, out: Outputs, now_s: float) -> None:
        taken.message = cloud = cdr.decode_point_cloud(taken.payload)
        self.frames.see(cloud.frame_id)
        verdict = self.inputs.scan(cloud)
        if verdict.in_order and self._alignment is not None:
            self._alignment.scan_came(cloud.stamp_ns, now_s)
        self._judged("points", cloud.stamp_ns, verdict, out, now_s)
        if verdict.odometry is None:
            return
        decision, fault = self.pipeline.step(cloud, verdict.odometry, engaged=self.engaged)
        self.decision = out.decision = decision
        out.goals_N = self.pipeline.mission.ahead_N
        ahead_N = self.pipeline.guidance.ahead_N
        here_N = verdict.odometry.position_N[None, :2]
        out.route_N = np.concatenate([here_N, ahead_N]) if len(ahead_N) else ahead_N
        self._fault = fault is not None
        self._watch_place(out, now_s)
        self._has_looked = self._has_looked or self.pipeline.knows_surroundings
        senses = self.pipeline.senses
        if senses.by_topic and abs(cloud.stamp_ns - self._targets_ns) >= NANOSECONDS_PER_SECOND:
            self._targets_ns = cloud.stamp_ns
            out.targets = senses.targets(cloud.stamp_ns)
        self._tell(out, now_s, *decision.events)

    def _odometry(self, taken: Taken, out: Outputs, now_s: float) -> None:
        taken.message = odometry = taken.message or cdr.decode_odometry(taken.payload)
        verdict = self.inputs.odometry(odometry)
        self._judged("odometry", odometry.stamp_ns, verdict, out, now_s)
        if not verdict.usable:
            return
        self._follow_frames(odometry, out, now_s)
        senses = self.pipeline.senses
        events = senses.without_scan(odometry) if senses.by_topic else None
        if events is not None:
            out.targets = senses.targets(odometry.stamp_ns)
            self._tell(out, now_s, *events)

    def _judged(
        self, topic: str, stamp_ns: int, verdict: Verdict, out: Outputs, now_s: float
    ) -> None:
        if verdict.forget:
            self.pipeline.reset()
        if verdict.usable:
            self._watchdog.seen(topic, stamp_ns, now_s)
        self._tell(out, now_s, *verdict.events)

    def _own_odometry(self, odometry: Odometry, out: Outputs, now_s: float) -> None:
        """Take in odometry that nobody sent, exactly as a replay will read it."""
        world, vessel = self.frames.world, self.frames.vessel
        odometry = replace(odometry, frame_id=world, child_frame_id=vessel)
        try:
            payload, odometry = cdr.encode_odometry(odometry), as_read_back(odometry)
        except MessageError as error:
            self._tell(out, now_s, BAD_MESSAGE.at(self.inputs.latest_ns, f"odometry: {error}"))
            return
        self._take(Taken("odometry", payload, odometry, made_here=True), out, now_s)

    def _own_sentence(self, text: str, stamp_ns: int, out: Outputs, now_s: float) -> None:
        payload = cdr.encode_sentence(Sentence(stamp_ns=stamp_ns, text=text))
        self._take(Taken("nmea", payload, made_here=True), out, now_s)

    def _fix(self, taken: Taken, out: Outputs, now_s: float) -> None:
        assert self._estimator is not None  # noqa: S101  (`_take` saw it)
        self._estimator.fix(cdr.decode_fix(taken.payload))
        self._tell(out, now_s, *self._estimator.take_events())

    def _imu(self, taken: Taken, out: Outputs, now_s: float) -> None:
        assert self._estimator is not None  # noqa: S101  (`_take` saw it)
        odometry = self._estimator.imu(cdr.decode_imu(taken.payload))
        self._tell(out, now_s, *self._estimator.take_events())
        if odometry is not None:
            self._own_odometry(odometry, out, now_s)

    def _sensed(self, taken: Taken, out: Outputs, now_s: float) -> None:
        inputs, payload = self.inputs, taken.payload
        events = self.pipeline.senses.take(taken.topic, payload, inputs.latest_ns, inputs.at)
        self._tell(out, now_s, *events)

    def _goal(self, taken: Taken, out: Outputs, now_s: float) -> None:
        goal = cdr.decode_goal(taken.payload)
        places = goal.position_N[None, :]
        self._order(_Order("goal", goal.stamp_ns, places, (goal.frame_id,)), out, now_s)

    def _route(self, taken: Taken, out: Outputs, now_s: float) -> None:
        path = cdr.decode_path(taken.payload)
        self._order(_Order("route", path.stamp_ns, path.places_N, path.frame_ids), out, now_s)

    def _hold(self, taken: Taken, out: Outputs, now_s: float) -> None:
        station = cdr.decode_station(taken.payload)
        places = station.position_N[None, :]
        if station.heading is not None:
            ahead = np.array([math.cos(station.heading), math.sin(station.heading)])
            places = np.vstack([places, places[0] + ahead])
        self._order(_Order("hold", station.stamp_ns, places, (station.frame_id,)), out, now_s)

    def _berth(self, taken: Taken, out: Outputs, now_s: float) -> None:
        path = cdr.decode_path(taken.payload)
        if len(path.places_N) != 2:
            raise MessageError(f"a berth's face has two ends, got {len(path.places_N)} places")
        length_m = float(np.hypot(*(path.places_N[1] - path.places_N[0])))
        least_m = self.pipeline.keeper.vessel.length_m if self.pipeline.keeper else 0.0
        if not max(0.5 * least_m, 0.1) <= length_m:
            words = f"a face of {length_m:.1f} m is too short for a vessel of {least_m:.1f} m"
            self._tell(out, now_s, STATION_REFUSED.at(self.stamp_ns, words))
            return
        self._order(_Order("berth", path.stamp_ns, path.places_N, path.frame_ids), out, now_s)

    def _order(self, order: _Order, out: Outputs, now_s: float) -> None:
        """Take an order, in whatever frame; one that cannot be placed is refused.

        Before the first odometry nobody knows what the frame of positions is called: the order is
        taken as one in it, and looked at again when that is known.
        """
        waits = self.inputs.newest is None
        self._unplaced = order if waits else None
        mission, places_N = self.pipeline.mission, order.places
        if not waits:
            try:
                places_N = self.frames.places_N(
                    order.frame_ids, order.places, order.stamp_ns, self._odometry_at
                )
            except FrameError as error:
                self._tell(out, now_s, GOAL_FRAME.at(self.stamp_ns, str(error)))
                return
            why = self._why_not(self._to_be_free(order.kind, places_N))
            if why:
                self._tell(out, now_s, GOAL_FORBIDDEN.at(self.stamp_ns, f"not taken: {why}"))
                return
        stamp_ns = order.stamp_ns or self.stamp_ns
        if order.kind == "route":
            self._tell(out, now_s, mission.set_route(places_N, stamp_ns))
        elif order.kind == "hold":
            self._tell(out, now_s, mission.set_station(_station(places_N, stamp_ns)))
        elif order.kind == "berth":
            self._tell(out, now_s, mission.set_berth(Berth(stamp_ns=stamp_ns, face_N=places_N)))
        else:
            goal = Goal(stamp_ns=stamp_ns, position_N=places_N[0])
            self._tell(out, now_s, mission.set_goal(goal))

    def _follow_frames(self, odometry: Odometry, out: Outputs, now_s: float) -> None:
        """Note what odometry calls its frames; goals that were in others are taken back."""
        renamed = self.frames.follow(odometry)
        order, self._unplaced = self._unplaced, None
        placed = order is None or all(self.frames.is_world(name) for name in order.frame_ids)
        if renamed or not placed:
            nowhere = self.pipeline.mission.set_route(np.empty((0, 2)), self.stamp_ns)
            self._tell(out, now_s, nowhere)
        if order is not None and not placed:
            self._order(order, out, now_s)
        elif order is not None:
            self._take_back(out, now_s)

    def _odometry_at(self, stamp_ns: int) -> Odometry | None:
        return self.inputs.at(stamp_ns) if stamp_ns else self.inputs.newest

    def _for_autopilot(self, taken: Taken, out: Outputs, now_s: float) -> None:
        self.link.hear(taken.topic, taken.payload, now_s)
        if self.engaged and not self.link.status.engaged:
            self._engage(engaged=False, out=out)  # at once, and not with the next tick

    def _engagement(self, taken: Taken, _out: Outputs, _now_s: float) -> None:
        # Of a recording: aboard, `tick` decides.
        self.engaged = cdr.decode_engagement(taken.payload).engaged

    def _fallback(self, taken: Taken, _out: Outputs, _now_s: float) -> None:
        """Do a response: aboard `_watch_envelope` says which, in a replay the recording."""
        response = Response(cdr.decode_fallback(taken.payload).response)
        slow = response in (Response.SLOW, Response.HOLD)
        self.pipeline.speed_limit = self._slow if slow else None
        self.pipeline.stopped = response in (Response.STOP, Response.HAND_OVER)
        mission = self.pipeline.mission
        mission.resume()
        # Without a goal the boat lies still, and the sticks are perhaps a pilot's: so it stays.
        heads = mission.target is not None or (mission.berths and not mission.berthed)
        if response is Response.HOLD and heads and self.inputs.newest:
            mission.hold(self.inputs.newest)

    # -- What is fixed around the boat.

    def fence(self, source: str, fences: tuple[Feature, ...]) -> str:
        """Replace the fences of one source, "autopilot" or "station", from the next input on.

        Returns
        -------
        str
            Why they cannot be honoured, in plain words; then those before them stay. Empty if they
            are.
        """
        others = {**self._fences, source: fences}
        features = (*self._charted.features, *(f for name in sorted(others) for f in others[name]))
        try:
            chart = StaticMap.of(features, safety_depth_m=self._charted.safety_depth_m)
        except ConfigError as error:
            return str(error)
        if not chart.leaves_water:
            return "together with the other fences and the chart they leave no water"
        self._fences = others
        if chart.version != (self._next_chart or self.chart).version:
            self._next_chart = chart
        return ""

    def _chart(self, taken: Taken, out: Outputs, now_s: float) -> None:
        """Take a map in place of the one before; goals that it forbids are taken back."""
        known = taken.message
        chart = known if isinstance(known, StaticMap) else as_map(cdr.decode_chart(taken.payload))
        self.chart = self.pipeline.chart = chart
        counts = Counter(feature.kind for feature in chart.features)
        words = ", ".join(f"{count} {kind}" for kind, count in sorted(counts.items())) or "nothing"
        self._tell(out, now_s, CHART_CHANGED.at(self.stamp_ns, words))
        if self.link.stations is not None:
            self.link.stations.chart = chart
        self._take_back(out, now_s)
        self._is_forbidden = False
        self._watch_place(out, now_s)

    def _take_back(self, out: Outputs, now_s: float) -> None:
        """Take back all goals if one of them is forbidden."""
        mission = self.pipeline.mission
        places_N = mission.bound_N
        if mission.berth is not None and mission.line_up_N is None:
            places_N = self._to_be_free("berth", mission.berth.face_N)
        why = self._why_not(places_N)
        if why:
            nowhere = mission.set_route(np.empty((0, 2)), self.stamp_ns)
            taken_back = GOAL_FORBIDDEN.at(self.stamp_ns, f"taken back: {why}")
            self._tell(out, now_s, taken_back, nowhere)

    def _watch_place(self, out: Outputs, now_s: float) -> None:
        """Say when the boat comes to where it may not be, and when it has left it."""
        odometry = self.inputs.newest
        if self.chart.is_empty or odometry is None:
            return
        why = self.chart.why(odometry.position_N[:2])
        if bool(why) == self._is_forbidden:
            return
        self._is_forbidden = bool(why)
        kind = PLACE_FORBIDDEN if why else PLACE_ALLOWED
        north, east = odometry.position_N[:2].tolist()
        where = f"north {north:.1f} m, east {east:.1f} m"
        self._tell(out, now_s, kind.at(self.stamp_ns, f"{where}: {why}" if why else where))

    def _to_be_free(self, kind: str, places_N: Float64) -> Float64:
        """Give the places, (K, 2) [m] [N], of an order at which the boat has to be able to be."""
        if kind == "hold":
            return places_N[:1]  # the second says where the bow is to point
        keeper, odometry = self.pipeline.keeper, self.inputs.newest
        if kind != "berth":
            return places_N
        if keeper is None or odometry is None:
            return places_N[:0]  # its ends lie on the water's edge
        berth = Berth(stamp_ns=0, face_N=places_N)
        return Berthing(keeper, berth, odometry.position_N[:2]).line_up_N.reshape(1, 2)

    def _why_not(self, places_N: Float64) -> str:
        """Say which of some places, (K, 2) [m] [N], is forbidden and why; empty if none is."""
        for number, place in enumerate(places_N, start=1):
            why = self.chart.why(place)
            if why:
                north, east = place[:2].tolist()
                which = f"goal {number} of {len(places_N)}" if len(places_N) > 1 else "the goal"
                return f"{which}, north {north:.1f} m, east {east:.1f} m, is {why}"
        return ""

    # -- One tick.

    def _watch_envelope(self, status: AutopilotStatus, out: Outputs, now_s: float) -> None:
        """Estimate the quantities of the envelope, say when it is left, and do the response."""
        before, stamp_ns = self.envelope.response, self.stamp_ns
        estimates = self._estimates(status, now_s)
        order = self.pipeline.mission.orders
        self._tell(out, now_s, *self.envelope.step(estimates, now_s, stamp_ns, order=order))
        if self.envelope.response is before:
            return
        response, words = self.envelope.response.value, self.envelope.words
        message = Fallback(stamp_ns=stamp_ns, response=response, reason=words)
        self._take(
            Taken("fallback", cdr.encode_fallback(message), message, made_here=True), out, now_s
        )

    def _estimates(self, status: AutopilotStatus, now_s: float) -> dict[str, float]:
        """Give what is known of the envelope's quantities (docs/odd.md)."""
        while self._lateness and self._lateness[0][0] < now_s - LATENESS_KEPT_S:
            self._lateness.popleft()
        known = {"lateness_ms": max((late for _, late in self._lateness), default=0.0)}
        if status.depth_m is not None:
            known["depth_m"] = status.depth_m
        if math.isfinite(status.station_age_s):
            known["station_s"] = status.station_age_s
        odometry, decision = self.inputs.newest, self.decision
        if odometry is not None and not self._inputs_too_old:
            known["wave_height_m"], known["motion_deg"] = self._sea.step(odometry)
            speed_mps = math.hypot(*odometry.velocity_B[:2].tolist())
            known["speed_share"] = speed_mps / self._slow.top_mps
        if odometry is not None and decision is not None and not self._inputs_too_old:
            away_N = decision.tracks.p_N - odometry.position_N[:2]
            moving = np.hypot(*decision.tracks.v_N.T) > MOVING_MPS
            near = np.hypot(*away_N.T) <= TRAFFIC_M + decision.tracks.radius
            known["traffic"] = float((moving & near).sum())
            known |= self._seen(now_s)
        return known

    def _seen(self, now_s: float) -> dict[str, float]:
        """Give what perception and the assurance know; those in their place may know nothing."""
        perception, assurance = self.pipeline.perception, self.pipeline.assurance
        known = {}
        if isinstance(perception, Perception):
            if self._visibility is None:
                self._visibility = Visibility(perception.sensor.elevations, perception.range_m)
            known["visibility_m"] = self._visibility.step(perception.range_image, now_s)
        if isinstance(assurance, Assurance) and self.engaged:
            known["drift_share"] = assurance.disturbance_n / (2.0 * assurance.limits.max_n)
        return known

    def _begin(self, now_s: float) -> Outputs:
        """Look at the inputs' ages: the first thing that is done, however long nothing was.

        A map that has changed is an input of the decisions like any other, so it is recorded.
        """
        out = Outputs()
        self._look(now_s)
        chart, self._next_chart = self._next_chart, None
        if chart is not None:
            payload = cdr.encode_chart(as_message(chart, self.stamp_ns))
            self._take(Taken("chart", payload, chart, made_here=True), out, now_s)
        return out

    def _look(self, now_s: float) -> None:
        self._now_s = now_s
        self._watchdog.awake(now_s)
        self._inputs_too_old = self._watchdog.too_old(now_s)

    def _engage(self, *, engaged: bool, out: Outputs) -> None:
        """Note who drives: an input of the decisions like any other, so it is recorded."""
        if engaged == self.engaged:
            return
        message = Engagement(stamp_ns=self.inputs.latest_ns, engaged=engaged)
        payload = cdr.encode_engagement(message)
        self.engaged = engaged
        out.messages.append(Taken("engagement", payload, message, made_here=True))

    def _command(self, out: Outputs, now_s: float) -> None:
        """Command the thrust, and what else the link has to say.

        On inputs that are too old the thrust is neutral, and nothing is asked of the autopilot,
        whatever the last `tick` found.
        """
        out.thrust, tripped = self._guard.check(self.thrust, self.inputs.latest_ns)
        if tripped is not None:
            self._fault = True  # neutral until the next decision
            self._tell(out, now_s, tripped)
        idle = self.health.state is State.READY or self.pipeline.stopped
        nothing_to_do = idle and not self.pipeline.has_task
        handed_over = self.envelope.response is Response.HAND_OVER
        wanted = None if nothing_to_do or handed_over else out.thrust
        asks = not self._inputs_too_old
        out.autopilot = self.link.command(wanted, now_s) + self.link.tick(now_s, may_ask=asks)

    def _tell(self, out: Outputs, now_s: float, *events: HealthEvent) -> None:
        if events:
            out.events += events
            self.note(events, now_s)

    def _facts(self, status: AutopilotStatus, now_s: float) -> Facts:
        return Facts(
            inputs_heard=self._watchdog.all_heard and status.message_age_s < math.inf,
            inputs_fresh=not self._watchdog.stale and status.connected,
            may_drive=status.engaged,
            fault=self._fault or now_s < self._held_until_s or self.pipeline.stopped,
            knows_surroundings=self._has_looked and not self.pipeline.is_settling,
            has_goal=self.pipeline.has_task or self.pipeline.mission.holds,
            warned=self.health.warned(now_s) or self.envelope.response is not Response.NONE,
        )


def _station(places_N: Float64, stamp_ns: int) -> Station:
    heading = None
    if len(places_N) > 1:
        north, east = (places_N[1] - places_N[0]).tolist()
        heading = math.atan2(east, north)
    return Station(stamp_ns=stamp_ns, position_N=places_N[0], heading=heading)


def make_vessel(
    config: RuntimeConfig, *, pipeline: Pipeline | None = None, looks_first: bool = True
) -> Vessel:
    """Make everything of a vessel's runtime but its sockets and its clock.

    Parameters
    ----------
    pipeline
        In place of the configured one (`make_pipeline`).
    looks_first
        See `Vessel`.

    Raises
    ------
    ConfigError, PolicyError
        Something configured does not exist or cannot be used: before anything moves.
    """
    autopilot, source = autopilot_of(config), config.odometry_source
    chart = chart_of(config)
    pipeline = pipeline or make_pipeline(config)
    _check_goals(config, chart)
    return Vessel(
        pipeline,
        make_autopilot(autopilot, config.ground.orders),
        report=GroundReport(
            config.ground,
            autopilot.datum,
            autopilot.system_id,
            sees_m=config.perception.max_range_m,
        ),
        odometry=config.odometry,
        alignment=Alignment(config.alignment) if source == "autopilot" else None,
        estimator=Estimator(config.estimation) if source == "gps_imu" else None,
        frames=Frames(config.frames, config.name, sensor_of(config)),
        looks_first=looks_first,
        envelope=Envelope(config.envelope),
        slow=slow_of(config),
        chart=chart,
        follows_fences=config.chart.autopilot_fences,
    )


def chart_of(config: RuntimeConfig) -> StaticMap:
    """Read what a configuration says is fixed around the boat.

    Raises
    ------
    ConfigError
        Its chart cannot be used, or leaves no water.
    """
    settings = config.chart
    features = read_chart(settings, datum_of(config)).features
    if not features:
        return StaticMap.empty()
    depth_m = safety_depth_m(settings, load_vessel(config.vessel).draught_m)
    chart = StaticMap.of(features, safety_depth_m=depth_m)
    if not chart.leaves_water:
        raise ConfigError("its land and fences leave no water", key="chart")
    return chart


def _check_goals(config: RuntimeConfig, chart: StaticMap) -> None:
    """Refuse a goal of the configuration that its chart forbids."""
    for number, place in enumerate(config.mission.waypoints_m):
        why = chart.why(np.array(place))
        if why:
            north, east = place
            raise ConfigError(
                f"north {north:g} m, east {east:g} m is {why}", key=f"mission.waypoints_m[{number}]"
            )


def slow_of(config: RuntimeConfig) -> SpeedLimit:
    """Give what "slow" is for a vessel: a share of its top speed in still water."""
    thrust_n = config.thrust.max_n
    top_mps = config.assurance.vessel.top_speed_mps(thrust_n)
    return SpeedLimit(config.envelope.slow_share * top_mps, thrust_n / top_mps, top_mps)


def vessel_for_replay(
    config: RuntimeConfig, *, has_odometry: bool = True, has_chart: bool = False
) -> Vessel:
    """Make a vessel that takes in a recording, which holds its own odometry and engagement too.

    Parameters
    ----------
    has_odometry
        If the recording has none, it is made of GPS and IMU where these are its configured source.
    has_chart
        Whether the recording holds the map, so that the configured chart is not read.
    """
    makes_odometry = config.odometry_source == "gps_imu" and not has_odometry
    return make_vessel(
        structs.replace(
            config,
            odometry_source="gps_imu" if makes_odometry else "bus",
            chart=ChartSettings() if has_chart else config.chart,
            autopilot=structs.replace(config.autopilot, signing_key_file=""),  # stayed aboard
        )
    )
