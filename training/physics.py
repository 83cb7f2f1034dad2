"""The physics of a decision, for E episodes of V vessels at once: forces, motion, contacts.

The equations are those of `runtime.policy.vessel_model`, laid out for speed: components come first,
then episodes, then vessels, so that arithmetic works on long rows; every coefficient is multiplied
by the time step and divided by the inertia beforehand; and because velocities do not depend on the
place, they are integrated first, and headings and places follow for all sub-steps at once. A test
compares this with `VesselModel.step`.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from twinscrew.runtime.errors import ConfigError, PolicyError
from twinscrew.runtime.messages.types import Float64
from twinscrew.runtime.policy.vessel_model import VesselParameters
from twinscrew.runtime.settings import Fraction, NonNegative, Positive, Settings
from twinscrew.training.scenarios import Index, Mask, Points, Scenarios

RATE_LIMIT = 1000.0
"""[N/s] The rate of change of thrust that an action of 1 asks for (paper, sec. V)."""
CHANCES = 16
"""[-] Uniform numbers that an episode, and each of its vessels, has for its conditions."""
Coriolis = Literal["once", "twice"]
"""How often Coriolis acts: "once" is the paper's equation; "twice" the authors' published
environment, which keeps velocities in the world frame while the hull turns and subtracts C(nu) nu
beside that. Boats then slide outward in turns; times in the two are not comparable."""


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


class State:
    """What is on the water: E episodes of V vessels, M buoys and T scripted vessels.

    Arrays that the environment changes in place. Places in the plane are complex, north + i east.
    """

    def __init__(self, episodes: int, vessels: int, buoys: int, scripted: int = 0) -> None:
        self.shape = shape = (episodes, vessels)
        self.north_east = np.zeros((2, *shape))
        """[m] (2, E, V)"""
        self.position = np.zeros(shape, complex)
        """[m] (E, V) The same, north + i east."""
        self.heading = np.zeros(shape)
        """[rad] (E, V)"""
        self.nu = np.zeros((3, *shape))
        """[m/s, m/s, rad/s] (3, E, V) Surge, sway, yaw rate."""
        self.thrust = np.zeros((2, *shape))
        """[N] (2, E, V) Left, right; as commanded."""
        self.goal = np.zeros(shape, complex)
        """[m] (E, V)"""
        self.active = np.zeros(shape, bool)
        """(E, V) Who is under way."""
        self.parked = np.zeros(shape, bool)
        """(E, V) Who arrived and lies at its goal."""
        self.buoy = np.zeros((episodes, buoys), complex)
        """[m] (E, M)"""
        self.buoy_there = np.zeros((episodes, buoys), bool)
        """(E, M)"""
        self.scripted = np.zeros((episodes, scripted), complex)
        """[m] (E, T) Vessels that hold course and speed (`traffic.py`)."""
        self.scripted_velocity = np.zeros((episodes, scripted), complex)
        """[m/s] (E, T)"""
        self.scripted_radius = np.zeros((episodes, scripted))
        """[m] (E, T) Of the circle around each; 0 where there is none."""
        self.decisions = np.zeros(episodes, np.int64)
        """[-] (E,) Since the episode began."""

    @property
    def there(self) -> Mask:
        """(E, V) Which vessels can be seen and touched."""
        return np.asarray(self.active | self.parked)

    @property
    def to_goal(self) -> Float64:
        """[m] (E, V) The distance to the goal."""
        distance: Float64 = np.abs(self.goal - self.position)
        return distance

    def begin(self, slots: Index, scenario: Scenarios) -> None:
        """Put new episodes in some slots, at rest."""
        self.position[slots] = scenario.start
        self.north_east[0, slots] = scenario.start.real
        self.north_east[1, slots] = scenario.start.imag
        self.heading[slots] = scenario.heading
        self.nu[:, slots] = self.thrust[:, slots] = 0.0
        self.goal[slots] = scenario.goal
        self.active[slots] = scenario.vessel
        self.parked[slots] = False
        self.buoy[slots] = scenario.buoy
        self.buoy_there[slots] = scenario.buoy_there
        self.decisions[slots] = 0

    def halt_others(self) -> None:
        """Stop who is not under way."""
        self.nu *= self.active
        self.thrust *= self.active


class Coefficients:
    """What the equations need of N vessels; arrays (3, 1) serve vessels that are all alike."""

    def __init__(
        self, parameters: VesselParameters, dt: float, vessels: int = 1, coriolis: Coriolis = "once"
    ) -> None:
        self.dt = dt
        self.keep = np.empty((3, vessels))
        """[-] 1 - dt D_linear / M: what is left of nu."""
        self.drag = np.empty((3, vessels))
        """[s/m, s/m, -] dt D_quadratic / M."""
        self.coriolis = np.empty((3, vessels))
        """dt times the factors of v r, u r, u v in -C(nu) nu, over M."""
        self.gain = np.empty((3, vessels))
        """[s/kg, s/kg, s/(kg m2)] dt / M."""
        self.lever = np.empty(vessels)
        """[m] From the centre line to a thruster."""
        # A velocity kept in the world frame while the hull turns by r dt: (u, v) += (v r, -u r) dt.
        self._turning = dt * np.array([[1.0], [-1.0], [0.0]]) if coriolis == "twice" else 0.0
        self.assign(np.arange(vessels), np.array(physical(parameters))[:, None])

    def assign(self, which: Index, values: Float64) -> None:
        """Set some vessels' coefficients from their `physical` values, (10, n)."""
        inertia = values[:3]
        m11, m22 = inertia[0], inertia[1]
        self.gain[:, which] = self.dt / inertia
        self.keep[:, which] = 1.0 - self.dt * values[3:6] / inertia
        self.drag[:, which] = self.dt * values[6:9] / inertia
        coriolis = self.dt * np.stack([m22, -m11, m11 - m22]) / inertia
        self.coriolis[:, which] = coriolis + self._turning
        self.lever[which] = values[9]


