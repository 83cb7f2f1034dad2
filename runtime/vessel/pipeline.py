"""One scan, and the odometry at its time, become one decision.

No clock, no randomness, no I/O: the same scans give the same decisions, in a boat, in a simulator
and in a replay. A stage gives its value, and a `Fault` where it failed; then the thrust is zero.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Final, NamedTuple, Protocol, TypeAlias

import numpy as np

from twinscrew.runtime.charts.learnt import LearntMap
from twinscrew.runtime.charts.route import NO_WALLS, Guidance
from twinscrew.runtime.charts.static_map import StaticMap
from twinscrew.runtime.errors import PolicyError, TwinscrewError
from twinscrew.runtime.messages.types import (
    NANOSECONDS_PER_SECOND,
    Decision,
    Float64,
    Goal,
    HealthEvent,
    Objects,
    Observation,
    Odometry,
    PointCloud,
    Station,
    Tracks,
)
from twinscrew.runtime.perception.segmentation import Perception
from twinscrew.runtime.policy.load import Policy, load_policy
from twinscrew.runtime.policy.metadata import PolicyExpectation
from twinscrew.runtime.policy.observation import ObservationSettings, nothing_seen, observe
from twinscrew.runtime.safety.alarms import Alarms
from twinscrew.runtime.safety.assurance import Assurance
from twinscrew.runtime.safety.envelope import slowed
from twinscrew.runtime.safety.events import (
    AIS_SPOOFED,
    ASSURANCE_INTERVENED,
    INPUT_LATE,
    PERCEPTION_ERROR,
    POLICY_ERROR,
    ROUTE_FOUND,
    ROUTE_MISSING,
    TRACKS_FORGOTTEN,
)
from twinscrew.runtime.safety.guard import NEUTRAL, Guard
from twinscrew.runtime.senses.sense import OwnAt, Rarely, Sense
from twinscrew.runtime.senses.table import make_senses
from twinscrew.runtime.tracking.detections import Look
from twinscrew.runtime.tracking.lidar import SensorView
from twinscrew.runtime.tracking.tracker import Tracker, TrackerSettings
from twinscrew.runtime.vessel.config import RuntimeConfig, senses_of, sensor_of, tracking_of
from twinscrew.runtime.vessel.mission import Mission
from twinscrew.runtime.vessel.station import Berthing, Keeper
from twinscrew.runtime.vessel.trial import Trial
from twinscrew.runtime.vessel_description import load_vessel

Fault: TypeAlias = HealthEvent
"""The event by which a stage reports that it failed."""
SETTLE_S: Final = 1.0
"""[s] Scans must have come for this long before what is around is known: twice what five scans of a
10 Hz LiDAR take, within which every track that is seen is confirmed."""


MOST_LOOKS: Final = 1000
"""[-] Looks of other sensors that wait for a scan; the oldest are left out."""
SCANLESS_S = 1.0
"""[s] So long after the last scan the other sensors are listened to without one, this often."""
NEWER_S, OLDER_S = 1.0, 5.0
"""[s] A look that is so much newer or older than the vessel's time has a wrong stamp."""


class SpeedLimit(NamedTuple):
    """How fast the policy may drive the boat."""

    most_mps: float
    """[m/s] Ahead."""
    gain_nspm: float
    """[N s/m] Thrust for each metre a second that is missing, each propeller."""
    top_mps: float
    """[m/s] The boat's top speed in still water."""


class Driven(NamedTuple):
    """What the policy and the assurance did for one scan."""

    observation: Observation | None = None
    """What the policy saw; None if it was not asked."""
    fault: Fault | None = None
    """Why the policy failed, if it did; then the thrust is zero."""
    overridden: tuple[HealthEvent, ...] = ()
    """What the assurance reported."""


class PerceptionStage(Protocol):
    """Finds objects in a scan."""

    def step(
        self,
        cloud: PointCloud,
        q_NB: Float64,
        rates_B: Float64 | None = None,
        velocity_B: Float64 | None = None,
    ) -> Objects:
        """See `Perception.step`; it may raise a `TwinscrewError`."""


