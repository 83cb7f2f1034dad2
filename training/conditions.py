"""What moves and handles the vessels other than as published: wind, waves, lag, other hulls.

All of it is off by default. Every episode draws its own conditions from its own stream.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from twinscrew.runtime.errors import ConfigError
from twinscrew.runtime.messages.types import Float64
from twinscrew.runtime.policy.vessel_model import VesselParameters
from twinscrew.runtime.settings import Fraction, NonNegative, Positive, Settings
from twinscrew.training.dynamics import Coefficients, physical

CHANCES = 16
"""[-] Uniform numbers that an episode, and each of its vessels, has for its conditions."""


class ConditionSettings(Settings, frozen=True):
    """The sea and the hulls; ranges are (least, greatest), drawn uniformly for every episode."""

    wind_mps: tuple[NonNegative, NonNegative] = (0.0, 0.0)
    """[m/s] Mean wind; from any direction. The experiments have 10 m/s."""
    gust: Fraction = 0.0
    """[-] The wind swings by this part of its mean,"""
    gust_period_s: Positive = 20.0
    """[s] in this time."""
    wind_along: NonNegative = 0.5
    """[N s2/m2] Force F_x = this u |u|, u and v the relative wind in frame B (VRX)."""
    wind_across: NonNegative = 0.5
    """[N s2/m2] Force F_y = this v |v|."""
    wind_yaw: NonNegative = 0.33
    """[N s2/m] Moment M_z = -2 this u v."""
    wave_force_n: tuple[NonNegative, NonNegative] = (0.0, 0.0)
    """[N] Amplitude of the waves' force, along and across, of each vessel's own phase."""
    wave_moment_nm: tuple[NonNegative, NonNegative] = (0.0, 0.0)
    """[N m] Amplitude of the waves' yaw moment."""
    wave_period_s: Positive = 5.0
    """[s] The experiments' mean period."""
    thrust_lag_s: NonNegative = 0.0
    """[s] Time constant with which thrust follows its command."""
    other_vessel: VesselParameters | None = None
    """Each inertia, drag and lever of each vessel lies anywhere between `vessel`'s and this one's;
    the thrust range and the hull's circle stay `vessel`'s."""

    @property
    def forces(self) -> bool:
        """Whether anything but the commanded thrust acts."""
        ranges = (self.wind_mps, self.wave_force_n, self.wave_moment_nm)
        return self.thrust_lag_s > 0.0 or any(high > 0.0 for _, high in ranges)


class Conditions:
    """The conditions of E episodes with V vessels: forces by sub-step."""

    def __init__(
        self,
        settings: ConditionSettings,
        vessel: VesselParameters,
        shape: tuple[int, int],
        substep_s: float,
    ) -> None:
        for name in ("wind_mps", "wave_force_n", "wave_moment_nm"):
            low, high = getattr(settings, name)
            if low > high:
                raise ConfigError(f"({low}, {high}) is not (least, greatest)", key=name)
        self.settings, self.shape, self._dt = settings, shape, substep_s
        varied = settings.other_vessel is not None
        self.coefficients = Coefficients(vessel, substep_s, math.prod(shape) if varied else 1)
        self._range = (
            np.array(physical(vessel))[:, None],
            np.array(physical(settings.other_vessel or vessel))[:, None],
        )
        self._varied = varied
        self._wind = np.zeros(shape, complex)  # [m/s] where it blows to
        self._gust_phase = np.zeros(shape)
        self._wave = np.zeros((3, *shape))  # [N, N, N m] amplitudes
        self._wave_phase = np.zeros((3, *shape))
        self._thrust = np.zeros((2, *shape))  # [N] as it is, not as it is commanded

    def begin(self, slots: NDArray[np.intp], chance: Float64) -> None:
        """Draw the conditions of new episodes from uniform numbers, (n, V + 1, CHANCES)."""
        if not (self._varied or self.settings.forces):
            return
        s, all_, each = self.settings, chance[:, -1], chance[:, :-1]
        speed = _between(s.wind_mps, all_[:, 0])
        self._wind[slots] = (speed * np.exp(2j * np.pi * all_[:, 1]))[:, None]
        self._gust_phase[slots] = 2 * np.pi * all_[:, 2, None]
        force, moment = _between(s.wave_force_n, all_[:, 3]), _between(s.wave_moment_nm, all_[:, 4])
        self._wave[:, slots] = np.stack([force, force, moment])[..., None]
        self._wave_phase[:, slots] = 2 * np.pi * np.moveaxis(each[..., :3], -1, 0)
        self._thrust[:, slots] = 0.0
        if self._varied:
            low, high = self._range
            share = each[..., 3:13].reshape(-1, 10).T
            vessels = np.arange(self.shape[1])
            which = (slots[:, None] * self.shape[1] + vessels).ravel()
            self.coefficients.assign(which, low + (high - low) * share)

    def decide(
        self, command: Float64, heading: Float64, active: NDArray[np.bool_], elapsed_s: Float64
    ) -> None:
        """Take in a decision: command (2, E, V) [N], heading and active (E, V), time (E,) [s]."""
        self._command = command
        self._constant = self._of_thrusters(command)
        if not self.settings.forces:
            return
        self._heading = heading.reshape(-1).copy()
        self._active = active.reshape(-1)
        self._time = np.repeat(elapsed_s, self.shape[1])
        self._substep = 0

    def force(self, nu: Float64) -> Float64:
        """Give tau, (3, N) [N, N, N m], of the next sub-step, by nu, (3, N), at its beginning."""
        if not self.settings.forces:
            return self._constant
        if self._substep:
            self._heading += self._dt * nu[2]
            self._time += self._dt
        self._substep += 1
        tau = self._thrusters() + self._of_wind(nu) + self._of_waves()
        tau *= self._active
        return tau

    def _of_thrusters(self, thrust: Float64) -> Float64:
        left, right = thrust.reshape(2, -1)
        yaw = (left - right) * self.coefficients.lever
        return np.stack([left + right, np.zeros_like(left), yaw])

    def _thrusters(self) -> Float64:
        """Let the thrust follow its command: first order."""
        lag = self.settings.thrust_lag_s
        if lag <= 0.0:
            return self._constant
        self._thrust += (self._command - self._thrust) * -math.expm1(-self._dt / lag)
        return self._of_thrusters(self._thrust)

    def _of_wind(self, nu: Float64) -> Float64:
        """VRX's wind force, with the relative wind in frame B; none at all in a calm."""
        s, wind = self.settings, self._wind.reshape(-1)
        phase = 2 * np.pi * self._time / s.gust_period_s + self._gust_phase.reshape(-1)
        blow = wind * (1.0 + s.gust * np.sin(phase)) * np.exp(-1j * self._heading)
        u, v = np.where(wind == 0.0, 0.0, np.stack([blow.real - nu[0], blow.imag - nu[1]]))
        return np.stack(
            [s.wind_along * u * np.abs(u), s.wind_across * v * np.abs(v), -2 * s.wind_yaw * u * v]
        )

    def _of_waves(self) -> Float64:
        """Sines of each vessel's own phases."""
        phase = 2 * np.pi * self._time / self.settings.wave_period_s
        waves: Float64 = self._wave * np.sin(phase.reshape(self.shape) + self._wave_phase)
        return waves.reshape(3, -1)


def _between(range_: tuple[float, float], share: Float64) -> Float64:
    """Give the value at a share of a range."""
    return range_[0] + (range_[1] - range_[0]) * share