def physical(p: VesselParameters) -> tuple[float, ...]:
    """Give the ten values that fix the motion: inertia, linear, quadratic drag (3 each), lever."""
    return (*p.inertia, *p.linear_drag, *p.quadratic_drag, p.lever)


class Forces:
    """What acts on E episodes' V vessels by sub-step: thrusters, wind, waves.

    Every episode draws its conditions, and its vessels' hulls, from its own stream.
    """

    def __init__(
        self,
        settings: ConditionSettings,
        vessel: VesselParameters,
        shape: tuple[int, int],
        substep_s: float,
        coriolis: Coriolis = "once",
    ) -> None:
        for name in ("wind_mps", "wave_force_n", "wave_moment_nm"):
            low, high = getattr(settings, name)
            if low > high:
                raise ConfigError(f"({low}, {high}) is not (least, greatest)", key=name)
        self.settings, self.shape, self._dt = settings, shape, substep_s
        self._acting = settings.forces
        other = settings.other_vessel
        self._varied = other is not None
        vessels = math.prod(shape) if self._varied else 1
        self.coefficients = Coefficients(vessel, substep_s, vessels, coriolis)
        self._range = np.array([physical(vessel), physical(other or vessel)])[..., None]
        self.wind = np.zeros(shape, complex)
        """[m/s] (E, V) Where it blows to."""
        self._gust_phase = np.zeros(shape)
        self._wave = np.zeros((3, *shape))  # [N, N, N m] amplitudes
        self._wave_phase = np.zeros((3, *shape))
        self.thrust = np.zeros((2, *shape))
        """[N] (2, E, V) As it is where it lags, not as it is commanded."""

    def begin(self, slots: Index, chance: Float64) -> None:
        """Draw the conditions of new episodes from uniform numbers, (n, V + 1, CHANCES)."""
        if not (self._varied or self._acting):
            return
        s, all_, each = self.settings, chance[:, -1], chance[:, :-1]
        speed = _between(s.wind_mps, all_[:, 0])
        self.wind[slots] = (speed * np.exp(2j * np.pi * all_[:, 1]))[:, None]
        self._gust_phase[slots] = 2 * np.pi * all_[:, 2, None]
        force, moment = _between(s.wave_force_n, all_[:, 3]), _between(s.wave_moment_nm, all_[:, 4])
        self._wave[:, slots] = np.stack([force, force, moment])[..., None]
        self._wave_phase[:, slots] = 2 * np.pi * np.moveaxis(each[..., :3], -1, 0)
        self.thrust[:, slots] = 0.0
        if self._varied:
            low, high = self._range
            share = each[..., 3:13].reshape(-1, 10).T
            which = (slots[:, None] * self.shape[1] + np.arange(self.shape[1])).ravel()
            self.coefficients.assign(which, low + (high - low) * share)

    def decide(self, command: Float64, heading: Float64, active: Mask, elapsed_s: Float64) -> None:
        """Take in a decision: command (2, E, V) [N], heading and active (E, V), time (E,) [s]."""
        self._command = command
        self._constant = self._of_thrusters(command)
        if not self._acting:
            return
        self._heading = heading.reshape(-1).copy()
        self._active = active.reshape(-1)
        self._time = np.repeat(elapsed_s, self.shape[1])
        self._substep = 0

    def next(self, nu: Float64) -> Float64:
        """Give tau, (3, N) [N, N, N m], of the next sub-step, by nu, (3, N), at its beginning.

        The very same array again means the same force.
        """
        if not self._acting:
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
        tau = np.zeros((3, len(left)))
        np.add(left, right, out=tau[0])
        np.subtract(left, right, out=tau[2])
        tau[2] *= self.coefficients.lever
        return tau

    def _thrusters(self) -> Float64:
        """Let the thrust follow its command: first order."""
        lag = self.settings.thrust_lag_s
        if lag <= 0.0:
            return self._constant
        self.thrust += (self._command - self.thrust) * -math.expm1(-self._dt / lag)
        return self._of_thrusters(self.thrust)

    def _of_wind(self, nu: Float64) -> Float64:
        """VRX's wind force, with the relative wind in frame B; none at all in a calm."""
        s, wind = self.settings, self.wind.reshape(-1)
        phase = 2 * np.pi * self._time / s.gust_period_s + self._gust_phase.reshape(-1)
        blow = wind * (1.0 + s.gust * np.sin(phase)) * np.exp(-1j * self._heading)
        u, v = np.where(wind == 0.0, 0.0, np.stack([blow.real - nu[0], blow.imag - nu[1]]))
        return np.stack(
            [s.wind_along * u * np.abs(u), s.wind_across * v * np.abs(v), -2 * s.wind_yaw * u * v]
        )

    def _of_waves(self) -> Float64:
        """Sines of each vessel's own phases: what a hull that only knows the plane feels."""
        phase = 2 * np.pi * self._time / self.settings.wave_period_s
        waves: Float64 = self._wave * np.sin(phase.reshape(self.shape) + self._wave_phase)
        return waves.reshape(3, -1)


