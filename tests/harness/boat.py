"""A whole boat without sockets: sensors that can fail, the runtime's vessel, its autopilot.

The sensors are synthetic (a boat at rest, nothing in sight); everything between their bytes and the
propellers' pulses is the real thing, in simulated time.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable

import numpy as np
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from twinscrew.hil_sim.autopilot.endpoint import RoverAutopilot, RoverAutopilotSettings
from twinscrew.hil_sim.autopilot.rover import RoverSettings
from twinscrew.runtime.bus.base import Received
from twinscrew.runtime.geometry import quaternion_from_euler
from twinscrew.runtime.ground.report import GroundReport
from twinscrew.runtime.ground.stations import Stations
from twinscrew.runtime.link.ardupilot.link import AutopilotLink, AutopilotSettings
from twinscrew.runtime.link.ardupilot.thrust import STOP
from twinscrew.runtime.mavlink import Message, Wire
from twinscrew.runtime.messages import cdr
from twinscrew.runtime.messages.types import (
    Decision,
    Float64,
    HealthEvent,
    Observation,
    Odometry,
    PointCloud,
)
from twinscrew.runtime.perception.segmentation import Perception
from twinscrew.runtime.perception.sensor import load_sensor
from twinscrew.runtime.policy.load import Policy
from twinscrew.runtime.policy.observation import PAPER
from twinscrew.runtime.safety.assurance import Assurance
from twinscrew.runtime.safety.guard import Guard, ThrustLimits
from twinscrew.runtime.tracking.tracker import Tracker
from twinscrew.runtime.vessel.mission import Mission, MissionSettings
from twinscrew.runtime.vessel.outputs import Outputs
from twinscrew.runtime.vessel.pipeline import Pipeline
from twinscrew.runtime.vessel.vessel import Vessel

SECOND = 1_000_000_000
EPOCH_NS = 1_800_000_000 * SECOND
TICK_S = 0.05
FAR_AHEAD = ((500.0, 0.0),)

Line = Callable[[str, bytes], Iterable[bytes]]
"""What lies between a sensor and the runtime: it may lose, change, or repeat a payload."""


class Steady:
    """A policy that always asks for the same rate, and can be told to fail."""

    name = "steady"
    shown = PAPER

    def __init__(self, rate: tuple[float, float] = (100.0, 100.0), period_s: float = 0.5) -> None:
        self.period_s = period_s
        self.rate = rate
        self.asked = 0
        self.resets = 0
        self.failure: Exception | None = None

    def act(self, observation: Observation) -> Float64:
        self.asked += 1
        if self.failure is not None:
            raise self.failure
        return np.array(self.rate)

    def reset(self) -> None:
        self.resets += 1


def stamp(time_s: float) -> int:
    return EPOCH_NS + round(time_s * SECOND)


def odometry(time_s: float, north: float = 0.0, east: float = 0.0) -> Odometry:
    return Odometry(
        stamp_ns=stamp(time_s),
        position_N=np.array([north, east, 0.0]),
        q_NB=quaternion_from_euler(0.0, 0.0, 0.0),
        velocity_B=np.zeros(3),
        rates_B=np.zeros(3),
    )


def cloud(time_s: float, points: object = ()) -> PointCloud:
    points_S = np.array(points, dtype=np.float32).reshape(-1, 3)
    return PointCloud(stamp_ns=stamp(time_s), frame_id="lidar", points_S=points_S)


def make_pipeline(
    policy: Policy, waypoints_m: tuple[tuple[float, float], ...] = FAR_AHEAD
) -> Pipeline:
    return Pipeline(
        perception=Perception(load_sensor("vrx16")),
        tracker=Tracker(),
        policy=policy,
        mission=Mission(MissionSettings(waypoints_m=waypoints_m)),
        guard=Guard(),
        assurance=Assurance(),
    )


def drives(message: Message) -> bool:
    """Tell whether a message of the runtime's asks for thrust, or for MANUAL."""
    if message.get_type() == "RC_CHANNELS_OVERRIDE":
        return (message.chan1_raw, message.chan3_raw) != STOP
    return bool(
        message.get_type() == "COMMAND_LONG" and message.command == mavlink.MAV_CMD_DO_SET_MODE
    )


