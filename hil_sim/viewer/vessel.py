"""What is known of one vessel: follows its topics, live or recorded, and gives its view."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from typing import Final, TypeAlias

import numpy as np
from msgspec import structs
from numpy.typing import NDArray

from twinscrew.hil_sim.viewer.scene import Ended, Region, VesselResult, region_of
from twinscrew.hil_sim.viewer.wire import (
    POINT_BYTES,
    EventView,
    OutcomeView,
    Part,
    TrackView,
    VesselView,
    encode_part,
)
from twinscrew.runtime.charts.chart import as_map
from twinscrew.runtime.errors import MessageError
from twinscrew.runtime.geometry import rotation_2d, rotation_from_quaternion
from twinscrew.runtime.messages import cdr
from twinscrew.runtime.messages.navigation import read_stamp
from twinscrew.runtime.messages.point_cloud import POINT_CLOUD_TYPE
from twinscrew.runtime.messages.types import (
    Decision,
    Explanation,
    Float64,
    Objects,
    Odometry,
    PointCloud,
    Tracks,
)
from twinscrew.runtime.messages.wire import Reader
from twinscrew.runtime.perception.sensor import Sensor
from twinscrew.runtime.policy.colregs import situation
from twinscrew.runtime.safety.events import AUTOPILOT_NOW, ENVELOPE_NOW, STATE, STATE_NOW
from twinscrew.runtime.safety.explain import (
    OWN_RADIUS_M,
    assurance_manoeuvre,
    closest_approach,
    explain,
    velocity_over_ground,
)

Circle: TypeAlias = tuple[float, float, float]
Places: TypeAlias = tuple[tuple[float, float, float], ...]
"""Time [s], north, east [m]."""
Row: TypeAlias = tuple[float | None, ...]
"""Of a time series: the columns of `wire.SERIES`."""

SHOWN: Final = (
    "points",
    "odometry",
    "goal",
    "engagement",
    "decision",
    "explanation",
    "thrust_left",
    "thrust_right",
    "diagnostics",
    "path",
    "chart",
    "planned_route",
)
"""The topics that are looked at: decisions hold objects and tracks, bit for bit."""
FRESH_S = 1.0
"""[s] Older decisions, scans and thrusts are not shown: they tell of another moment."""
ROUTE_S = 3.0
"""[s] Older routes are not shown; one is told every second."""
MOST_WAYPOINTS = 100
"""[-] Of a route that is shown."""
NEW_EVENTS = 8
"""[-] How many of the newest health events go with each frame."""
MOST_EVENTS = 500
"""[-] How many are kept."""
SCANS = 8
"""[-] How many scans may wait for their decision, to tell the latency."""
MOST_POINTS = 1500
"""[-] Points of a vessel in one frame: 6 kB."""
REACH_M = 300.0
"""[m] Farther echoes do not fit into 16 bits of centimetres (327 m)."""
TRAIL_STEP_M = 0.5
"""[m] A place nearer than this to the last one adds nothing that could be seen."""
MOST_PLACES = 2000
"""[-] Of a trail; when there are more, every second one is forgotten and the step doubles."""
SERIES_STEP_S = 0.2
"""[s] Between two rows of a time series."""
MOST_ROWS = 1200
"""[-] Of a time series; when there are more, every second one goes and the step doubles."""
AHEAD_S = 20.0
"""[s] A time series' least CPA is of tracks that are nearest within this."""
OUTCOMES: Final = {
    "goal": ("arrived", "info"),
    "collision": ("collided", "error"),
    "timeout": ("out_of_time", "warning"),
    "done": ("trial_done", "info"),
    "ended": ("trial_ended", "warning"),
}
"""What the end of a vessel's run is called among its events, and how bad it is."""
FALLS_SILENT_S = 0.3
"""[s] After so long without odometry, a vessel with a result is taken to have got it."""
AT_GOAL_SLACK_M = 0.5
"""[m] Between two messages of odometry: the last one may be this far short of the goal."""


