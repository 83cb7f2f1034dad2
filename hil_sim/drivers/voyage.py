"""One voyage, from the dock to the last vessel's outcome: the loop that both drivers share.

Vessels lie moored until every autopilot is armed and in MANUAL; then they are released, and get
their goals, all at once. What differs between lock-step and real time is the crew (who carries
messages to the vessels' runtimes, and thrust back) and the pace.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Protocol

import numpy as np
from msgspec import structs

from twinscrew.hil_sim.scene import rotations
from twinscrew.hil_sim.sensors.marine import MarineSensors
from twinscrew.hil_sim.sensors.navigation import Navigation
from twinscrew.hil_sim.supervisor import Outcome, Result, Supervisor, SupervisorSettings
from twinscrew.hil_sim.trajectory import TrajectoryLog
from twinscrew.hil_sim.world import World
from twinscrew.runtime.errors import LinkError
from twinscrew.runtime.messages import cdr
from twinscrew.runtime.messages.types import Float64, Goal, Odometry
from twinscrew.runtime.safety.events import TRIAL_DONE

ODOMETRY_S = 0.05
"""[s] 20 Hz (parameters.md, Sensors)."""
DOCK_LIMIT_S = 20.0
"""[s] How long to wait for the autopilots."""


class Crew(Protocol):
    """Carries messages to the vessels' runtimes, and what they want of the propellers back."""

    exchange_s: float
    """[s] How often bytes go to and from the autopilots."""

    def deliver(self, vessel: int, topic: str, payload: bytes, now_s: float) -> None:
        """Hand a message to a vessel's runtime."""

    def exchange(self, vessel: int, now_s: float, odometry: Odometry) -> None:
        """Let a vessel's autopilot and runtime talk."""

    def is_ready(self, vessel: int) -> bool:
        """Tell whether a vessel's autopilot is armed and takes commands."""

    def trial_outcome(self, vessel: int) -> str:
        """Give the event that ended a vessel's trial; empty while it goes on, or there is none."""

    def why_not_ready(self, vessel: int) -> str:
        """Say what keeps a vessel from sailing, as far as it is known; empty if it is not."""

    def thrust_N(self) -> Float64:
        """Give what the autopilots ask of the propellers, (V, 2) [N]."""

    def retire(self, vessel: int) -> None:
        """Note that a vessel's voyage has ended."""

    def keep_pace(self, now_s: float) -> None:
        """Wait until it is time for simulated time `now_s`."""

    def check(self) -> None:
        """Raise if a runtime has died."""


@dataclass(frozen=True, slots=True, kw_only=True)
class VoyageResult:
    """What became of the vessels."""

    results: tuple[Result, ...]
    log: TrajectoryLog
    duration_s: float
    """[s] Simulated, dock and voyage."""
    ended_s: float = field(default_factory=time.monotonic)
    """[s] When it was over, by the monotonic clock: what is stopped afterwards takes time, too."""

    @property
    def success(self) -> bool:
        """True if every vessel reached its goal, or sailed its trial to the end."""
        return all(r.outcome in (Outcome.GOAL, Outcome.DONE) for r in self.results)


