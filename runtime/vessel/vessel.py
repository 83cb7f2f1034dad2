"""The core with its doors: payloads in, in the order they came; decisions out.

`run`, `sitl`, the experiments and `replay` all feed this one object, so that a recording of what
went in gives the same decisions again.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

from twinscrew.runtime.errors import MessageError
from twinscrew.runtime.link.autopilot import AutopilotLink, AutopilotStatus
from twinscrew.runtime.link.stations import Stations
from twinscrew.runtime.messages import cdr
from twinscrew.runtime.messages.topics import TOPICS
from twinscrew.runtime.messages.types import (
    Decision,
    Engagement,
    Float64,
    Goal,
    HealthEvent,
    Odometry,
    PointCloud,
)
from twinscrew.runtime.perception.stage import Perception
from twinscrew.runtime.policy.load import load_policy
from twinscrew.runtime.policy.metadata import PolicyExpectation
from twinscrew.runtime.safety.assurance import Assurance
from twinscrew.runtime.safety.events import (
    BAD_MESSAGE,
    CLOCK_BACK,
    GUARD_TRIPPED,
    INPUT_FROZEN,
    INPUT_LATE,
    INTERNAL_ERROR,
    LIDAR_STALE,
    ODOMETRY_JUMP,
    ODOMETRY_MISSING,
    ODOMETRY_STALE,
    OUT_OF_ORDER,
    PERCEPTION_ERROR,
    POLICY_ERROR,
)
from twinscrew.runtime.safety.guard import NEUTRAL, Guard
from twinscrew.runtime.safety.watchdog import Watchdog
from twinscrew.runtime.tracking.tracker import Tracker
from twinscrew.runtime.tracking.view import View
from twinscrew.runtime.vessel.config import RuntimeConfig, autopilot_of, sensor_of
from twinscrew.runtime.vessel.health import Facts, Health, State
from twinscrew.runtime.vessel.inputs import (
    Arrival,
    Freshness,
    OdometryBuffer,
    OdometryBufferSettings,
    seconds_between,
)
from twinscrew.runtime.vessel.mission import Mission
from twinscrew.runtime.vessel.own_odometry import (
    SENSED,
    Alignment,
    AutopilotOdometry,
    GpsImuOdometry,
    OdometrySource,
)
from twinscrew.runtime.vessel.pipeline import Pipeline


@dataclass(frozen=True, slots=True)
class Outcome:
    """What came of one payload."""

    stamp_ns: int | None = None
    """[ns] The message's stamp; None if it could not be read, or not be used."""
    decision: Decision | None = None
    """The decision, if the message was a scan that could be used."""
    events: tuple[HealthEvent, ...] = ()
    """What an operator should know, besides the decision's own events."""