class Trail:
    """Collects places as they come: a line to draw, of a bounded number of places."""

    def __init__(self, step_m: float = TRAIL_STEP_M, most: int = MOST_PLACES) -> None:
        self._step_m = step_m
        self._most = most
        self._places: list[tuple[float, float, float]] = []
        self.is_preceded = False
        """Whether the way before the first place is known too."""

    def add(self, time_s: float, north: float, east: float) -> None:
        """Take in a place [s, m, m], if it is far enough from the last one."""
        if self._places:
            _, last_north, last_east = self._places[-1]
            if (north - last_north) ** 2 + (east - last_east) ** 2 < self._step_m**2:
                return
        self._places.append((round(time_s, 2), round(north, 2), round(east, 2)))
        if len(self._places) > self._most:
            del self._places[1::2]
            self._step_m *= 2.0

    def precede(self, p_N: Float64) -> None:
        """Put the way in front that was sailed before anybody looked; the first telling counts.

        Parameters
        ----------
        p_N : (K, 2) float64
            [m] The whole way until now, oldest first, frame N: beyond where our own places begin
            it says nothing new.
        """
        if self.is_preceded or not self._places or not len(p_N):
            return
        begin_s, north, east = self._places[0]
        nearest = int(np.argmin(np.hypot(p_N[:, 0] - north, p_N[:, 1] - east)))
        earlier = [(begin_s, round(n, 2), round(e, 2)) for n, e in p_N[:nearest].tolist()]
        self._places = [*earlier, *self._places][-self._most :]
        self.is_preceded = bool(earlier)

    @property
    def places(self) -> Places:
        """Time [s], north, east [m], oldest first."""
        return tuple(self._places)


class Series:
    """Collects rows of figures at even times, from the beginning, never more than some."""

    def __init__(self, step_s: float = SERIES_STEP_S, most: int = MOST_ROWS) -> None:
        self._step_s = step_s
        self._most = most
        self.rows: list[Row] = []
        """The first column is the time [s]."""

    def is_due(self, time_s: float) -> bool:
        """Tell whether it is time for the next row."""
        last_s = self.rows[-1][0] if self.rows else None
        return last_s is None or time_s >= last_s + self._step_s - 1e-3

    def add(self, row: Row) -> None:
        """Take in a row."""
        self.rows.append(row)
        if len(self.rows) > self._most:
            del self.rows[1::2]
            self._step_s *= 2.0