class TrackingStage(Protocol):
    """Follows objects from scan to scan."""

    settings: TrackerSettings
    note: str
    """Why the last step forgot all tracks; empty if it did not."""

    @property
    def doubted(self) -> tuple[str, ...]:
        """See `Tracker.doubted`."""

    def step(self, objects: Objects, odometry: Odometry) -> Tracks:
        """See `Tracker.step`."""

    def take(self, look: Look) -> bool:
        """See `Tracker.take`."""

    def seen_by_others(self, stamp_ns: int, own_N: Float64) -> Tracks:
        """See `Tracker.seen_by_others`."""

    def reset(self) -> None:
        """Forget all tracks."""


class AssuranceStage(Protocol):
    """Replaces a thrust that leads to contact."""

    def step(
        self,
        odometry: Odometry,
        tracks: Tracks,
        previous: Float64,
        command: Float64,
        *,
        decided: bool,
    ) -> tuple[Float64, tuple[HealthEvent, ...]]:
        """See `Assurance.step`."""

    def reset(self) -> None:
        """End a manoeuvre."""


class Pipeline:
    """Perception, tracking, observation, policy, assurance, guard: any of them may be replaced."""

    def __init__(
        self,
        *,
        perception: PerceptionStage,
        tracker: TrackingStage,
        policy: Policy,
        mission: Mission,
        guard: Guard,
        observation: ObservationSettings | None = None,
        assurance: AssuranceStage | None = None,
        senses: Mapping[str, Sequence[Sense]] | None = None,
        alarms: Alarms | None = None,
        guidance: Guidance | None = None,
        learnt: LearntMap | None = None,
        keeper: Keeper | None = None,
    ) -> None:
        self.senses = Senses(senses or {}, tracker, alarms or Alarms())
        self.perception = perception
        self.tracker = tracker
        self.policy = policy
        self.mission = mission
        self.guard = guard
        self.assurance = assurance
        self.trial = policy if isinstance(policy, Trial) else None
        """Manoeuvres in the policy's place, if any; then goals do not count."""
        self._orders_before_trial = mission.orders
        self._chart = StaticMap.empty()
        self.keeper = keeper
        """Holds places; None: at a place that is to be held the propellers rest."""
        self.berthing: Berthing | None = None
        """How the boat comes to the berth that the mission names."""
        self._observation = observation or ObservationSettings()
        self._schedule = DecisionSchedule(policy.period_s)
        life = tracker.settings.life
        self._settling = Settling(life.birth_scans, life.coast_s)
        self.speed_limit: SpeedLimit | None = None
        """How fast the policy may drive; the assurance may do more, to get out of the way."""
        self.stopped = False
        """Whether the thrust is zero because the boat has left its operational envelope."""
        self.guidance = guidance or Guidance(reach_m=self._observation.goal_range_m)
        """The way to the goal around what is fixed."""
        self.learnt = learnt
        """What the LiDAR has learnt of walls and free water; None: it does not."""
        self._held: Station | None = None
        """The place to hold, as no way leads to the goal."""
        self._sequence = 0
        self._rate: Float64 = NEUTRAL
        self._thrust: Float64 = NEUTRAL

    @property
    def chart(self) -> StaticMap:
        """What is fixed around the boat; whoever takes it in replaces it."""
        return self._chart

    @chart.setter
    def chart(self, chart: StaticMap) -> None:
        self._chart = chart
        if isinstance(self.assurance, Assurance):
            self.assurance.static_map = chart

    def step(
        self, cloud: PointCloud, odometry: Odometry, *, engaged: bool
    ) -> tuple[Decision, Fault | None]:
        """Decide on one scan.

        Parameters
        ----------
        cloud
            The scan.
        odometry
            The vessel's state at the scan's stamp.
        engaged
            Whether the thrust acts; if not, the policy is not asked and the thrust is zero. So it
            is until the surroundings have been seen for long enough after they were forgotten.

        Returns
        -------
        decision : Decision
            With the events of all stages.
        fault : Fault or None
            What failed: perception, the policy or the guard.
        """
        objects, blind = self._perceive(cloud, odometry)
        heard = self.senses.listen(cloud.stamp_ns) if self.senses.by_topic else ()
        tracks, gap = self._track(objects, odometry)
        self._settling.step(cloud.stamp_ns, seen=blind is None)
        self._find_berth(odometry)
        progress = self.mission.step(odometry)
        self._learn(cloud.stamp_ns, odometry)
        acts = engaged and not self.stopped and not self.is_settling
        idle = blind is not None or not acts
        broken_off = self._watch_berthing(cloud.stamp_ns, acts=acts)
        goal, told = self._guide(odometry, idle=idle)
        station = self.mission.station or self._held
        if self.trial is not None:
            observation, failed, overridden = self._try(self.trial, odometry, tracks, idle=idle)
        elif self.berthing is not None and self.mission.berths and not idle:
            observation, failed, overridden = self._come_in(self.berthing, odometry, tracks)
        elif self.keeper is not None and station is not None and not idle:
            observation, failed, overridden = self._keep(self.keeper, odometry, station, tracks)
        elif goal is None or idle:
            observation, failed, overridden = self._stop()
        else:
            observation, failed, overridden = self._drive(odometry, goal, tracks)
        self._thrust, tripped = self.guard.check(self._thrust, cloud.stamp_ns)
        alarmed = self.senses.alarmed(odometry, tracks) if self.senses.by_topic else ()
        before = (blind, *heard, gap, progress, *broken_off, told)
        reported = (*before, failed, *overridden, *alarmed, tripped)
        decision = Decision(
            stamp_ns=cloud.stamp_ns,
            sequence=self._sequence,
            acted=observation is not None,
            thrust_rate=self._rate,
            thrust=self._thrust,
            observation=observation,
            objects=objects,
            tracks=tracks,
            events=tuple(event for event in reported if event is not None),
            arrived=self.mission.arrived,
        )
        self._sequence += 1
        return decision, blind or failed or tripped

    @property
    def has_task(self) -> bool:
        """Whether there is something to do: a goal that is not reached, a place, or a trial."""
        if self.trial is not None:
            return not self.trial.over or self.trial.braking
        mission = self.mission
        if mission.berths and self.berthing is not None:
            return not self.berthing.lies
        return mission.target is not None or mission.station is not None

    @property
    def knows_surroundings(self) -> bool:
        """Whether what is around has been seen for long enough, since the start or a `reset`."""
        return self._settling.is_settled

    @property
    def is_settling(self) -> bool:
        """Whether the thrust is zero because what is around was forgotten a moment ago.

        Not at the very start: then whoever says that the vessel is engaged sees to it.
        """
        return self._settling.has_forgotten and not self._settling.is_settled

    def reset(self) -> None:
        """Forget the surroundings: the inputs' time, or the vessel's position, has jumped."""
        self._settling.restart()
        self.guidance.reset()
        if self.learnt is not None:
            self.learnt.reset()
        self._stop()
        self.tracker.reset()
        self.senses.forgotten()
        self.policy.reset()

    def warm_up(self) -> None:
        """Ask the policy once for nothing: its first answer takes longest."""
        self.policy.act(nothing_seen(self.policy.shown))
        self.policy.reset()

    def _perceive(self, cloud: PointCloud, odometry: Odometry) -> tuple[Objects, Fault | None]:
        """Find the objects in a scan; none if it cannot be processed."""
        try:
            objects = self.perception.step(
                cloud, odometry.q_NB, rates_B=odometry.rates_B, velocity_B=odometry.velocity_B
            )
        except TwinscrewError as error:
            return no_objects(cloud.stamp_ns), PERCEPTION_ERROR.at(cloud.stamp_ns, str(error))
        return objects, None

    def _track(self, objects: Objects, odometry: Odometry) -> tuple[Tracks, HealthEvent | None]:
        """Follow the objects; report if all tracks were forgotten after a gap."""
        tracks = self.tracker.step(objects, odometry)
        if not self.tracker.note:
            return tracks, None
        self._settling.restart()
        self.senses.forgotten()
        return tracks, TRACKS_FORGOTTEN.at(objects.stamp_ns, self.tracker.note)

    def _learn(self, stamp_ns: int, odometry: Odometry) -> None:
        """Add what this scan shows of walls and free water to what is learnt."""
        if self.learnt is None or not isinstance(self.tracker, Tracker):
            return
        view = self.tracker.outline
        if view is not None and view.stamp_ns == stamp_ns:
            stands = self.tracker.stands
            self.learnt.step(odometry, view.outline, lambda: view.water, stands)

    def _guide(self, odometry: Odometry, *, idle: bool) -> tuple[Goal | None, HealthEvent | None]:
        """Give the place to steer for: the goal, or a place on the route there; None to lie still.

        Without a way to the goal the vessel holds the place where that was found out.
        """
        goal = self.mission.target
        if goal is None or idle or self.trial is not None:
            self._held = None
            if (goal is None or self.trial is not None) and self.guidance.route is not None:
                self.guidance.reset()
            return goal, None
        learns = self.learnt is not None and self.guidance.settings.learnt
        walls = self.learnt.walls if self.learnt is not None and learns else NO_WALLS
        place_N, stamp_ns = odometry.position_N[:2], odometry.stamp_ns
        drift_N = self.assurance.drift_N if isinstance(self.assurance, Assurance) else None
        aim = self.guidance.step(stamp_ns, place_N, goal.position_N, self.chart, walls, drift_N)
        told = ROUTE_FOUND.at(stamp_ns, aim.news) if aim.news else None
        if aim.trouble:
            told = ROUTE_MISSING.at(stamp_ns, aim.trouble)
        if aim.place_N is None:
            held = self._held or Station(stamp_ns=stamp_ns, position_N=place_N.copy())
            self._held = held
            return None, told
        self._held = None
        if aim.place_N is goal.position_N:
            return goal, told
        return replace(goal, position_N=aim.place_N), told

    def _drive(self, odometry: Odometry, goal: Goal, tracks: Tracks) -> Driven:
        """Ask the policy if a decision is due, and let the assurance check every thrust."""
        before, observation = self._thrust, None
        if self.keeper is not None:
            self.keeper.reset()
        if self._schedule.is_due(odometry.stamp_ns):
            observation = self._observe(odometry, goal, tracks, before)
            try:
                self._rate = self.policy.act(observation)
            except PolicyError as error:
                self._stop()
                return Driven(observation, POLICY_ERROR.at(odometry.stamp_ns, str(error)))
            self._thrust = self.guard.limits.clip(before + self._rate * self.policy.period_s)
        self._slow_down(odometry)
        if self.assurance is None:
            return Driven(observation)
        self._thrust, overridden = self.assurance.step(
            odometry, tracks, before, self._thrust, decided=observation is not None
        )
        return Driven(observation, None, overridden)

    def _keep(self, keeper: Keeper, odometry: Odometry, station: Station, tracks: Tracks) -> Driven:
        """Hold a place; the assurance checks every thrust, as it does a policy's."""
        before = self._thrust
        self._rate = NEUTRAL
        self._schedule.restart()
        self._thrust, events = keeper.step(odometry, before, station)
        self._slow_down(odometry)
        if self.assurance is None:
            return Driven(overridden=events)
        self._thrust, overridden = self.assurance.step(
            odometry, tracks, before, self._thrust, decided=True
        )
        return Driven(overridden=(*events, *overridden))

    def _find_berth(self, odometry: Odometry) -> None:
        """Follow the mission's berth: where its way in begins is known once the boat's place is."""
        berth = self.mission.berth
        if berth is None or self.keeper is None:
            self.berthing = None
        elif self.berthing is None or self.berthing.berth is not berth:
            self.berthing = Berthing(self.keeper, berth, odometry.position_N[:2])
            self.mission.line_up_N = self.berthing.line_up_N
        self.mission.berthed = self.berthing is not None and self.berthing.lies

    def _watch_berthing(self, stamp_ns: int, *, acts: bool) -> tuple[HealthEvent, ...]:
        """Break off a way in that is not gone on with; let the face be touched on one alone.

        Whoever drives meanwhile, a pilot or the policy, leaves the boat anywhere: the way in then
        begins anew.
        """
        comes_in = self.berthing is not None and self.mission.berths and self.trial is None and acts
        events: tuple[HealthEvent, ...] = ()
        if self.berthing is not None and not comes_in:
            why = "it is not near its berth, or holds another place" if acts else "no thrust acts"
            events = self.berthing.interrupt(stamp_ns, why)
        if isinstance(self.assurance, Assurance):
            touches = comes_in and self.berthing is not None and self.berthing.is_coming_in
            berth = self.mission.berth if touches else None
            self.assurance.berth_N = None if berth is None else berth.face_N
        return events

    def _come_in(self, berthing: Berthing, odometry: Odometry, tracks: Tracks) -> Driven:
        """Come alongside; the assurance checks every thrust, against all but the berth's face."""
        before = self._thrust
        self._rate = NEUTRAL
        self._schedule.restart()
        others = berthing.others(tracks)
        self._thrust, events = berthing.step(odometry, before, others)
        if berthing.lies:
            self.mission.berthed = True
            return self._stop()._replace(overridden=events)
        self._slow_down(odometry)
        if self.assurance is None:
            return Driven(overridden=events)
        self._thrust, overridden = self.assurance.step(
            odometry, others, before, self._thrust, decided=True
        )
        if any(event.name == ASSURANCE_INTERVENED.name for event in overridden):
            events += berthing.interrupt(odometry.stamp_ns, "the assurance took over")
        return Driven(overridden=(*events, *overridden))

    def _slow_down(self, odometry: Odometry) -> None:
        """Drive no faster ahead than the speed limit, if there is one."""
        if self.speed_limit is not None:
            limited = slowed(
                self._thrust,
                float(odometry.velocity_B[0]),
                self.speed_limit.most_mps,
                self.speed_limit.gain_nspm,
            )
            self._thrust = self.guard.limits.clip(limited)

    def _observe(
        self, odometry: Odometry, goal: Goal, tracks: Tracks, before: Float64
    ) -> Observation:
        """Say what the policy is shown; learnt walls are edges to one that takes a contour.

        It is not shown the pieces of long objects that stand besides, where they are such walls.
        """
        shown, walls = self.policy.shown, None
        if shown.contour_m is not None and self.learnt is not None:
            walls = self.learnt.edges_near(odometry.position_N, shown.contour_m)
            if len(walls) and isinstance(self.tracker, Tracker):
                pieces = np.isin(tracks.id, self.tracker.pieces)
                for k in np.flatnonzero(pieces).tolist():
                    on_wall = self.learnt.edges_near(tracks.p_N[k], float(tracks.radius[k]))
                    pieces[k] = len(on_wall) > 0
                tracks = tracks.only(~pieces) if pieces.any() else tracks
        return observe(odometry, goal, tracks, before, self._observation, shown, self.chart, walls)

    def _try(self, trial: Trial, odometry: Odometry, tracks: Tracks, *, idle: bool) -> Driven:
        """Sail a trial's manoeuvre; the assurance checks every thrust, as it does a policy's.

        A speed limit of the operational envelope does not count: how much wind and current are for
        this boat is judged by the vessel's file, which the trial is to find out. The trial has a
        limit of its own.
        """
        stamp_ns, before = odometry.stamp_ns, self._thrust
        ended: list[HealthEvent] = []
        if idle:
            ended = trial.interrupt(stamp_ns, "the thrust does not act, or nothing is seen")
        elif self.mission.orders != self._orders_before_trial:
            ended = trial.interrupt(stamp_ns, "an order came")
        if idle or not self.has_task:
            return self._stop()._replace(overridden=tuple(ended))
        self._thrust, events = trial.step(odometry, tracks)
        if self.assurance is None:
            return Driven(overridden=tuple(events))
        self._thrust, overridden = self.assurance.step(
            odometry, tracks, before, self._thrust, decided=True
        )
        if any(event.name == ASSURANCE_INTERVENED.name for event in overridden):
            ended = trial.interrupt(stamp_ns, "the assurance took over")
        return Driven(overridden=(*events, *overridden, *ended))

    def _stop(self) -> Driven:
        self._rate = self._thrust = NEUTRAL
        self._schedule.restart()
        if self.keeper is not None:
            self.keeper.reset()
        if self.assurance is not None:
            self.assurance.reset()
        return Driven()