class Core:
    """Decodes, puts in order, and steps the pipeline on every scan."""

    def __init__(self, pipeline: Pipeline, odometry: OdometryBufferSettings | None = None) -> None:
        self.pipeline = pipeline
        settings = odometry or OdometryBufferSettings()
        self._odometry = OdometryBuffer(settings)
        self._clock_back_s = settings.clock_back_s
        self._max_lag_s = settings.max_lag_s
        self._freshness = Freshness()
        self._engaged = False
        self._last_scan_ns: int | None = None
        self._latest_ns = 0
        self._doors: dict[str, Callable[[bytes], Outcome]] = {
            "points": lambda payload: self._scan(cdr.decode_point_cloud(payload)),
            "odometry": lambda payload: self._add_odometry(cdr.decode_odometry(payload)),
            "goal": lambda payload: self._set_goal(cdr.decode_goal(payload)),
            "route": lambda payload: self._set_route(*cdr.decode_path(payload)),
            "engagement": lambda payload: self._engage(cdr.decode_engagement(payload)),
        }

    @property
    def latest_ns(self) -> int:
        """[ns] The stamp of the last scan or odometry that was in order: what time it is."""
        return self._latest_ns

    @property
    def odometry(self) -> Odometry | None:
        """The last odometry that was in order."""
        return self._odometry.newest

    @property
    def scan_ns(self) -> int | None:
        """[ns] The stamp of the last scan that was in order, whether it could be used or not."""
        return self._last_scan_ns

    @property
    def knows_surroundings(self) -> bool:
        """Whether what is around has been seen for long enough; see `Pipeline`."""
        return self.pipeline.knows_surroundings

    @property
    def is_settling(self) -> bool:
        """Whether the thrust is zero because what is around was forgotten; see `Pipeline`."""
        return self.pipeline.is_settling

    def feed(self, topic: str, payload: bytes) -> Outcome:
        """Take in one message of a core input topic; it never raises.

        A fault of the runtime itself is an `internal_error`, after which everything remembered of
        the surroundings is forgotten: the next scan starts afresh.
        """
        try:
            return self._doors[topic](payload)
        except MessageError as error:
            return Outcome(events=(BAD_MESSAGE.at(self._latest_ns, f"{topic}: {error}"),))
        except Exception as error:  # must stop the boat, not the loop
            self.pipeline.reset()
            detail = f"{topic}: {type(error).__name__}: {error}"
            # The sensor lives, if its message got as far as to set the time.
            event = INTERNAL_ERROR.at(self._latest_ns, detail)
            return Outcome(stamp_ns=self._latest_ns, events=(event,))

    def _engage(self, engagement: Engagement) -> Outcome:
        self._engaged = engagement.engaged
        return Outcome(stamp_ns=engagement.stamp_ns)

    def _set_goal(self, goal: Goal) -> Outcome:
        return Outcome(stamp_ns=goal.stamp_ns, events=(self.pipeline.set_goal(goal),))

    def _set_route(self, stamp_ns: int, places_N: Float64) -> Outcome:
        return Outcome(stamp_ns=stamp_ns, events=(self.pipeline.set_route(places_N, stamp_ns),))

    def _add_odometry(self, odometry: Odometry) -> Outcome:
        stamp_ns = odometry.stamp_ns
        if self._freshness.odometry_repeats(odometry):
            return Outcome(events=(INPUT_FROZEN.at(self._latest_ns, "odometry"),))
        arrival = self._odometry.add(odometry)
        events: tuple[HealthEvent, ...] = ()
        if arrival is Arrival.OLD:
            late = OUT_OF_ORDER.at(self._latest_ns, f"odometry of {stamp_ns} ns")
            return Outcome(events=(late,))
        if arrival is Arrival.CLOCK_BACK:
            events = (self._restart("odometry", stamp_ns),)
        elif arrival is Arrival.JUMP:
            self.pipeline.reset()
            north, east = odometry.position_N[:2]
            events = (ODOMETRY_JUMP.at(stamp_ns, f"to north {north:.1f} m, east {east:.1f} m"),)
        self._latest_ns = stamp_ns
        return Outcome(stamp_ns=stamp_ns, events=events)

    def _scan(self, cloud: PointCloud) -> Outcome:
        stamp_ns = cloud.stamp_ns
        events: tuple[HealthEvent, ...] = ()
        if self._last_scan_ns is not None and stamp_ns <= self._last_scan_ns:
            if seconds_between(stamp_ns, self._last_scan_ns) <= self._clock_back_s:
                late = OUT_OF_ORDER.at(self._latest_ns, f"scan of {stamp_ns} ns")
                return Outcome(events=(late,))
            self._odometry.clear()
            events = (self._restart("points", stamp_ns),)
        lag_s = seconds_between(stamp_ns, self._latest_ns)
        self._last_scan_ns = self._latest_ns = stamp_ns
        odometry = self._odometry.at(stamp_ns)
        if odometry is None:
            missing = ODOMETRY_MISSING.at(stamp_ns)
            return Outcome(events=(*events, missing))
        if not events and lag_s > self._max_lag_s:
            late = INPUT_LATE.at(stamp_ns, f"a scan {lag_s:.2f} s older than the odometry")
            return Outcome(events=(late,))
        if self._freshness.scan_repeats(cloud, odometry):
            return Outcome(events=(*events, INPUT_FROZEN.at(stamp_ns, "points")))
        decision = self.pipeline.step(cloud, odometry, engaged=self._engaged)
        return Outcome(stamp_ns=stamp_ns, decision=decision, events=events)

    def _restart(self, topic: str, stamp_ns: int) -> HealthEvent:
        self.pipeline.reset()
        self._last_scan_ns = None
        back_s = seconds_between(stamp_ns, self._latest_ns)
        return CLOCK_BACK.at(stamp_ns, f"{topic}: {back_s:.3f} s before the last message")


# -- One vessel's runtime without its sockets and its clock.
#
# `run` wraps it in real time, the lock-step driver in simulated time; what they share is everything
# that decides whether a propeller turns. Messages and MAVLink bytes come in with the time; MAVLink
# bytes, and messages to publish, go out.

FAULTS = {kind.name for kind in (POLICY_ERROR, PERCEPTION_ERROR, GUARD_TRIPPED, INTERNAL_ERROR)}


WATCHED = {"points": LIDAR_STALE, "odometry": ODOMETRY_STALE}
"""The inputs that must keep coming, and what it is called when they do not."""

FAULT_HOLD_S = 1.0
"""[s] After a fault of the runtime itself the thrust is neutral for this long."""
DISOBEYED_S = 5.0
"""[s] After the autopilot ignored the commands, neutral thrust this long before the next try."""


@dataclass(frozen=True, slots=True)
class Handled:
    """What came of a message: the decision, if any, and what to tell the operator."""

    decision: Decision | None
    events: tuple[HealthEvent, ...]