class Boat:
    """A vessel and a simulated autopilot, joined by bytes, 20 times a second.

    `line` stands between the sensors and the vessel; `wire` between vessel and autopilot.
    """

    def __init__(
        self,
        policy: Policy | None = None,
        *,
        waypoints_m: tuple[tuple[float, float], ...] = FAR_AHEAD,
        rover: dict[str, object] | None = None,
        stations: Stations | None = None,
        limits: ThrustLimits | None = None,
        report: GroundReport | None = None,
        **link: object,
    ) -> None:
        self.policy = policy or Steady()
        settings = AutopilotSettings(**{"arm": True, "receiver_fitted": False, **link})
        autopilot_link = AutopilotLink(settings, stations=stations)
        pipeline = make_pipeline(self.policy, waypoints_m)
        self.vessel = Vessel(pipeline, autopilot_link, report=report, limits=limits)
        pilot = RoverAutopilotSettings(rover=RoverSettings(**(rover or {})))
        self.autopilot = RoverAutopilot(pilot, 1)
        self.now_s = 0.0
        self.clock_offset_s = 0.0
        self.place = (0.0, 0.0)
        self.line: Line = lambda topic, payload: (payload,)
        self.wire = True
        self.events: list[tuple[float, HealthEvent]] = []
        self.thrusts: list[tuple[float, Float64]] = []
        self._reader = Wire(9, 9)
        self.sent: list[Message] = []
        """What the vessel has sent."""
        self.driven: list[float] = []
        """[s] When bytes were sent that ask for anything but stop, or for MANUAL."""
        self._ticks = 0

    def freeze(self, seconds: float, sensors_live_s: float) -> None:
        """Stop the runtime, as SIGSTOP does, and let everything else go on.

        Sensors speak into its sockets for a while, and the autopilot all the time; all of that is
        read at once when it wakes.
        """
        waiting: list[tuple[str, bytes]] = []
        said = b""
        begun_s, take_in = self.now_s, self._arrived
        self._arrived = lambda topic, payload: waiting.append((topic, payload))
        while self.now_s < begun_s + seconds - 1e-9:
            self._advance()
            if self.now_s <= begun_s + sensors_live_s + 1e-9:
                self._sense()
            said += self.autopilot.step(self.now_s, odometry(self.now_s, *self.place))
        self._arrived = take_in
        for topic, payload in waiting[-4:]:  # the inbox keeps the newest
            self.take_in(topic, payload)
        self._supervise(said)

    def sail(self, seconds: float) -> Boat:
        """Let time pass."""
        for _ in range(round(seconds / TICK_S)):
            self._tick()
        return self

    def take_in(self, topic: str, payload: bytes) -> Outputs:
        """Hand a payload to the vessel, as the loop does."""
        out = self.vessel.handle(Received(topic, payload, 0), self.now_s)
        if out.decision is not None:
            self._send(out.autopilot)
        self._note(out.events)
        return out

    @property
    def names(self) -> list[str]:
        """The names of all events so far, the state's changes in words."""
        return [event.detail if event.name == "state" else event.name for _, event in self.events]

    @property
    def thrust(self) -> Float64:
        """[N] What the autopilot asks of the propellers."""
        return self.autopilot.thrust_command_N()

    @property
    def moves(self) -> bool:
        return bool(np.any(self.thrust != 0.0))

    def first(self, name: str, since_s: float = 0.0) -> float:
        """[s] When an event of this name came first."""
        return next(t for t, event in self.events if event.name == name and t >= since_s)

    def stopped_by(self, since_s: float) -> float:
        """[s] From a time until the propellers stood still."""
        stops = [t for t, thrust in self.thrusts if t >= since_s and not thrust.any()]
        return stops[0] - since_s

    def _tick(self) -> None:
        self._advance()
        self._sense()
        if self.wire:
            answer = self.autopilot.step(self.now_s, odometry(self.now_s, *self.place))
            self._supervise(answer)
        else:
            self.autopilot.step(self.now_s)
            self._supervise()

    def _advance(self) -> None:
        self._ticks += 1
        self.now_s = round(self._ticks * TICK_S, 6)

    def _supervise(self, said: bytes = b"") -> None:
        self._note(self.vessel.receive(said, self.now_s).events)
        out = self.vessel.tick(self.now_s)
        self._note(out.events)
        self._send(out.autopilot)
        self.thrusts.append((self.now_s, self.thrust))

    def _sense(self) -> None:
        time_s = self.now_s + self.clock_offset_s
        payload = cdr.encode_odometry(odometry(time_s, *self.place))
        for arrived in self.line("odometry", payload):
            self._arrived("odometry", arrived)
        if self._ticks % 2 == 0:
            for arrived in self.line("points", cdr.encode_point_cloud(cloud(time_s))):
                self._arrived("points", arrived)

    def _arrived(self, topic: str, payload: bytes) -> None:
        self.take_in(topic, payload)

    def _send(self, command: bytes) -> None:
        messages = self._reader.decode(command)
        self.sent += messages
        if any(drives(message) for message in messages):
            self.driven.append(self.now_s)
        if self.wire:
            self.autopilot.receive(command, self.now_s)

    def _note(self, events: Iterable[HealthEvent]) -> None:
        self.events += [(self.now_s, event) for event in events]


def feed(vessel: Vessel, topic: str, payload: bytes, now_s: float = 0.0) -> Outputs:
    """Hand a payload to a vessel."""
    return vessel.handle(Received(topic, payload, 0), now_s)


def decided(pipeline: Pipeline, time_s: float, *, engaged: bool = True) -> Decision:
    """Decide on an empty scan of a boat at rest."""
    decision, _ = pipeline.step(cloud(time_s), odometry(time_s), engaged=engaged)
    return decision