def make_pipeline(
    config: RuntimeConfig,
    *,
    perception: PerceptionStage | None = None,
    tracker: TrackingStage | None = None,
    policy: Policy | None = None,
    assurance: AssuranceStage | None = None,
) -> Pipeline:
    """Make a pipeline from its configuration, but for the stages that are given.

    Raises
    ------
    ConfigError, PolicyError
        Something configured does not exist or cannot be used: before anything moves.
    """
    sensor = sensor_of(config)
    return Pipeline(
        perception=perception or Perception(sensor, config.perception),
        tracker=tracker
        or Tracker(tracking_of(config), SensorView.of(sensor, config.perception.max_range_m)),
        policy=policy or _policy_of(config),
        mission=Mission(config.mission),
        guard=Guard(config.thrust),
        observation=config.observation,
        assurance=assurance or Assurance(config.assurance, config.thrust),
        senses=make_senses(senses_of(config)),
        alarms=Alarms(config.alarms),
        guidance=Guidance(config.route, config.observation.goal_range_m),
        learnt=LearntMap(config.learnt) if config.learnt.enabled else None,
        keeper=Keeper(config.station, load_vessel(config.vessel), config.thrust),
    )


def _policy_of(config: RuntimeConfig) -> Policy:
    """Give what drives: the configured trial, if there is one, else the policy."""
    vessel = load_vessel(config.vessel)
    if config.trial.name:
        return Trial(config.trial, vessel, config.thrust)
    return load_policy(config.policy, expected_of_policies(config), config.risk, vessel)