class Vessel:
    """Takes in a vessel's messages in the order of their times; never fails on their content."""

    def __init__(self, name: str, sensor: Sensor, goal_radius_m: float = 0.0) -> None:
        self.name = name
        self.trail = Trail()
        self.series = Series()
        self.events: deque[EventView] = deque(maxlen=MOST_EVENTS)
        self.refused = 0
        """[-] Messages that were not what they should be."""
        self._sensor = sensor
        self._goal_radius_m = goal_radius_m
        self._odometry: Odometry | None = None
        self._decision: Decision | None = None
        self._explanation: Explanation | None = None
        self._assurance = ""
        self._cloud: bytes | None = None
        self._thrust_N = np.zeros(2)
        self._heard_s: dict[str, float] = {}
        self._goal: Float64 | None = None
        self._engaged: bool | None = None
        self._autopilot = ""
        self._envelope = ""
        self._state = "unknown"
        self._event_count = 0
        self._sent_s: dict[int, float] = {}
        self._latency_ms: float | None = None
        self._decisions = 0
        self.chart: tuple[Region, ...] = ()
        """What it knows of what is fixed, as it is drawn."""
        self._route = np.empty((0, 2))
        self.charts = 0
        """[-] How many charts it has had."""
        self._ended: Sequence[Ended] = ()
        self._result: VesselResult | None = None

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

    def ends(self, rows: Sequence[Ended], result: VesselResult | None = None) -> None:
        """Take in what became of it, from the run's folder: its sensors fall silent, that is all.

        Parameters
        ----------
        rows
            Where it was from its run's end on, in the order of time.
        result
            The same without places, for runs that left none.
        """
        self._ended, self._result = rows, result

    @property
    def ended_s(self) -> float | None:
        """[s] When its run ended, on the view's clock, or a moment later; None if it has not."""
        odometry = self._odometry
        if odometry is None or not (self._ended or self._result):
            return None
        since_s = (self._ended[0].stamp_ns - odometry.stamp_ns) * 1e-9 if self._ended else 0.0
        return self._heard_s["odometry"] + max(since_s, 0.0) + FALLS_SILENT_S

    def note(self, now_s: float) -> None:
        """Keep the figures of a time for the time series, if it is time for a row."""
        if self._odometry is None or not self.series.is_due(now_s):
            return
        speed, to_goal = self._figures()
        nearest = cpa = None
        decision = self._decision
        if decision is not None and self._is_fresh("decision", now_s) and len(decision.tracks.id):
            gaps, cpas, times = self._approach(decision.tracks, self._odometry)
            nearest = round(float(gaps.min()), 2)
            soon = cpas[times < AHEAD_S]
            cpa = round(float(soon.min()), 2) if len(soon) else None
        thrust = pair(self._thrust_N) if self._is_fresh("thrust_left", now_s) else (None, None)
        over = self._outcome(now_s) is not None
        figures: Row = (0.0, to_goal, None, None, None, None, None)
        if not over:
            figures = (speed, to_goal, nearest, cpa, *thrust, self._latency_ms)
        self.series.add((round(now_s, 2), *figures))

    def events_at(self, now_s: float) -> tuple[EventView, ...]:
        """Give the health events, oldest first.

        Those of a vessel whose run is over tell of sensors that were switched off: left out.
        """
        over = self._outcome(now_s)
        if over is None:
            return tuple(self.events)
        until_s = self._heard_s["odometry"] + 0.05
        known = [event for event in self.events if event.time_s <= until_s]
        name, severity = OUTCOMES.get(over.outcome, (over.outcome, "warning"))
        return (*known, EventView(round(until_s, 2), name, severity, _took(over)))

    def part(self, now_s: float) -> Part:
        """Give the vessel's share of a frame at a time."""
        ended = self._outcome(now_s) is not None
        points = self._points() if self._is_fresh("points", now_s) and not ended else b""
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
            case "explanation":
                self._explanation = cdr.decode_explanation(payload)
            case "engagement":
                self._engaged = cdr.decode_engagement(payload).engaged
            case "goal":
                self._goal = cdr.decode_goal(payload).position_N
            case "thrust_left" | "thrust_right":
                self._thrust_N[int(topic == "thrust_right")] = cdr.decode_thrust(payload)
            case "chart":
                known = as_map(cdr.decode_chart(payload))
                self.chart = tuple(map(region_of, known.polygons))
                self.charts += 1
            case "planned_route":
                self._route = cdr.decode_path(payload)[1][:MOST_WAYPOINTS, :2]
            case "path":
                self.trail.precede(cdr.decode_path(payload)[1])
            case "diagnostics":
                self._happened(payload, time_s)

    def _note_scan(self, stamp_ns: int, sent_s: float) -> None:
        self._sent_s[stamp_ns] = sent_s
        while len(self._sent_s) > SCANS:
            del self._sent_s[next(iter(self._sent_s))]

    def _decide(self, decision: Decision, sent_s: float) -> None:
        self._decision = decision
        self._decisions = decision.sequence + 1
        self._assurance = assurance_manoeuvre(decision, self._assurance)
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

    def _happened(self, payload: bytes, time_s: float) -> None:
        for event in cdr.decode_diagnostics(payload):
            if event.name == STATE_NOW.name:
                self._state = event.detail
                continue
            if event.name == AUTOPILOT_NOW.name:
                self._autopilot = event.detail
                continue
            if event.name == ENVELOPE_NOW.name:
                self._envelope = event.detail
                continue
            if event.name == STATE.name:
                self._state = event.detail.rpartition(" ")[2]
            severity = event.severity.value
            self.events.append(EventView(round(time_s, 2), event.name, severity, event.detail))
            self._event_count += 1

    def _is_fresh(self, topic: str, now_s: float) -> bool:
        return now_s - self._heard_s.get(topic, -np.inf) <= FRESH_S

    def _is_fresh_route(self, now_s: float) -> bool:
        return now_s - self._heard_s.get("planned_route", -np.inf) <= ROUTE_S

    def _points(self) -> bytes:
        if self._cloud is None or self._odometry is None:
            return b""
        try:
            cloud = cdr.decode_point_cloud(self._cloud)
        except MessageError:
            self.refused += 1
            return b""
        return echoes_from_above(cloud, self._odometry, self._sensor).tobytes()

    def _figures(self) -> tuple[float | None, float | None]:
        """Give speed over ground [m/s] and distance to the goal [m]."""
        odometry = self._odometry
        if odometry is None:
            return None, None
        speed = round(float(np.hypot(*velocity_over_ground(odometry))), 2)
        if self._goal is None:
            return speed, None
        return speed, round(float(np.hypot(*(self._goal - odometry.position_N[:2]))), 2)

    def _approach(self, tracks: Tracks, odometry: Odometry) -> tuple[Float64, Float64, Float64]:
        """Give every track's gap now, closest approach [m] and the time until it [s]."""
        p = tracks.p_N - odometry.position_N[:2]
        nearest = closest_approach(p, tracks.v_N - velocity_over_ground(odometry), tracks.radius)
        gaps = np.hypot(p[:, 0], p[:, 1]) - tracks.radius - OWN_RADIUS_M
        return gaps, nearest.cpa_m, nearest.tcpa_s

    def _outcome(self, now_s: float) -> Ended | VesselResult | None:
        """Give how its run has ended, if it has at this time.

        Without word of it: a vessel that fell silent at its goal has arrived, because a simulator
        switches its sensors off there, before the boat could say so itself.
        """
        odometry = self._odometry
        if odometry is None:
            return None
        silent_s = now_s - self._heard_s["odometry"]
        if self._ended:
            now_ns = odometry.stamp_ns + round(1e9 * silent_s)
            past = [row for row in self._ended if row.stamp_ns <= now_ns]
            return past[-1] if past else None
        if self._result is not None:
            return self._result if silent_s >= FALLS_SILENT_S else None
        _, to_goal = self._figures()
        at_goal = to_goal is not None and to_goal <= self._goal_radius_m + AT_GOAL_SLACK_M
        if self._goal_radius_m and at_goal and silent_s > FRESH_S:
            return VesselResult(name=self.name, outcome="goal", travel_time_s=float("nan"))
        return None

    def _sentence(self) -> Explanation | None:
        """Give the runtime's own words, or if it recorded none, the same made from its decision."""
        decision, said, odometry = self._decision, self._explanation, self._odometry
        if decision is None or odometry is None:
            return None
        if said is not None and said.sequence == decision.sequence:
            return said
        engaged = self._state in {"active", "degraded"} if self._engaged is None else self._engaged
        return explain(decision, odometry, self._goal, engaged=engaged, assurance=self._assurance)

    def _view(self, now_s: float, points: int) -> VesselView:
        odometry, events = self._odometry, self.events_at(now_s)
        view = VesselView(
            name=self.name,
            state=self._state,
            autopilot=self._autopilot,
            envelope=self._envelope,
            engaged=self._engaged,
            events=events[-NEW_EVENTS:],
            event_count=self._event_count - len(self.events) + len(events),
        )
        if odometry is None:
            return view
        north, east, _ = odometry.position_N.tolist()
        velocity_N = velocity_over_ground(odometry)
        view = structs.replace(
            view,
            pose=(round(north, 2), round(east, 2), round(odometry.heading, 4)),
            velocity=pair(velocity_N),
            silent_s=round(now_s - self._heard_s["odometry"], 2),
            goal=None if self._goal is None else pair(self._goal),
            route=tuple(map(pair, self._route)) if self._is_fresh_route(now_s) else (),
            decisions=self._decisions,
        )
        over = self._outcome(now_s)
        if over is not None:
            return self._ended_view(view, over)
        view = structs.replace(
            view,
            thrust=pair(self._thrust_N) if self._is_fresh("thrust_left", now_s) else None,
            points=points,
        )
        decision, said = self._decision, self._sentence()
        if decision is None or said is None or not self._is_fresh("decision", now_s):
            return view
        return structs.replace(
            view,
            arrived=decision.arrived,
            latency_ms=self._latency_ms,
            why=said.sentence,
            about=said.track,
            rule=said.rule,
            tracks=self._tracks(decision.tracks, odometry),
            objects=object_views(decision.objects, odometry),
        )

    def _ended_view(self, view: VesselView, over: Ended | VesselResult) -> VesselView:
        """Give the view of a vessel whose run is over: where it is held, at rest, no alarm."""
        took_s = None if np.isnan(over.travel_time_s) else over.travel_time_s
        outcome = OutcomeView(over.outcome, took_s, over.closest_approach_m)
        name, _ = OUTCOMES.get(over.outcome, (over.outcome, ""))
        after = f" {took}" if (took := _took(over)) else ""
        near_m = over.closest_approach_m
        near = "" if near_m is None else f", nothing nearer than {max(near_m, 0.0):.1f} m"
        return structs.replace(
            view,
            pose=over.pose if isinstance(over, Ended) else view.pose,
            velocity=(0.0, 0.0),
            silent_s=0.0,
            arrived=over.outcome == "goal",
            ended=outcome,
            state=over.outcome,
            why=f"{name.replace('_', ' ').capitalize()}{after}{near}.",
        )

    def _tracks(self, tracks: Tracks, odometry: Odometry) -> tuple[TrackView, ...]:
        v_ego = np.broadcast_to(velocity_over_ground(odometry), tracks.v_N.shape)
        asked = situation(tracks.p_N - odometry.position_N[:2], tracks.v_N, v_ego)
        gaps, cpas, times = self._approach(tracks, odometry)
        times = np.minimum(times, 9999.0)
        columns = [tracks.p_N, tracks.v_N, tracks.radius, tracks.age_s, gaps, cpas, times]
        rows = np.column_stack(columns).round(2).tolist()
        return tuple(
            TrackView(id_, north, east, v_north, v_east, radius, unseen_s, rule, gap, cpa, tcpa)
            for id_, rule, (north, east, v_north, v_east, radius, unseen_s, gap, cpa, tcpa) in zip(
                tracks.id.tolist(), asked.tolist(), rows, strict=True
            )
        )


