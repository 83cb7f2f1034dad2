"""When the policy is asked: once a decision period, on the grid of the scans' stamps."""

from __future__ import annotations

from typing import Final

import numpy as np

from twinscrew.runtime.errors import PolicyError, TwinscrewError
from twinscrew.runtime.messages.types import (
    NANOSECONDS_PER_SECOND,
    OBSERVED_OBJECTS,
    Decision,
    Float64,
    Goal,
    HealthEvent,
    Objects,
    Observation,
    Odometry,
    PointCloud,
    Tracks,
)
from twinscrew.runtime.perception.segmentation import Perception
from twinscrew.runtime.policy.load import Policy
from twinscrew.runtime.policy.observation import ObservationSettings, observe
from twinscrew.runtime.safety.assurance import Assurance
from twinscrew.runtime.safety.events import (
    GOAL_MISSING,
    PERCEPTION_ERROR,
    POLICY_ERROR,
    TRACKS_FORGOTTEN,
)
from twinscrew.runtime.safety.guard import NEUTRAL, Guard
from twinscrew.runtime.tracking.tracker import Tracker
from twinscrew.runtime.vessel.mission import Mission


class DecisionSchedule:
    """Tells whether a decision is due at a stamp, without drift.

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


# -- How long the surroundings have been seen since they were last forgotten.
#
# What is around a boat is known only after it has been seen for a while: a track is confirmed by 3 of
# its first 5 scans, and its velocity needs some more. Until then a boat would sail blind.

SETTLE_S: Final = 1.0
"""[s] Scans must have come for this long: twice what five scans of a 10 Hz LiDAR take, within which
every track that is seen is confirmed."""


class Settling:
    """Counts scans, and the time between their stamps, since the last restart.

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

    def see(self, stamp_ns: int) -> None:
        """Note a scan that could be used."""
        if self._since_ns is None:
            self._since_ns = stamp_ns
        self._last_ns = stamp_ns
        self._seen += 1

    def miss(self, stamp_ns: int) -> None:
        """Note a scan that could not be used; after too many in a row all is forgotten."""
        if self._since_ns is not None and stamp_ns - self._last_ns > self._kept_ns:
            self.restart()

    @property
    def is_settled(self) -> bool:
        """Whether the surroundings have been seen for long enough."""
        if self._since_ns is None or self._seen < self._needed:
            return False
        return self._last_ns - self._since_ns >= SETTLE_S * NANOSECONDS_PER_SECOND


# -- The pure core: one scan and the odometry at its time in, one decision out.
#
# No clock, no randomness, no I/O: the same scans give the same decisions, in a boat, in a simulator
# and in a replay.


