"""Odometry as VRX gives it: the truth, or the truth with noise."""

from __future__ import annotations

from numpy.random import Generator

from twinscrew.hil_sim.vessel.state import VesselState
from twinscrew.runtime.geometry import quaternion_from_euler, quaternion_product
from twinscrew.runtime.messages.types import Odometry
from twinscrew.runtime.settings import NonNegative, Settings


class OdometrySettings(Settings, frozen=True, kw_only=True):
    """Standard deviations of white Gaussian noise; the paper adds none."""

    position_sigma_m: NonNegative = 0.0
    """[m] North, east, down."""
    attitude_sigma_rad: NonNegative = 0.0
    """[rad] Roll, pitch, yaw."""
    velocity_sigma_mps: NonNegative = 0.0
    """[m/s] Surge, sway, heave."""
    rate_sigma_radps: NonNegative = 0.0
    """[rad/s] Roll, pitch and yaw rate."""

    @property
    def exact(self) -> bool:
        """True if there is no noise."""
        return not (
            self.position_sigma_m
            or self.attitude_sigma_rad
            or self.velocity_sigma_mps
            or self.rate_sigma_radps
        )


def measure(
    state: VesselState, vessel: int, stamp_ns: int, settings: OdometrySettings, rng: Generator
) -> Odometry:
    """Give one vessel's odometry. With noise, twelve numbers are drawn from `rng`."""
    if settings.exact:
        return Odometry(
            stamp_ns=stamp_ns,
            position_N=state.position_N[vessel],
            q_NB=state.q_NB[vessel],
            velocity_B=state.velocity_B[vessel],
            rates_B=state.rates_B[vessel],
        )
    noise = rng.standard_normal((4, 3))
    tilt = quaternion_from_euler(*(settings.attitude_sigma_rad * noise[1]))
    return Odometry(
        stamp_ns=stamp_ns,
        position_N=state.position_N[vessel] + settings.position_sigma_m * noise[0],
        q_NB=quaternion_product(state.q_NB[vessel], tilt),
        velocity_B=state.velocity_B[vessel] + settings.velocity_sigma_mps * noise[2],
        rates_B=state.rates_B[vessel] + settings.rate_sigma_radps * noise[3],
    )