def _between(range_: tuple[float, float], share: Float64) -> Float64:
    """Give the value at a share of a range."""
    return range_[0] + (range_[1] - range_[0]) * share


class Motion:
    """Moves N vessels through the S sub-steps of one decision; keeps its workspace."""

    def __init__(self, coefficients: Coefficients, vessels: int, substeps: int) -> None:
        self.coefficients = coefficients
        self.trajectory = np.zeros((substeps + 1, 2, vessels))
        """[m] (S + 1, 2, N) North and east at the decision and after every sub-step."""
        self.headings = np.zeros((substeps + 1, vessels))
        """[rad] (S + 1, N)"""
        self._nu = np.zeros((substeps + 1, 3, vessels))
        self._over_ground = np.empty((substeps, 2, vessels))
        self._turn, self._shift = np.empty((2, substeps, vessels), complex)
        self._impulse, self._products, self._factor = np.empty((3, 3, vessels))

    def advance(self, position: Float64, heading: Float64, nu: Float64, forces: Forces) -> None:
        """Move all vessels in place and fill `trajectory`.

        Parameters
        ----------
        position : (2, N) float64
            North, east [m].
        heading : (N,) float64
            [rad]
        nu : (3, N) float64
            Surge, sway [m/s], yaw rate [rad/s].
        forces
            Gives tau of each sub-step.
        """
        self._nu[0] = nu
        tau = None
        for before, after in zip(self._nu[:-1], self._nu[1:], strict=True):
            last, tau = tau, forces.next(before)
            if tau is not last:
                np.multiply(tau, self.coefficients.gain, out=self._impulse)
            self._accelerate(before, after)
        self._follow(position, heading)
        position[:], heading[:], nu[:] = self.trajectory[-1], self.headings[-1], self._nu[-1]

    def _accelerate(self, nu: Float64, after: Float64) -> None:
        """Give nu + dt M^-1 (tau - C(nu) nu - D(nu) nu); dt M^-1 tau is `_impulse`."""
        c, products, factor = self.coefficients, self._products, self._factor
        np.multiply(nu[1::-1], nu[2], out=products[:2])  # v r, u r
        np.multiply(nu[0], nu[1], out=products[2])  # u v
        products *= c.coriolis
        np.abs(nu, out=factor)
        factor *= c.drag
        np.subtract(c.keep, factor, out=factor)
        np.multiply(nu, factor, out=after)
        after += products
        after += self._impulse

    def _follow(self, position: Float64, heading: Float64) -> None:
        """Sum up headings and places: by the heading before, the velocity after each sub-step."""
        moved = self._nu[1:] * self.coefficients.dt
        _sum_up(self.headings, heading, moved[:, 2])
        # North + i east = (surge + i sway) exp(i heading).
        turn, shift = self._turn, self._shift
        np.cos(self.headings[:-1], out=turn.real)
        np.sin(self.headings[:-1], out=turn.imag)
        shift.real, shift.imag = moved[:, 0], moved[:, 1]
        turn *= shift
        self._over_ground[:, 0], self._over_ground[:, 1] = turn.real, turn.imag
        _sum_up(self.trajectory, position, self._over_ground)


