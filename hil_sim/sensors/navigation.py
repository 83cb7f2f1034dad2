"""Simulated inertial measurement units and satellite receivers, with VRX's noise."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.random import Generator

from twinscrew.hil_sim.autopilot.telemetry import Origin
from twinscrew.hil_sim.vessel.state import VesselState
from twinscrew.hil_sim.world import World
from twinscrew.runtime.datum import LocalFrame, Place
from twinscrew.runtime.estimation.inertial import GRAVITY_N
from twinscrew.runtime.estimation.sensors import SensorSettings
from twinscrew.runtime.geometry import (
    flu_to_frd,
    quaternion_from_euler,
    quaternion_product,
    rotation_from_quaternion,
)
from twinscrew.runtime.messages import cdr
from twinscrew.runtime.messages.types import Fix, Float64, Imu
from twinscrew.runtime.settings import NonNegative, Positive, Settings


class TriadSettings(Settings, frozen=True, kw_only=True):
    """The errors of three sensors of one kind."""

    sigma: NonNegative
    """White noise of a sample."""
    bias_mean: NonNegative
    """A bias is drawn once for each axis: this,"""
    bias_sigma: NonNegative
    """with this standard deviation, with either sign."""
    wander_sigma: NonNegative
    """Standard deviation of a bias that wanders,"""
    wander_time_s: Positive
    """[s] with this time constant."""


class ImuSettings(Settings, frozen=True, kw_only=True):
    """VRX 2.3.2's unit (wamv_imu.xacro), but for the errors of the attitude."""

    rate_hz: Positive = 100.0
    """[Hz]"""
    gyro: TriadSettings = TriadSettings(
        sigma=0.009, bias_mean=0.00075, bias_sigma=0.005, wander_sigma=0.00002, wander_time_s=400.0
    )
    """[rad/s]"""
    force: TriadSettings = TriadSettings(
        sigma=0.021, bias_mean=0.05, bias_sigma=0.0075, wander_sigma=0.000375, wander_time_s=175.0
    )
    """[m/s2]"""
    tilt_sigma_rad: NonNegative = 0.01
    """[rad] White noise of roll and pitch: half a degree (our choice; VRX: none)."""
    heading_sigma_rad: NonNegative = 0.02
    """[rad] White noise of the heading: a degree (our choice; VRX: none)."""
    heading_offset_rad: float = 0.0
    """[rad] What a compass is off by, clockwise."""


class Triad:
    """Three sensors along the axes."""

    def __init__(self, settings: TriadSettings, rng: Generator) -> None:
        self._settings = settings
        self._rng = rng
        sign = rng.choice([-1.0, 1.0], 3)
        self._fixed = sign * rng.normal(settings.bias_mean, settings.bias_sigma, 3)
        self._wander = np.zeros(3)

    @property
    def bias(self) -> Float64:
        """The present bias, (3,)."""
        return self._fixed + self._wander

    def measure(self, truth: Float64, dt_s: float) -> Float64:
        """Give what they tell of the truth, (3,), `dt_s` [s] after the last time."""
        s = self._settings
        keep = math.exp(-dt_s / s.wander_time_s)
        kick = s.wander_sigma * math.sqrt(1.0 - keep * keep)
        self._wander = keep * self._wander + kick * self._rng.standard_normal(3)
        return truth + self.bias + s.sigma * self._rng.standard_normal(3)


