"""The receivers and inertial measurement units of all vessels of a world."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from twinscrew.hil_sim.autopilot.telemetry import Origin
from twinscrew.hil_sim.sensors.imu import ImuSettings, SimulatedImu
from twinscrew.hil_sim.sensors.receiver import ReceiverSettings, SimulatedReceiver
from twinscrew.hil_sim.world import World
from twinscrew.runtime.estimation.sensors import SensorSettings
from twinscrew.runtime.estimation.wgs84 import LocalFrame, Place
from twinscrew.runtime.messages import cdr
from twinscrew.runtime.settings import Settings


class NavigationSettings(Settings, frozen=True, kw_only=True):
    """How good they are, and where they sit."""

    imu: ImuSettings = ImuSettings()
    receiver: ReceiverSettings = ReceiverSettings()
    place: SensorSettings = SensorSettings()
    origin: Origin = Origin()


class Sensed(NamedTuple):
    """A message of a sensor."""

    vessel: int
    topic: str
    payload: bytes


class Navigation:
    """Measures after every step of the world; keeps the messages until they are taken."""

    def __init__(self, world: World, settings: NavigationSettings | None = None) -> None:
        self._world = world
        self._settings = settings = settings or NavigationSettings()
        self._imu_s = 1.0 / settings.imu.rate_hz
        self._imu_steps = world.steps_in(self._imu_s)
        self._fix_steps = world.steps_in(1.0 / settings.receiver.rate_hz)
        origin = settings.origin
        frame = LocalFrame(
            Place(
                latitude_deg=origin.latitude_deg,
                longitude_deg=origin.longitude_deg,
                altitude_m=origin.altitude_m,
            )
        )
        place, vessels = settings.place, range(world.scenario.vessels)
        self.imus = [
            SimulatedImu(settings.imu, place, world.state, i, world.random(i)) for i in vessels
        ]
        self.receivers = [
            SimulatedReceiver(settings.receiver, place, frame, i, world.random(i)) for i in vessels
        ]
        self._sensed: list[Sensed] = []
        world.watch(self._look)

    def take(self) -> Iterator[Sensed]:
        """Give the messages since the last call, in the order of their times."""
        sensed, self._sensed = self._sensed, []
        return iter(sensed)

    def _look(self) -> None:
        world = self._world
        if world.steps % self._imu_steps == 0:
            for i, imu in enumerate(self.imus):
                felt = imu.sense(world.state, world.stamp_ns, self._imu_s)
                self._sensed.append(Sensed(i, "imu", cdr.encode_imu(felt)))
        if world.steps % self._fix_steps == 0:
            for i, receiver in enumerate(self.receivers):
                fix = receiver.sense(world.state, world.stamp_ns, world.time_s)
                self._sensed.append(Sensed(i, "gps", cdr.encode_fix(fix)))