def _sum_up(into: Float64, start: Float64, changes: Float64) -> None:
    """Write the start and every partial sum; row by row, for rows are long and few."""
    into[0] = start
    for before, change, after in zip(into[:-1], changes, into[1:], strict=True):
        np.add(before, change, out=after)


class Physics:
    """Moves what is on the water by one decision, and tells who touched whom on the way."""

    def __init__(
        self,
        state: State,
        vessel: VesselParameters,
        conditions: ConditionSettings,
        period_s: float,
        substep_s: float,
        buoy_radius_m: float,
        coriolis: Coriolis = "once",
    ) -> None:
        self._state, self._vessel, self._buoy_radius = state, vessel, buoy_radius_m
        self._period, self._substep = period_s, substep_s
        self.forces = Forces(conditions, vessel, state.shape, substep_s, coriolis)
        vessels = math.prod(state.shape)
        self.motion = Motion(self.forces.coefficients, vessels, round(period_s / substep_s))

    def move(self, action: NDArray[np.floating]) -> None:
        """Change the thrusts and move through the sub-steps of a decision.

        Parameters
        ----------
        action : (E, V, 2) float
            As for `VectorEnv.step`.

        Raises
        ------
        PolicyError
            An action of a vessel that is on the water is not finite.
        """
        state = self._state
        if not np.isfinite(action).all():
            bad = ~np.isfinite(action).all(axis=-1) & state.active
            if bad.any():
                episode, vessel = np.argwhere(bad)[0]
                raise PolicyError(
                    f"action of vessel {vessel} in episode {episode} is "
                    f"{action[episode, vessel].tolist()}; two finite numbers are needed"
                )
            action = np.where(state.active[..., None], action, 0.0)
        rate = np.clip(np.asarray(action, np.float64), -1.0, 1.0) * RATE_LIMIT
        state.thrust += rate.transpose(2, 0, 1) * self._period
        low, high = self._vessel.thrust_min_n, self._vessel.thrust_max_n
        np.clip(state.thrust, low, high, out=state.thrust)
        state.thrust *= state.active
        elapsed_s = state.decisions.astype(np.float64) * self._period
        self.forces.decide(state.thrust, state.heading, state.active, elapsed_s)
        self.motion.advance(
            state.north_east.reshape(2, -1),
            state.heading.reshape(-1),
            state.nu.reshape(3, -1),
            self.forces,
        )
        state.position.real, state.position.imag = state.north_east
        state.scripted += state.scripted_velocity * self._period

    def touched(self) -> tuple[Mask, Mask]:
        """Tell which vessels touched a vessel, and which a buoy, in the decision just made."""
        state, radius = self._state, self._vessel.radius
        flat = self.motion.trajectory
        trajectory = flat.reshape(len(flat), 2, *state.shape)
        far = strayed(flat).reshape(state.shape)
        vessel = between_vessels(trajectory, far, state.there, radius) & state.active
        there, buoys = state.active, (state.buoy, state.buoy_there, self._buoy_radius)
        return vessel, with_buoys(trajectory, far, there, radius, *buoys)