class Senses:
    """The sensors beside the LiDAR: what they say waits for the scan that it is older than.

    A scan is the time at which decisions are made, so looks are taken in at its step: those up to
    its stamp, in the order in which they came. Newer ones wait for the next scan.
    """

    def __init__(
        self, senses: Mapping[str, Sequence[Sense]], tracker: TrackingStage, alarms: Alarms
    ) -> None:
        self.by_topic = senses
        """What listens to each topic."""
        self._tracker = tracker
        self._alarms = alarms
        self._waiting: list[Look] = []
        self._rarely = Rarely(10.0)
        self._forgotten = False
        self._listened_ns: int | None = None

    def take(
        self, topic: str, payload: bytes, latest_ns: int, own_at: OwnAt
    ) -> tuple[HealthEvent, ...]:
        """Take in a message of a topic at the vessel's time [ns]; give what there is to report.

        Raises
        ------
        MessageError
            The message is not what it should be.
        """
        events: list[HealthEvent] = []
        for sense in self.by_topic[topic]:
            heard = sense.take(payload, latest_ns, own_at)
            events += heard.events
            for look in heard.looks:
                since_s = (latest_ns - look.stamp_ns) / NANOSECONDS_PER_SECOND
                if -NEWER_S <= since_s <= OLDER_S:
                    self._waiting.append(look)
                elif self._rarely.allows(look.source, latest_ns):
                    words = f"{look.source}: {since_s:.1f} s older than the vessel's time"
                    events.append(INPUT_LATE.at(latest_ns, words))
        del self._waiting[:-MOST_LOOKS]
        return tuple(events)

    def listen(self, stamp_ns: int) -> tuple[HealthEvent, ...]:
        """Give the tracker what came up to a scan's stamp [ns]."""
        self._listened_ns = stamp_ns
        events: list[HealthEvent] = []
        for sense in dict.fromkeys(sense for each in self.by_topic.values() for sense in each):
            heard = sense.step(stamp_ns, forgotten=self._forgotten)
            events += heard.events
            self._waiting += heard.looks
        self._forgotten = False
        due = [look for look in self._waiting if look.stamp_ns <= stamp_ns]
        newest_ns = stamp_ns + round(NEWER_S * NANOSECONDS_PER_SECOND)
        self._waiting = [w for w in self._waiting if stamp_ns < w.stamp_ns <= newest_ns]
        for look in due:
            self._tracker.take(look)
        return tuple(events)

    def without_scan(self, odometry: Odometry) -> tuple[HealthEvent, ...] | None:
        """Listen, and give alarms, though no scan comes; None if one came a moment ago.

        The boat is stopped without its LiDAR, but a ship that reports itself is still announced.
        """
        stamp_ns = odometry.stamp_ns
        if self._listened_ns is None:
            self._listened_ns = stamp_ns  # the first scan may be on its way
        since_s = (stamp_ns - self._listened_ns) / NANOSECONDS_PER_SECOND
        if abs(since_s) < SCANLESS_S:  # a scan may be a little newer than the odometry
            return None
        heard = self.listen(stamp_ns)
        tracks = self._tracker.seen_by_others(stamp_ns, odometry.position_N[:2])
        return (*heard, *self.alarmed(odometry, tracks))

    def alarmed(self, odometry: Odometry, tracks: Tracks) -> tuple[HealthEvent, ...]:
        """Give what the tracks that came of it make worth reporting."""
        words = "reports itself where the LiDAR sees nothing"
        doubts = [
            AIS_SPOOFED.at(tracks.stamp_ns, f"{name}: {words}")
            for name in self._tracker.doubted
            if self._rarely.allows(name, tracks.stamp_ns)
        ]
        return (*doubts, *self._alarms.step(odometry, tracks))

    def targets(self, stamp_ns: int) -> Tracks | None:
        """Give every vessel that reports itself, for people; None if there is none."""
        for each in self.by_topic.values():
            for sense in each:
                found = sense.targets(stamp_ns)
                if found is not None:
                    return found
        return None

    def forgotten(self) -> None:
        """Note that the tracker has forgotten all: what is known is told it again."""
        self._forgotten = True