class Controller:
    """Core, watchdog, guard, health and autopilot link of one vessel."""

    def __init__(
        self,
        core: Core,
        link: AutopilotLink,
        odometry: OdometrySource | None = None,
        *,
        looks_first: bool = True,
    ) -> None:
        """Join them.

        Parameters
        ----------
        odometry
            Makes odometry, if that does not come over the bus.
        looks_first
            Whether nothing may be driven before the surroundings have been seen for long enough,
            at the very start too. A simulation in lock-step begins with vessels that may.
        """
        self.core = core
        self.link = link
        self._odometry = odometry
        self.health = Health()
        self.decision: Decision | None = None
        self._guard = Guard(core.pipeline.guard.limits)
        self._watchdog = Watchdog(
            {name: (kind, TOPICS[name].max_age_s or math.inf) for name, kind in WATCHED.items()}
        )
        self._disobeyed_until_s = -math.inf
        self._engaged = False
        self._fault = False
        self._has_looked = not looks_first
        self._inputs_too_old = False
        self._held_until_s = self._now_s = -math.inf

    @property
    def state(self) -> State:
        """What the vessel is doing."""
        return self.health.state

    @property
    def stamp_ns(self) -> int:
        """[ns] The core's time, by the stamps of what it took in."""
        return self.core.latest_ns

    @property
    def engaged(self) -> bool:
        """Whether the core's thrust goes to the propellers."""
        return self._engaged

    def take_in(self, topic: str, payload: bytes, now_s: float) -> Handled:
        """Feed one message to the core, or a sensor's to where odometry is made of it.

        It never raises on the message's content.
        """
        self._look(now_s)
        if topic in SENSED:
            return self._sense(topic, payload, now_s)
        scan_before_ns = self.core.scan_ns
        outcome = self.core.feed(topic, payload)
        scan_ns = self.core.scan_ns
        if self._odometry is not None and scan_ns is not None and scan_ns != scan_before_ns:
            self._odometry.scan_came(scan_ns, now_s)
        if outcome.stamp_ns is not None:
            self._watchdog.seen(topic, outcome.stamp_ns, now_s)
        events = outcome.events
        if outcome.decision is not None:
            self.decision = outcome.decision
            events += outcome.decision.events
        faulty = any(event.name in FAULTS for event in events)
        if faulty or outcome.decision is not None:
            self._fault = faulty
        self._has_looked = self._has_looked or self.core.knows_surroundings
        self.note(events, now_s)
        return Handled(outcome.decision, events)

    def note(self, events: tuple[HealthEvent, ...], now_s: float) -> None:
        """Let the vessel's state follow from events; the loop notes its own here."""
        self.health.note(events, now_s)

    def from_autopilot(self, data: bytes, now_s: float) -> None:
        """Take in bytes that came from the autopilot."""
        if data:
            self.link.receive(data, now_s)

    @property
    def has_own_odometry(self) -> bool:
        """Whether odometry is made here, of other messages."""
        return self._odometry is not None

    def own_odometry(self) -> list[bytes]:
        """Give the odometry that was made since the last call, to be fed to the core."""
        return [] if self._odometry is None else self._odometry.payloads()

    def supervise(self, now_s: float) -> tuple[bytes | None, tuple[HealthEvent, ...]]:
        """Look at the inputs' ages and the autopilot; say what changed.

        Returns
        -------
        engagement : bytes or None
            Where the right to drive changed: the message that the core must be fed, and the
            recorder keep, as an input like any other.
        events
            What an operator should know.
        """
        self._look(now_s)
        said = [replace(event, stamp_ns=self.stamp_ns) for event in self.link.events(now_s)]
        if self._odometry is not None:
            troubles = self._odometry.take_troubles()
            said += [BAD_MESSAGE.at(self.stamp_ns, f"odometry: {why}") for why in troubles]
        events = [*self._watchdog.check(now_s, self.stamp_ns), *said]
        self.note(tuple(events), now_s)
        status = self.link.status
        may_drive = self._may_drive(status, now_s)
        change = self.health.step(self._facts(status, may_drive, now_s), self.stamp_ns)
        if change:
            events.append(change)
        ready = self._has_looked and not self._is_held(now_s)
        engaged = may_drive and ready and not self._watchdog.stale
        if engaged == self._engaged:
            return None, tuple(events)
        message = cdr.encode_engagement(Engagement(stamp_ns=self.stamp_ns, engaged=engaged))
        self._engaged = engaged
        return message, tuple(events)

    def command(self, now_s: float) -> bytes:
        """Give the MAVLink bytes to send now: the thrust, and what the link has to say.

        On inputs that are too old the thrust is neutral, and nothing is asked of the autopilot,
        whatever `supervise` found when it was last called.
        """
        self._look(now_s)
        thrust, _ = self._guard.check(self.thrust, self.stamp_ns)
        wanted = None if self.state is State.READY and not self._has_goal else thrust
        asks = not self._inputs_too_old
        return self.link.command(wanted, now_s) + self.link.tick(now_s, may_ask=asks)

    def hold(self, now_s: float) -> bytes:
        """Hold the thrust neutral after a fault of the runtime, and give the bytes that say so."""
        self._held_until_s = now_s + FAULT_HOLD_S
        return self.link.command(NEUTRAL, now_s)

    def rest(self, now_s: float) -> bytes:
        """Give the last MAVLink bytes of a run: propellers at stop."""
        self._engaged = False
        return self.link.command(NEUTRAL, now_s) + self.link.tick(now_s)

    @property
    def thrust(self) -> Float64:
        """[N] (2,) What the propellers should give now, left and right."""
        if not self._engaged or self._fault or self._inputs_too_old or self.decision is None:
            return NEUTRAL
        return NEUTRAL if self._is_held(self._now_s) else self.decision.thrust

    def _look(self, now_s: float) -> None:
        """Look at the inputs' ages: the first thing that is done, however long nothing was."""
        self._now_s = now_s
        self._watchdog.awake(now_s)
        self._inputs_too_old = self._watchdog.too_old(now_s)

    def _is_held(self, now_s: float) -> bool:
        return now_s < self._held_until_s

    def _sense(self, topic: str, payload: bytes, now_s: float) -> Handled:
        events: tuple[HealthEvent, ...] = ()
        if self._odometry is not None:
            try:
                events = self._odometry.sense(topic, payload)
            except MessageError as error:
                events = (BAD_MESSAGE.at(self.stamp_ns, f"{topic}: {error}"),)
            except Exception as error:  # must stop the boat, not the loop: no odometry follows
                self._odometry.restart()
                detail = f"{topic}: {type(error).__name__}: {error}"
                events = (INTERNAL_ERROR.at(self.stamp_ns, detail),)
        self.note(events, now_s)
        return Handled(None, events)

    @property
    def _has_goal(self) -> bool:
        mission = self.core.pipeline.mission
        return mission.goal is not None and not mission.arrived

    def _may_drive(self, status: AutopilotStatus, now_s: float) -> bool:
        if status.obeying is False:
            self._disobeyed_until_s = now_s + DISOBEYED_S
        return status.engaged and now_s >= self._disobeyed_until_s

    def _facts(self, status: AutopilotStatus, may_drive: bool, now_s: float) -> Facts:
        return Facts(
            inputs_heard=self._watchdog.all_heard and status.message_age_s < math.inf,
            inputs_fresh=not self._watchdog.stale and status.connected,
            may_drive=may_drive,
            fault=self._fault or self._is_held(now_s),
            knows_surroundings=self._has_looked and not self.core.is_settling,
            has_goal=self._has_goal,
            warned=self.health.warned(now_s),
        )