def echoes_from_above(
    cloud: PointCloud, odometry: Odometry, sensor: Sensor, most: int = MOST_POINTS
) -> NDArray[np.int16]:
    """Give the echoes around a vessel: levelled, thinned out.

    Parameters
    ----------
    cloud
        May hold rays without an echo (not finite).
    odometry
        Near the scan's time: its attitude levels the points.
    most
        [-] How many points to give; from a larger scan, every second, third, ... is taken.

    Returns
    -------
    p_cm : (M, 2) int16
        [cm] North and east of the vessel, axes of N, M <= most.
    """
    points_S = cloud.points_S[np.isfinite(cloud.points_S).all(axis=1)]
    points_S = points_S[:: max(1, -(-len(points_S) // most))]
    R_NB = rotation_from_quaternion(odometry.q_NB)
    points_B = points_S @ sensor.R_BS.T + sensor.mount_position_B
    p_N = (points_B @ R_NB.T)[:, :2]
    p_N = p_N[(np.abs(p_N) < REACH_M).all(axis=1)]
    return np.round(100.0 * p_N).astype("<i2")


def object_views(objects: Objects, odometry: Odometry) -> tuple[Circle, ...]:
    """Give what perception found: north, east, radius [m]."""
    p_N = odometry.position_N[:2] + objects.p_L @ rotation_2d(odometry.heading).T
    rows = np.column_stack([p_N, objects.radius]).round(2)
    return tuple((north, east, radius) for north, east, radius in rows.tolist())


def _took(over: Ended | VesselResult) -> str:
    return "" if np.isnan(over.travel_time_s) else f"after {over.travel_time_s:.1f} s"


def pair(values: Float64) -> tuple[float, float]:
    """Give two numbers in hundredths: nobody sees less."""
    first, second = values.round(2).tolist()
    return first, second
