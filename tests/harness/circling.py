"""A boat that sails in circles, rolling and pitching, and what its GPS and IMU tell of it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from twinscrew.hil_sim.sensors.navigation import (
    ImuSettings,
    ReceiverSettings,
    SimulatedImu,
    SimulatedReceiver,
    TriadSettings,
)
from twinscrew.hil_sim.vessel.state import VesselState
from twinscrew.runtime.datum import Datum, LocalFrame, Place
from twinscrew.runtime.estimation.estimator import EstimationSettings, Estimator
from twinscrew.runtime.estimation.inertial import euler_rates, rotation
from twinscrew.runtime.estimation.sensors import SensorSettings
from twinscrew.runtime.geometry import quaternion_from_euler
from twinscrew.runtime.messages.types import Fix, Float64, HealthEvent, Imu, Odometry

EPOCH_NS = 1_800_000_000_000_000_000
DT_S = 0.01
DATUM = Datum(latitude_deg=-33.7221, longitude_deg=150.6739)
FRAME = LocalFrame(
    Place(latitude_deg=DATUM.latitude_deg, longitude_deg=DATUM.longitude_deg, altitude_m=1.15)
)
SILENT = TriadSettings(sigma=0.0, bias_mean=0.0, bias_sigma=0.0, wander_sigma=0.0, wander_time_s=1)
EXACT_IMU = ImuSettings(gyro=SILENT, force=SILENT, tilt_sigma_rad=0.0, heading_sigma_rad=0.0)
VRX_PLACE = SensorSettings()
WITH_DATUM = EstimationSettings(datum=DATUM)
EXACT_GPS = ReceiverSettings(horizontal_sigma_m=0.0, vertical_sigma_m=0.0)


def truth(time_s: float, *, rate: float = 0.3, speed: float = 2.0) -> VesselState:
    """Sail a circle at `speed` [m/s], turning by `rate` [rad/s], 100 m north of the origin."""
    heading = rate * time_s
    attitude = np.array([0.1 * np.sin(1.3 * time_s), 0.06 * np.cos(1.1 * time_s), heading])
    angle_rates = np.array([0.13 * np.cos(1.3 * time_s), -0.066 * np.sin(1.1 * time_s), rate])
    position_N = np.array(
        [100.0 + speed / rate * np.sin(heading), speed / rate * (1 - np.cos(heading)), 0.0]
    )
    velocity_N = speed * np.array([np.cos(heading), np.sin(heading), 0.0])
    return VesselState(
        position_N=position_N[None],
        q_NB=quaternion_from_euler(*attitude)[None],
        velocity_B=(rotation(attitude).T @ velocity_N)[None],
        rates_B=np.linalg.solve(euler_rates(attitude), angle_rates)[None],
        thrust=np.zeros((1, 2)),
    )


@dataclass
class Circling:
    """Sails with an estimator; keeps what it answers."""

    settings: EstimationSettings = WITH_DATUM
    imu: ImuSettings = EXACT_IMU
    gps: ReceiverSettings = EXACT_GPS
    place: SensorSettings = VRX_PLACE
    spoil_imu: Callable[[Imu, float], Imu | None] = lambda imu, _: imu
    spoil_fix: Callable[[Fix, float], Fix | None] = lambda fix, _: fix
    delay_s: float = 0.0
    """[s] How late fixes come."""
    seed: int = 0

    def __post_init__(self) -> None:
        rng = np.random.default_rng(self.seed)
        self.estimator = Estimator(self.settings)
        self._imu = SimulatedImu(self.imu, self.place, truth(0.0), 0, rng)
        self._gps = SimulatedReceiver(self.gps, self.place, FRAME, 0, rng)
        self._late: list[tuple[float, Fix]] = []
        self._steps = 0
        self.odometry: list[Odometry] = []
        self.events: list[HealthEvent] = []

    def sail(self, seconds: float) -> Circling:
        """Go on for a while."""
        for _ in range(round(seconds / DT_S)):
            self._steps += 1
            self._step(self._steps * DT_S)
        return self

    def named(self, name: str) -> list[HealthEvent]:
        """Give the events of a name."""
        return [event for event in self.events if event.name == name]

    def errors(self, skip_s: float = 0.0) -> Iterator[tuple[Float64, Float64]]:
        """Give the errors of position [m] and velocity [m/s], each (3,), after a while."""
        for odometry in self.odometry:
            time_s = (odometry.stamp_ns - EPOCH_NS) * 1e-9
            if time_s > skip_s:
                state = truth(time_s)
                yield (
                    odometry.position_N - state.position_N[0],
                    odometry.velocity_B - state.velocity_B[0],
                )

    def worst(self, skip_s: float = 0.0) -> tuple[float, float]:
        """Give the greatest horizontal errors of position [m] and velocity [m/s]."""
        errors = list(self.errors(skip_s))
        return (
            max(float(np.hypot(*p[:2])) for p, _ in errors),
            max(float(np.hypot(*v[:2])) for _, v in errors),
        )

    def _step(self, time_s: float) -> None:
        state, stamp_ns = truth(time_s), EPOCH_NS + round(time_s * 1e9)
        imu = self.spoil_imu(self._imu.sense(state, stamp_ns, DT_S), time_s)
        if self._steps % 5 == 0:
            fix = self.spoil_fix(self._gps.sense(state, stamp_ns, time_s), time_s)
            if fix is not None:
                self._late.append((time_s + self.delay_s, fix))
        while self._late and self._late[0][0] <= time_s + 1e-9:
            self.estimator.fix(self._late.pop(0)[1])
        odometry = None if imu is None else self.estimator.imu(imu)
        if odometry is not None:
            self.odometry.append(odometry)
        self.events += self.estimator.take_events()