# -- Puts the parts of one vessel's runtime together from its configuration.


def make_core(config: RuntimeConfig) -> Core:
    """Make the core: sensor, perception, tracker, policy, mission.

    Raises
    ------
    ConfigError, PolicyError
        Something configured does not exist or cannot be used: before anything moves.
    """
    sensor = sensor_of(config)
    pipeline = Pipeline(
        perception=Perception(sensor, config.perception),
        tracker=Tracker(config.tracking, View.of(sensor)),
        policy=load_policy(config.policy, expected_of_policies(config), config.risk),
        mission=Mission(config.mission),
        guard=Guard(config.thrust),
        observation=config.observation,
        assurance=Assurance(config.assurance, config.thrust),
    )
    return Core(pipeline, config.odometry)


def expected_of_policies(config: RuntimeConfig) -> PolicyExpectation:
    """Give what a policy must have been trained with, to be the vessel's."""
    return PolicyExpectation(
        thrust_min_n=config.thrust.min_n,
        thrust_max_n=config.thrust.max_n,
        perception_range_m=config.perception.max_range_m,
    )


def make_controller(config: RuntimeConfig, *, looks_first: bool = True) -> Controller:
    """Make everything of a vessel's runtime but its sockets and its clock; see `Controller`."""
    autopilot = autopilot_of(config)
    us = (autopilot.system_id, autopilot.component_id)
    stations = Stations(config.ground.orders, autopilot.datum, us)
    link = AutopilotLink(autopilot, stations=stations)
    source = odometry_source(config, link)
    return Controller(make_core(config), link, source, looks_first=looks_first)


def odometry_source(config: RuntimeConfig, link: AutopilotLink) -> OdometrySource | None:
    """Make what odometry comes from; None if that is the bus."""
    if config.odometry_source == "autopilot":
        return AutopilotOdometry(link, Alignment(config.alignment))
    if config.odometry_source == "gps_imu":
        return GpsImuOdometry(config.estimation)
    return None
