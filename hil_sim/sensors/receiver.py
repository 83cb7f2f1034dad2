"""A satellite receiver: the antenna's place on the earth, with noise, wandering and outages."""

from __future__ import annotations

import math

import numpy as np
from numpy.random import Generator

from twinscrew.hil_sim.vessel.state import VesselState
from twinscrew.runtime.estimation.sensors import SensorSettings
from twinscrew.runtime.estimation.wgs84 import LocalFrame
from twinscrew.runtime.geometry.frames import flu_to_frd, rotation_from_quaternion
from twinscrew.runtime.messages.types import Fix, Float64
from twinscrew.runtime.settings import NonNegative, Positive, Settings


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