class Voyage:
    """Runs a world and its crew to the end."""

    def __init__(
        self,
        world: World,
        crew: Crew,
        *,
        scan_s: float,
        dock_limit_s: float = DOCK_LIMIT_S,
        supervisor: SupervisorSettings | None = None,
        progress: Callable[[float, tuple[Result, ...]], None] | None = None,
        navigation: Navigation | None = None,
        marine: MarineSensors | None = None,
    ) -> None:
        """Prepare a voyage.

        Parameters
        ----------
        scan_s
            [s] Between two scans of the LiDAR.
        dock_limit_s
            [s] How long to wait for the autopilots.
        progress
            Called with the simulated time and the present results, every odometry tick.
        navigation
            The vessels' GPS and IMU, if their runtimes want them.
        marine
            Their AIS receivers and radars, if they have any.
        """
        self._world = world
        self._crew = crew
        self._scan_s = scan_s
        self._dock_limit_s = dock_limit_s
        self._supervisor_settings = supervisor
        self._progress = progress
        self._navigation = navigation
        self._marine = marine
        self._vessels = range(world.scenario.vessels)
        self._phases = round(ODOMETRY_S / crew.exchange_s)
        self._measured: dict[int, Odometry] = {}
        self._log = TrajectoryLog()
        self._supervisor: Supervisor | None = None

    def run(self) -> VoyageResult:
        """Sail.

        Raises
        ------
        LinkError
            A vessel was not ready to sail in time, or its runtime died.
        """
        self._wait_at_the_dock()
        supervisor = self._cast_off()
        while not supervisor.over:
            self._tick()
        return VoyageResult(
            results=supervisor.results(), log=self._log, duration_s=self._world.time_s
        )

    def trial(self) -> VoyageResult:
        """Let the vessels sail their trials, each until its own is over; errors as `run`.

        They get no goals: an order would end a trial.
        """
        self._wait_at_the_dock()
        for i in self._vessels:
            self._world.release(i)
        settings = structs.replace(
            self._supervisor_settings or SupervisorSettings(), goals_count=False
        )
        self._supervisor = supervisor = Supervisor(self._world, settings)
        while not supervisor.over:
            self._tick()
            for i in self._vessels:
                outcome = self._crew.trial_outcome(i)
                if outcome and not self._ended(i):
                    done = outcome == TRIAL_DONE.name
                    supervisor.finish(i, Outcome.DONE if done else Outcome.ENDED)
                    self._crew.retire(i)
        return VoyageResult(
            results=supervisor.results(), log=self._log, duration_s=self._world.time_s
        )

    def linger(self, duration_s: float) -> None:
        """Lie at the dock, sensors on and with goals: what benchmarks measure the runtimes in."""
        self._wait_at_the_dock()
        self._give_goals()
        until_s = self._world.time_s + duration_s
        while self._world.time_s < until_s:
            self._tick()

    def patrol(self, duration_s: float, goal_of: Callable[[int], Float64 | None]) -> None:
        """Sail for a time [s], whatever happens; `goal_of` gives a vessel's next goal, if any."""
        self._wait_at_the_dock()
        for i in self._vessels:
            self._world.release(i)
        self._give_goals()
        until_s = self._world.time_s + duration_s
        while self._world.time_s < until_s:
            self._tick()
            for i in self._vessels:
                goal_N = goal_of(i)
                if goal_N is not None:
                    self._give_goal(i, goal_N)

    def _wait_at_the_dock(self) -> None:
        for i in self._vessels:
            self._world.moor(i, self._world.scenario.starts[i, :2])
        while not all(self._crew.is_ready(i) for i in self._vessels):
            if self._world.time_s > self._dock_limit_s:
                late = "; ".join(
                    f"{name} ({why})" if (why := self._crew.why_not_ready(i)) else name
                    for i, name in enumerate(self._world.scenario.names)
                    if not self._crew.is_ready(i)
                )
                raise LinkError(f"not ready to sail after {self._dock_limit_s:g} s: {late}")
            self._tick()

    def _cast_off(self) -> Supervisor:
        for i in self._vessels:
            self._world.release(i)
        self._give_goals()
        self._supervisor = Supervisor(self._world, self._supervisor_settings)
        return self._supervisor

    def _give_goals(self) -> None:
        for i in self._vessels:
            self._give_goal(i, self._world.scenario.goals[i])

    def _give_goal(self, vessel: int, goal_N: Float64) -> None:
        goal = Goal(stamp_ns=self._world.stamp_ns, position_N=goal_N)
        self._deliver(vessel, "goal", cdr.encode_goal(goal))

    def _tick(self) -> None:
        """Let one odometry period pass; each vessel's sensors have their own moment in it."""
        self._crew.check()
        self._note()
        for phase in range(self._phases):
            self._measure(phase)
            for i, measured in self._measured.items():
                self._crew.exchange(i, self._world.time_s, measured)
            self._advance(self._crew.exchange_s)
            self._navigate()
            self._crew.keep_pace(self._world.time_s)
        if self._supervisor is not None and self._progress is not None:
            self._progress(self._supervisor.elapsed_s, self._supervisor.results())

    def _measure(self, phase: int) -> None:
        """Let the sensors measure whose moment it is: no two boats' clocks agree.

        In lock-step there is one moment for all.
        """
        world = self._world
        since = world.steps - phase * world.steps_in(self._crew.exchange_s)
        scans = since % world.steps_in(self._scan_s) == 0
        for i in self._vessels[phase :: self._phases]:
            if self._ended(i):
                self._measured.pop(i, None)
                continue
            self._measured[i] = world.odometry(i)
            name = world.scenario.names[i]
            odometry = cdr.encode_odometry(self._measured[i], child_frame_id=f"{name}/base_link")
            self._deliver(i, "odometry", odometry)
            if scans:
                cloud = replace(world.cloud(i), frame_id=f"{name}/lidar_wamv_link")
                self._deliver(i, "points", cdr.encode_point_cloud(cloud))

    def _navigate(self) -> None:
        """Hand on what GPS and IMU, AIS receiver and radar have measured meanwhile."""
        for sensors in (self._navigation, self._marine):
            for sensed in () if sensors is None else sensors.take():
                if not self._ended(sensed.vessel):
                    self._deliver(*sensed)

    def _deliver(self, vessel: int, topic: str, payload: bytes) -> None:
        self._crew.deliver(vessel, topic, payload, self._world.time_s)

    def _advance(self, duration_s: float) -> None:
        if self._supervisor is None:
            self._world.advance(duration_s, self._crew.thrust_N())
            return
        before = [self._ended(i) for i in self._vessels]
        self._supervisor.advance(duration_s, self._crew.thrust_N())
        for i in self._vessels:
            if self._ended(i) and not before[i]:
                self._crew.retire(i)

    def _ended(self, vessel: int) -> bool:
        return self._supervisor is not None and self._supervisor.outcomes[vessel] is not None

    def _note(self) -> None:
        if self._supervisor is None or not self._log.due(self._supervisor.elapsed_s):
            return
        state = self._world.state
        velocity_N = (rotations(state.q_NB) @ state.velocity_B[..., None])[:, :2, 0]
        pose = np.column_stack([state.position_N[:, :2], state.heading])
        ships = self._world.traffic
        traffic = None if ships is None else ships.pose_N
        self._log.add(self._supervisor.elapsed_s, pose, velocity_N, state.thrust, traffic)