class SimulatedImu:
    """One vessel's unit; `sense` is called after every step of the world that it measures."""

    def __init__(
        self,
        settings: ImuSettings,
        place: SensorSettings,
        state: VesselState,
        vessel: int,
        rng: Generator,
    ) -> None:
        self._settings = settings
        self._vessel = vessel
        self._rng = rng
        mount = place.imu
        self._imu_B = flu_to_frd(np.array([mount.x_m, mount.y_m, mount.z_m]))
        self._q_BI = quaternion_from_euler(mount.roll_rad, -mount.pitch_rad, -mount.yaw_rad)
        self._R_IB = rotation_from_quaternion(self._q_BI).T
        self.gyro, self.force = Triad(settings.gyro, rng), Triad(settings.force, rng)
        self._v_N = self._velocity_N(state)

    def sense(self, state: VesselState, stamp_ns: int, dt_s: float) -> Imu:
        """Give the unit's message; the acceleration is the mean over the last `dt_s` [s]."""
        settings, q_NB = self._settings, state.q_NB[self._vessel]
        before_N, self._v_N = self._v_N, self._velocity_N(state)
        force_N = (self._v_N - before_N) / dt_s - GRAVITY_N
        force_B = rotation_from_quaternion(q_NB).T @ force_N
        rates_B = state.rates_B[self._vessel]
        tilt, heading = settings.tilt_sigma_rad, settings.heading_sigma_rad
        variance = np.array([tilt**2, tilt**2, heading**2])
        return Imu(
            stamp_ns=stamp_ns,
            rates_I=self.gyro.measure(self._R_IB @ rates_B, dt_s),
            force_I=self.force.measure(self._R_IB @ force_B, dt_s),
            q_NI=quaternion_product(self._measured_attitude(q_NB, variance), self._q_BI),
            attitude_variance=variance if variance.all() else None,
        )

    def _measured_attitude(self, q_NB: Float64, variance: Float64) -> Float64:
        roll, pitch, yaw = (np.sqrt(variance) * self._rng.standard_normal(3)).tolist()
        north = quaternion_from_euler(0.0, 0.0, yaw + self._settings.heading_offset_rad)
        tilt = quaternion_from_euler(roll, pitch, 0.0)
        return quaternion_product(quaternion_product(north, q_NB), tilt)

    def _velocity_N(self, state: VesselState) -> Float64:
        """Give the velocity of the place where the unit sits, (3,) [m/s]."""
        i = self._vessel
        v_B = state.velocity_B[i] + np.cross(state.rates_B[i], self._imu_B)
        velocity: Float64 = rotation_from_quaternion(state.q_NB[i]) @ v_B
        return velocity


# -- A satellite receiver: the antenna's place on the earth, with noise, wandering and outages.


class ReceiverSettings(Settings, frozen=True, kw_only=True):
    """VRX 2.3.2's rate; its receiver has no noise, so that the noise is our choice."""

    rate_hz: Positive = 20.0
    """[Hz]"""
    horizontal_sigma_m: NonNegative = 0.5
    """[m] White noise north and east."""
    vertical_sigma_m: NonNegative = 1.0
    """[m] White noise of the altitude."""
    wander_sigma_m: NonNegative = 0.0
    """[m] Standard deviation of an error north and east that wanders, of which nothing is told,"""
    wander_time_s: Positive = 60.0
    """[s] with this time constant."""
    outages_s: tuple[tuple[float, float], ...] = ()
    """[s] Times, from and to, since the beginning, at which there is no fix."""


class SimulatedReceiver:
    """One vessel's receiver."""

    def __init__(
        self,
        settings: ReceiverSettings,
        place: SensorSettings,
        frame: LocalFrame,
        vessel: int,
        rng: Generator,
    ) -> None:
        self._settings = settings
        self._frame = frame
        self._vessel = vessel
        self._rng = rng
        antenna = place.antenna
        self._antenna_B = flu_to_frd(np.array([antenna.x_m, antenna.y_m, antenna.z_m]))
        self._wander_N = settings.wander_sigma_m * rng.standard_normal(2)

    def sense(self, state: VesselState, stamp_ns: int, time_s: float) -> Fix:
        """Give the receiver's message at a time, `time_s` [s] after the beginning."""
        s, i = self._settings, self._vessel
        antenna_N = state.position_N[i] + rotation_from_quaternion(state.q_NB[i]) @ self._antenna_B
        sigma = np.array([s.horizontal_sigma_m, s.horizontal_sigma_m, s.vertical_sigma_m])
        error_N = sigma * self._rng.standard_normal(3)
        error_N[:2] += self._wandered()
        place = self._frame.place(antenna_N + error_N)
        return Fix(
            stamp_ns=stamp_ns,
            valid=not any(begin <= time_s < end for begin, end in s.outages_s),
            latitude_deg=place.latitude_deg,
            longitude_deg=place.longitude_deg,
            altitude_m=place.altitude_m,
            covariance_N=np.diag(sigma**2) if sigma.all() else None,
        )

    def _wandered(self) -> Float64:
        s = self._settings
        keep = math.exp(-1.0 / (s.rate_hz * s.wander_time_s))
        kick = s.wander_sigma_m * math.sqrt(1.0 - keep * keep)
        self._wander_N = keep * self._wander_N + kick * self._rng.standard_normal(2)
        return self._wander_N


# -- The receivers and inertial measurement units of all vessels of a world.


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
                sample = imu.sense(world.state, world.stamp_ns, self._imu_s)
                self._sensed.append(Sensed(i, "imu", cdr.encode_imu(sample)))
        if world.steps % self._fix_steps == 0:
            for i, receiver in enumerate(self.receivers):
                fix = receiver.sense(world.state, world.stamp_ns, world.time_s)
                self._sensed.append(Sensed(i, "gps", cdr.encode_fix(fix)))