class Pipeline:
    """Perception, tracking, observation, policy, assurance, thrust: a line each."""

    def __init__(
        self,
        *,
        perception: Perception,
        tracker: Tracker,
        policy: Policy,
        mission: Mission,
        guard: Guard,
        observation: ObservationSettings | None = None,
        assurance: Assurance | None = None,
    ) -> None:
        self.perception = perception
        self.tracker = tracker
        self.policy = policy
        self.mission = mission
        self.guard = guard
        self.assurance = assurance
        self._observation = observation or ObservationSettings()
        self._schedule = DecisionSchedule(policy.period_s)
        life = tracker.settings.life
        self._settling = Settling(life.birth_scans, life.coast_s)
        self._sequence = 0
        self._goal_was_missing = False
        self._rate: Float64 = NEUTRAL
        self._thrust: Float64 = NEUTRAL

    def step(self, cloud: PointCloud, odometry: Odometry, *, engaged: bool) -> Decision:
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
        """
        events: list[HealthEvent] = []
        objects = self._perceive(cloud, odometry, events)
        blind = bool(events)
        tracks = self.tracker.step(objects, odometry)
        if self.tracker.note:
            events.append(TRACKS_FORGOTTEN.at(cloud.stamp_ns, self.tracker.note))
            self._settling.restart()
        if blind:
            self._settling.miss(cloud.stamp_ns)
        else:
            self._settling.see(cloud.stamp_ns)
        engaged = engaged and not blind and not self.is_settling
        free = self._may_sail(odometry, engaged, events)
        seen = self._sail(odometry, tracks, events) if free else None
        self._thrust, tripped = self.guard.check(self._thrust, cloud.stamp_ns)
        if tripped:
            events.append(tripped)
        return self._decision(cloud.stamp_ns, seen, objects, tracks, events)

    def set_goal(self, goal: Goal) -> HealthEvent:
        """Replace all goals by one."""
        return self.mission.set_goal(goal)

    def set_route(self, places_N: Float64, stamp_ns: int) -> HealthEvent:
        """Replace all goals by these, (K, 2) [m] [N], to be sailed to in a row; by none to stop."""
        return self.mission.set_route(places_N, stamp_ns)

    def warm_up(self) -> None:
        """Ask the policy once for nothing: its first answer takes longest."""
        blank = Observation(
            ego=np.zeros(7, dtype=np.float32),
            objects=np.zeros((OBSERVED_OBJECTS, 5), dtype=np.float32),
            mask=np.zeros(OBSERVED_OBJECTS, dtype=np.float32),
        )
        self.policy.act(blank)
        self.policy.reset()

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
        self._stop()
        self.tracker.reset()
        self.policy.reset()

    def _perceive(
        self, cloud: PointCloud, odometry: Odometry, events: list[HealthEvent]
    ) -> Objects:
        try:
            return self.perception.step(
                cloud, odometry.q_NB, rates_B=odometry.rates_B, velocity_B=odometry.velocity_B
            )
        except TwinscrewError as error:
            self._stop()
            events.append(PERCEPTION_ERROR.at(cloud.stamp_ns, str(error)))
            return no_objects(cloud.stamp_ns)

    def _may_sail(self, odometry: Odometry, engaged: bool, events: list[HealthEvent]) -> bool:
        reached = self.mission.step(odometry)
        if reached:
            events.append(reached)
        missing = self.mission.goal is None
        if missing and not self._goal_was_missing:
            events.append(GOAL_MISSING.at(odometry.stamp_ns))
        self._goal_was_missing = missing
        if missing or not engaged or self.mission.arrived:
            self._stop()
            return False
        return True

    def _sail(
        self, odometry: Odometry, tracks: Tracks, events: list[HealthEvent]
    ) -> Observation | None:
        """Ask the policy if it is time to, and let the assurance check the thrust every time."""
        before = self._thrust
        due = self._schedule.is_due(odometry.stamp_ns)
        seen = self._act(odometry, tracks, events) if due else None
        failed = any(event.name == POLICY_ERROR.name for event in events)
        if self.assurance is not None and not failed:
            self._thrust, said = self.assurance.step(
                odometry, tracks, before, self._thrust, decided=due
            )
            events += said
        return seen

    def _act(
        self, odometry: Odometry, tracks: Tracks, events: list[HealthEvent]
    ) -> Observation | None:
        goal = self.mission.goal
        assert goal is not None  # noqa: S101  (_may_sail saw it)
        observation = observe(odometry, goal, tracks, self._thrust, self._observation)
        try:
            self._rate = self.policy.act(observation)
        except PolicyError as error:
            self._stop()
            events.append(POLICY_ERROR.at(odometry.stamp_ns, str(error)))
            return observation
        step = self._rate * self.policy.period_s
        self._thrust = self.guard.limits.clip(self._thrust + step)
        return observation

    def _stop(self) -> None:
        self._rate = NEUTRAL
        self._thrust = NEUTRAL
        self._schedule.restart()
        if self.assurance is not None:
            self.assurance.reset()

    def _decision(
        self,
        stamp_ns: int,
        seen: Observation | None,
        objects: Objects,
        tracks: Tracks,
        events: list[HealthEvent],
    ) -> Decision:
        decision = Decision(
            stamp_ns=stamp_ns,
            sequence=self._sequence,
            acted=seen is not None,
            thrust_rate=self._rate,
            thrust=self._thrust,
            observation=seen,
            objects=objects,
            tracks=tracks,
            events=tuple(events),
            arrived=self.mission.arrived,
        )
        self._sequence += 1
        return decision


def no_objects(stamp_ns: int) -> Objects:
    """Make the answer of a scan in which nothing could be seen."""
    return Objects(
        stamp_ns=stamp_ns,
        p_L=np.empty((0, 2)),
        radius=np.empty(0),
        points=np.empty(0, dtype=np.int64),
    )