# Contacts are checked at every sub-step. First a bound: two circles whose distance at the start
# exceeds their radii and the farthest that either strayed from there cannot have touched. The few
# pairs that are left are checked in full.


def strayed(trajectory: Float64) -> Float64:
    """Give the farthest, (N,) [m], that each vessel was from where it began; (S + 1, 2, N) in."""
    offset = trajectory[1:] - trajectory[0]
    offset *= offset
    farthest: Float64 = np.sqrt((offset[:, 0] + offset[:, 1]).max(axis=0))
    return farthest


def between_vessels(trajectory: Float64, strayed: Float64, there: Mask, radius: float) -> Mask:
    """Tell which vessels touched another one.

    Parameters
    ----------
    trajectory : (S + 1, 2, E, V) float64
        North, east [m] of V vessels in E episodes, before and after each of S sub-steps.
    strayed : (E, V) float64
        [m] Farthest from the first position.
    there : (E, V) bool
        Which of them are on the water.
    radius : float
        [m] Of each.

    Returns
    -------
    touched : (E, V) bool
    """
    touched = np.zeros(there.shape, bool)
    north, east = trajectory[0]
    north, east = north[:, :, None] - north[:, None], east[:, :, None] - east[:, None]
    reach = strayed + radius
    reach = reach[:, :, None] + reach[:, None]
    near = north * north + east * east < reach * reach
    near &= there[:, :, None] & there[:, None] & _later(there.shape[1])
    episode, i, j = np.nonzero(near)
    if episode.size:
        offset = trajectory[1:, :, episode, i] - trajectory[1:, :, episode, j]
        hit = _closest(offset) < 2 * radius
        touched[episode[hit], i[hit]] = True
        touched[episode[hit], j[hit]] = True
    return touched


def with_buoys(
    trajectory: Float64,
    strayed: Float64,
    there: Mask,
    radius: float,
    buoy: Points,
    buoy_there: Mask,
    buoy_radius: float,
) -> Mask:
    """Tell which vessels touched a buoy; buoys (E, M), the rest as in `between_vessels`."""
    touched = np.zeros(there.shape, bool)
    if not buoy.shape[1]:
        return touched
    x, y = trajectory[0][..., None]
    north, east = x - buoy.real[:, None], y - buoy.imag[:, None]
    reach = (radius + buoy_radius + strayed)[..., None]
    near = north * north + east * east < reach * reach
    near &= there[..., None] & buoy_there[:, None]
    episode, vessel, which = np.nonzero(near)
    if episode.size:
        centre = buoy[episode, which]
        offset = trajectory[1:, :, episode, vessel] - np.stack([centre.real, centre.imag])
        hit = _closest(offset) < radius + buoy_radius
        touched[episode[hit], vessel[hit]] = True
    return touched


def _closest(offset: Float64) -> Float64:
    """Give the smallest distance, (n,) [m], over the sub-steps of offsets (S, 2, n)."""
    closest: Float64 = np.hypot(offset[:, 0], offset[:, 1]).min(axis=0)
    return closest


@lru_cache(maxsize=8)
def _later(vessels: int) -> Mask:
    """Tell of each two vessels, (V, V), whether the second comes after the first."""
    return np.triu(np.ones((vessels, vessels), bool), k=1)