def expected_of_policies(config: RuntimeConfig) -> PolicyExpectation:
    """Give what a policy must have been trained with, to be the vessel's."""
    return PolicyExpectation(
        thrust_min_n=config.thrust.min_n,
        thrust_max_n=config.thrust.max_n,
        perception_range_m=config.perception.max_range_m,
        vessel=load_vessel(config.vessel).name,
    )


def no_objects(stamp_ns: int) -> Objects:
    """Make the answer of a scan in which nothing could be seen."""
    return Objects(
        stamp_ns=stamp_ns,
        p_L=np.empty((0, 2)),
        radius=np.empty(0),
        points=np.empty(0, dtype=np.int64),
    )


class DecisionSchedule:
    """Tells whether a decision is due at a stamp: once a period, without drift.

    Stamps of real sensors jitter, so a decision is taken on the scan nearest to its time on the
    grid: a scan may come early by a tenth of the period. After a gap the grid starts anew.
    """

    EARLY = 0.1

    def __init__(self, period_s: float) -> None:
        self._period_ns = round(period_s * NANOSECONDS_PER_SECOND)
        self._early_ns = round(self._period_ns * self.EARLY)
        self._due_ns: int | None = None

    def restart(self) -> None:
        """Make the next stamp the start of a new grid."""
        self._due_ns = None

    def is_due(self, stamp_ns: int) -> bool:
        """Tell whether a decision is due now, and if so, count it as taken."""
        if self._due_ns is None or stamp_ns - self._due_ns > self._period_ns:
            self._due_ns = stamp_ns
        if stamp_ns < self._due_ns - self._early_ns:
            return False
        self._due_ns += self._period_ns
        return True


class Settling:
    """Counts scans, and the time between their stamps, since the surroundings were forgotten.

    What is around a boat is known only after it has been seen for a while: a track is confirmed by
    3 of its first 5 scans, and its velocity needs some more. Until then a boat would be blind.

    Parameters
    ----------
    scans
        [-] So many are needed besides the time: what the tracker confirms a track by.
    kept_s
        [s] What has not been seen for longer is forgotten: how long the tracker keeps it.
    """

    def __init__(self, scans: int, kept_s: float) -> None:
        self._needed = scans
        self._kept_ns = kept_s * NANOSECONDS_PER_SECOND
        self._since_ns: int | None = None
        self._last_ns = 0
        self._seen = 0
        self.has_forgotten = False
        """Whether there was a restart, so that this is not the first time of all."""

    def restart(self) -> None:
        """Note that the surroundings are forgotten."""
        self.has_forgotten = True
        self._since_ns = None
        self._seen = 0

    def step(self, stamp_ns: int, *, seen: bool) -> None:
        """Note a scan; after too many in a row that could not be processed all is forgotten."""
        if seen:
            if self._since_ns is None:
                self._since_ns = stamp_ns
            self._last_ns = stamp_ns
            self._seen += 1
        elif self._since_ns is not None and stamp_ns - self._last_ns > self._kept_ns:
            self.restart()

    @property
    def is_settled(self) -> bool:
        """Whether the surroundings have been seen for long enough."""
        if self._since_ns is None or self._seen < self._needed:
            return False
        return self._last_ns - self._since_ns >= SETTLE_S * NANOSECONDS_PER_SECOND
