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
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.stats import norm

from twinscrew.runtime.errors import ConfigError, PolicyError
from twinscrew.runtime.messages.types import Float32, Float64
from twinscrew.runtime.policy.hull_units import HULL_COLUMNS, describe_hull, hull_columns
from twinscrew.runtime.policy.vessel_model import VesselParameters
from twinscrew.runtime.settings import Fraction, NonNegative, Positive, Settings
from twinscrew.training.harbours import CurrentField, CurrentKind
from twinscrew.training.land import Land
from twinscrew.training.scenarios import Index, Mask, Points, Scenarios

RATE_LIMIT = 1000.0
"""[N/s] The rate of change of thrust that an action of 1 asks for (paper, sec. V)."""
CHANCES = 16
"""[-] Uniform numbers that an episode, and each of its vessels, has for its conditions;"""
HULL_CHANCES = 32
"""[-] and so many more where hulls are drawn at random (`HullSettings`)."""
Coriolis = Literal["once", "twice"]
"""How often Coriolis acts: "once" is the paper's equation; "twice" the authors' published
environment, which keeps velocities in the world frame while the hull turns and subtracts C(nu) nu
beside that. Boats then slide outward in turns; times in the two are not comparable."""


class HullSettings(Settings, frozen=True):
    """Hulls drawn at random, for a policy that is to drive any; ranges are (least, greatest).

    Numbers are those of a hull in its own units (`runtime.policy.hull_units`), which are the
    default vessel's: 5 m, 3.3 m/s, 1000 N. The shipped vessels, and hulls of 1 to 12 m by the
    estimates of docs/vessels.md, lie inside.
    """

    share: Fraction = 0.0
    """[-] Of the episodes; in the others all vessels are as they would be without this."""
    mass_kg: tuple[Positive, Positive] = (280.0, 1800.0)
    """[kg] With added mass in surge; by its logarithm."""
    sway_mass: tuple[Positive, Positive] = (0.9, 1.8)
    """[-] Mass with added mass in sway over that in surge."""
    top_speed_mps: tuple[Positive, Positive] = (2.7, 3.6)
    """[m/s] At full thrust ahead."""
    sway_drag: tuple[Positive, Positive] = (0.5, 15.0)
    """[-] Drag in sway over that in surge, linear and quadratic; by its logarithm."""
    yaw_inertia: tuple[Positive, Positive] = (900.0, 5500.0)
    """[kg m2] With added inertia; by its logarithm."""
    lever_m: tuple[Positive, Positive] = (0.4, 1.5)
    """[m] From the centre line to a thruster."""
    turn_rate_radps: tuple[Positive, Positive] = (0.15, 1.1)
    """[rad/s] Steady, on the spot; by its logarithm."""
    radius_m: tuple[Positive, Positive] = (1.4, 3.3)
    """[m] Of the circle that holds the hull."""
    astern: tuple[Fraction, Fraction] = (0.3, 1.0)
    """[-] Greatest thrust astern over that ahead."""
    lag_s: NonNegative = 0.8
    """[s] Greatest time constant of the thrust; small ones are the commoner."""
    weak: Fraction = 0.25
    """[-] Share of the vessels with one weaker propeller,"""
    weakest: Fraction = 0.65
    """[-] which gives between this part of its thrust and all of it."""
    unknown: NonNegative = 0.12
    """[-] Standard deviation of the logarithm of what half of the policies are told wrongly of
    their hulls; the others are told the truth, but never of a weak propeller."""
    coriolis_twice: Fraction = 0.15
    """[-] Share of the vessels that slide outward in turns as in the authors' environment."""


class UnknownSettings(Settings, frozen=True):
    """By how much every vessel differs from what its policy is told of it."""

    mass: Fraction = 0.0
    """[-] Its inertia is multiplied by 1 - this to 1 + this."""
    drag: Fraction = 0.0
    """[-] Its drag is multiplied by 1 - this to 1 + this."""
    propeller: Fraction = 0.0
    """[-] One of its propellers, the left or the right, lacks this part of its thrust."""
    lag_s: NonNegative = 0.0
    """[s] Up to this is added to the time constant of its thrust."""

    @property
    def any(self) -> bool:
        """Whether anything differs."""
        return max(self.mass, self.drag, self.propeller, self.lag_s) > 0.0


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
    hulls: HullSettings = HullSettings()
    """Hulls drawn at random."""
    unknown: UnknownSettings = UnknownSettings()
    """What the policies are not told of their hulls."""
    current_mps: tuple[NonNegative, NonNegative] = (0.0, 0.0)
    """[m/s] Of the water, towards any direction; steady, the same everywhere in an episode."""
    currents: tuple[CurrentKind, ...] = ()
    """If any: the current is one of these, each as likely, and varies from place to place or with
    time; `current_mps` is then its greatest speed."""

    @property
    def forces(self) -> bool:
        """Whether anything but the commanded thrust acts."""
        ranges = (self.wind_mps, self.wave_force_n, self.wave_moment_nm)
        lags = self.thrust_lag_s > 0.0 or self.hulls_differ
        return lags or any(high > 0.0 for _, high in ranges)

    @property
    def chances(self) -> int:
        """[-] Uniform numbers that an episode, and each of its vessels, needs."""
        return CHANCES + HULL_CHANCES * (self.hulls_differ or self.current_mps[1] > 0.0)

    @property
    def hulls_differ(self) -> bool:
        """Whether every vessel has inertia, drag, propellers and lag of its own."""
        return self.hulls.share > 0.0 or self.unknown.any

    @property
    def varied(self) -> bool:
        """Whether hulls or the water differ from episode to episode (`draw_hulls`)."""
        return self.other_vessel is not None or self.chances > CHANCES


class Hulls(NamedTuple):
    """What N episodes' V vessels are like, and the water that carries them."""

    physical: Float64
    """(10, N, V) Inertia, linear, quadratic drag (3 each), lever: as `physical` gives them."""
    radius: Float64
    """(N, V) [m]"""
    thrust_min: Float64
    """(N, V) [N]"""
    lag: Float64
    """(N, V) [s]"""
    gain: Float64
    """(2, N, V) [-] Thrust over commanded thrust, left and right."""
    twice: Mask
    """(N, V) Whether Coriolis acts twice, whatever the environment's setting."""
    told: Float32
    """(N, V, 10) What the policy is told (`HULL_COLUMNS`)."""
    current: Points
    """(N,) [m/s] Velocity of the water."""


def draw_hulls(settings: ConditionSettings, vessel: VesselParameters, chance: Float64) -> Hulls:
    """Draw the hulls and the current of N episodes from uniform numbers, (N, V + 1, chances)."""
    each, all_ = chance[:, :-1], chance[:, -1]
    shape = each.shape[:2]
    base = np.array(physical(vessel))
    values = np.broadcast_to(base[:, None, None], (10, *shape)).copy()
    if settings.other_vessel is not None:
        far = np.array(physical(settings.other_vessel))[:, None, None]
        share = np.moveaxis(each[..., 3:13], -1, 0)
        values = values + (far - values) * share
    radius, low = np.full(shape, vessel.radius), np.full(shape, vessel.thrust_min_n)
    lag, gain = np.full(shape, settings.thrust_lag_s), np.ones((2, *shape))
    twice, current = np.zeros(shape, bool), np.zeros(len(chance), complex)
    told_wrongly = np.ones((*shape, len(HULL_COLUMNS)))
    high = vessel.thrust_max_n
    u, h = np.moveaxis(each[..., CHANCES:], -1, 0), settings.hulls
    if settings.chances > CHANCES:
        whole = all_[:, CHANCES:]
        drawn = (whole[:, 0] < h.share)[:, None] & np.ones(shape, bool)
        speed, turn = _between(h.top_speed_mps, u[0]), _log_between(h.turn_rate_radps, u[1])
        surge = _drag(2 * high, speed, u[2])
        across = _log_between(h.sway_drag, u[3]), _log_between(h.sway_drag, u[4])
        lever, astern = _between(h.lever_m, u[5]), -high * _between(h.astern, u[6])
        yaw = _drag((high - astern) * lever, turn, u[7])
        mass = _log_between(h.mass_kg, u[8])
        random = np.stack(
            [
                *(mass, mass * _between(h.sway_mass, u[9]), _log_between(h.yaw_inertia, u[10])),
                *(surge[0], surge[0] * across[0], yaw[0]),
                *(surge[1], surge[1] * across[1], yaw[1]),
                lever,
            ]
        )
        values = np.where(drawn, random, values)
        radius = np.where(drawn, _between(h.radius_m, u[11]), radius)
        low = np.where(drawn, astern, low)
        lag = np.where(drawn, h.lag_s * u[12] ** 2, lag)
        weak = np.where(u[13] < h.weak, h.weakest + (1.0 - h.weakest) * u[14], 1.0)
        side = u[15] < 0.5
        gain = np.where(
            drawn, np.stack([np.where(side, weak, 1.0), np.where(side, 1.0, weak)]), 1.0
        )
        twice = drawn & (u[16] < h.coriolis_twice)
        if not settings.currents:
            current = _between(settings.current_mps, whole[:, 1]) * np.exp(2j * np.pi * whole[:, 2])
        error = np.exp(h.unknown * norm.ppf(np.clip(u[17:27], 1e-6, 1.0 - 1e-6)))
        told_wrongly = np.where(drawn & (u[27] < 0.5), error, 1.0).transpose(1, 2, 0)
    told = hull_columns(
        *(values[:3], values[3:6], values[6:9], values[9], radius, (low, np.full(shape, high)), lag)
    )
    rows: Float32 = (told * told_wrongly).astype(np.float32)
    if settings.unknown.any:
        values, gain, lag = _differ(settings.unknown, u[28:32], values, gain, lag)
    return Hulls(values, radius, low, lag, gain, twice, rows, current)


def _differ(
    unknown: UnknownSettings, u: Float64, values: Float64, gain: Float64, lag: Float64
) -> tuple[Float64, Float64, Float64]:
    """Change inertia and drag, (10, N, V), the propellers' share and their lag by u, (4, N, V)."""
    mass = 1.0 + unknown.mass * (2.0 * u[0] - 1.0)
    drag = 1.0 + unknown.drag * (2.0 * u[1] - 1.0)
    values = np.concatenate([values[:3] * mass, values[3:9] * drag, values[9:]])
    left = u[2] < 0.5
    lacks = unknown.propeller * np.stack([left, ~left])
    return values, gain * (1.0 - lacks), lag + unknown.lag_s * u[3]


def _drag(force: Float64 | float, speed: Float64, linear: Float64) -> tuple[Float64, Float64]:
    """Give linear and quadratic drag that hold a force at a speed, a share of it the linear's."""
    return linear * force / speed, (1.0 - linear) * force / speed**2


def _log_between(range_: tuple[float, float], share: Float64) -> Float64:
    """Give the value at a share of a range, by its logarithm."""
    low, high = range_
    value: Float64 = low * (high / low) ** share
    return value


class State:
    """What is on the water: E episodes of V vessels, M buoys and T scripted vessels.

    Arrays that the environment changes in place. Places in the plane are complex, north + i east.
    """

    def __init__(
        self,
        episodes: int,
        vessels: int,
        buoys: int,
        scripted: int = 0,
        vessel: VesselParameters | None = None,
        lag_s: float = 0.0,
        land: Land | None = None,
    ) -> None:
        self.shape = shape = (episodes, vessels)
        self.land = land
        """What is fixed, where a scenario asks for harbours."""
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
        self.buoy_radius = np.zeros((episodes, buoys))
        """[m] (E, M)"""
        self.scripted = np.zeros((episodes, scripted), complex)
        """[m] (E, T) Vessels that hold course and speed (`traffic.py`)."""
        self.scripted_velocity = np.zeros((episodes, scripted), complex)
        """[m/s] (E, T)"""
        self.scripted_radius = np.zeros((episodes, scripted))
        """[m] (E, T) Of the circle around each; 0 where there is none."""
        self.scripted_half = np.zeros((episodes, scripted, 2))
        """[m] (E, T, 2) Half of length and beam."""
        self.scripted_heading = np.zeros((episodes, scripted))
        """[rad] (E, T)"""
        self.scripted_turn = np.zeros((episodes, scripted))
        """[rad/s] (E, T) Change of course."""
        self.scripted_outlined = np.zeros((episodes, scripted), bool)
        """(E, T) Whether outlines are seen; else circles."""
        like = vessel or VesselParameters()
        self.radius = np.full(shape, like.radius)
        """[m] (E, V) Of the circles around the vessels."""
        self._half_share = np.array([like.length, like.width]) / np.hypot(like.length, like.width)
        self.thrust_min = np.full(shape, like.thrust_min_n)
        """[N] (E, V) Of each propeller."""
        self.told = np.empty((*shape, len(HULL_COLUMNS)), np.float32)
        """(E, V, 10) What the policies are told of their hulls (`HULL_COLUMNS`)."""
        self.told[:] = describe_hull(like, lag_s)
        self.drift = np.zeros(shape, complex)
        """[m/s] (E, V) Velocity of the water where each vessel is."""
        self.field = np.zeros((episodes, FIELD_COLUMNS))
        """(E, 12) Currents that vary from place to place or with time (`current_field`)."""
        self.range = np.full(episodes, np.nan)
        """[m] (E,) How far is seen; NaN: the environment's."""
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

    @property
    def half(self) -> Float64:
        """[m] (E, V, 2) Half of length and beam of the hulls, rectangles of the default's shape."""
        half: Float64 = self.radius[..., None] * self._half_share
        return half

    @property
    def aim(self) -> tuple[Points, Float64]:
        """(E, V) The goals that are shown [m], and what is left of the ways beyond them [m]."""
        if self.land is None:
            return self.goal, np.zeros(self.shape)
        return self.land.shown, self.land.beyond

    @property
    def way_left(self) -> Float64:
        """[m] (E, V) The distance to the goal along the way."""
        if self.land is None:
            return self.to_goal
        shown, beyond = self.aim
        left: Float64 = np.abs(shown - self.position) + beyond
        return left

    def take_aim(self, slots: Index) -> None:
        """Choose the goals that are shown in some slots, from where the vessels are now."""
        if self.land is not None:
            self.land.follow(slots, self.position, self.goal, self.active)

    @property
    def velocity(self) -> Points:
        """[m/s] (E, V) Over ground, of who is under way; 0 of the others."""
        through_water = (self.nu[0] + 1j * self.nu[1]) * np.exp(1j * self.heading)
        velocity: Points = (through_water + self.drift) * self.active
        return velocity

    def take_hulls(self, slots: Index, hulls: Hulls) -> None:
        """Give the vessels of some slots their hulls, and these slots their current."""
        self.radius[slots], self.thrust_min[slots] = hulls.radius, hulls.thrust_min
        self.told[slots], self.drift[slots] = hulls.told, hulls.current[:, None]

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
        self.buoy_radius[slots] = scenario.buoy_radius
        self.decisions[slots] = 0
        strangers = scenario.strangers
        if strangers is not None:
            self.scripted[slots] = strangers.place
            self.scripted_velocity[slots] = strangers.velocity
            self.scripted_half[slots] = strangers.half
            self.scripted_heading[slots] = strangers.heading
            self.scripted_radius[slots] = np.hypot(strangers.half[..., 0], strangers.half[..., 1])
            self.scripted_outlined[slots] = strangers.outlined
            self.scripted_turn[slots] = strangers.turn
            self.range[slots] = strangers.range_m

    def take_field(self, slots: Index, field: Float64, time_s: Float64) -> None:
        """Give some slots their currents, (n, 12), and the vessels there the water's velocity."""
        self.field[slots] = field
        self.drift[slots] = self.water(time_s)[slots]

    def water(self, time_s: Float64) -> Points:
        """Give the water's velocity where the vessels are, (E, V) [m/s], at times (E,) [s]."""
        places = np.stack([self.position.real, self.position.imag], axis=-1)
        velocity = current_field(self.field).velocity(places, time_s)
        flow: Points = velocity[..., 0] + 1j * velocity[..., 1]
        return flow

    def halt_others(self) -> None:
        """Stop who is not under way."""
        self.nu *= self.active
        self.thrust *= self.active


FIELD_COLUMNS = 12
"""[-] Mean (2), centre (2), shear, width, period, phase, one vortex (4) of a `CurrentField`."""


def current_field(columns: Float64) -> CurrentField:
    """Give currents of rows of numbers, (..., 12)."""
    mean, centre, vortex = columns[..., :2], columns[..., 2:4], columns[..., None, 8:]
    shear, width, period, phase = np.moveaxis(columns[..., 4:8], -1, 0)
    return CurrentField(mean, centre, shear, width, period, phase, vortex)


def field_columns(field: CurrentField) -> Float64:
    """Give a current as a row of numbers, (12,); it has one vortex or none."""
    vortex = field.vortex[0] if len(field.vortex) else np.array([0.0, 0.0, 1.0, 0.0])
    middle = (field.shear, field.width, field.period, field.phase)
    return np.concatenate([field.mean, field.centre, np.stack(middle), vortex])


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

    def assign(self, which: Index, values: Float64, twice: Mask | None = None) -> None:
        """Set some vessels' coefficients from their `physical` values, (10, n).

        `twice` (n,) tells in which Coriolis acts twice, whatever the environment's setting.
        """
        inertia = values[:3]
        m11, m22 = inertia[0], inertia[1]
        self.gain[:, which] = self.dt / inertia
        self.keep[:, which] = 1.0 - self.dt * values[3:6] / inertia
        self.drag[:, which] = self.dt * values[6:9] / inertia
        coriolis = self.dt * np.stack([m22, -m11, m11 - m22]) / inertia
        turning = self._turning
        if twice is not None and twice.any():
            turning = np.where(twice, self.dt * np.array([[1.0], [-1.0], [0.0]]), turning)
        self.coriolis[:, which] = coriolis + turning
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
        self._vessel = vessel
        self._acting = settings.forces
        other = settings.other_vessel
        self._varied = other is not None or settings.hulls_differ
        vessels = math.prod(shape) if self._varied else 1
        self.coefficients = Coefficients(vessel, substep_s, vessels, coriolis)
        self._follow: Float64 | None = None
        """[-] By what share thrust follows its command in a sub-step; None: at once."""
        self._gain: Float64 | None = None
        if settings.hulls_differ:
            self._follow, self._gain = np.ones(shape), np.ones((2, *shape))
        elif settings.thrust_lag_s > 0.0:
            self._follow = np.array(-math.expm1(-substep_s / settings.thrust_lag_s))
        self.wind = np.zeros(shape, complex)
        """[m/s] (E, V) Where it blows to, seen from the water."""
        self._gust_phase = np.zeros(shape)
        self._wave = np.zeros((3, *shape))  # [N, N, N m] amplitudes
        self._wave_phase = np.zeros((3, *shape))
        self.thrust = np.zeros((2, *shape))
        """[N] (2, E, V) As it is where it lags, not as it is commanded."""

    def begin(self, slots: Index, chance: Float64, hulls: Hulls | None = None) -> None:
        """Draw the conditions of new episodes from uniform numbers, (n, V + 1, chances)."""
        if not (self._varied or self._acting):
            return
        if hulls is None and self.settings.varied:
            hulls = draw_hulls(self.settings, self._vessel, chance)
        s, all_, each = self.settings, chance[:, -1], chance[:, :-1]
        speed = _between(s.wind_mps, all_[:, 0])
        self.wind[slots] = (speed * np.exp(2j * np.pi * all_[:, 1]))[:, None]
        if hulls is not None and hulls.current.any():  # over the water, which carries the vessels
            self.wind[slots] -= (hulls.current * (speed > 0.0))[:, None]
        self._gust_phase[slots] = 2 * np.pi * all_[:, 2, None]
        force, moment = _between(s.wave_force_n, all_[:, 3]), _between(s.wave_moment_nm, all_[:, 4])
        self._wave[:, slots] = np.stack([force, force, moment])[..., None]
        self._wave_phase[:, slots] = 2 * np.pi * np.moveaxis(each[..., :3], -1, 0)
        self.thrust[:, slots] = 0.0
        if self._varied and hulls is not None:
            which = (slots[:, None] * self.shape[1] + np.arange(self.shape[1])).ravel()
            values, twice = hulls.physical.reshape(10, -1), hulls.twice.reshape(-1)
            self.coefficients.assign(which, values, twice)
        if self._follow is not None and self._gain is not None and hulls is not None:
            self._follow[slots] = -np.expm1(-self._dt / np.maximum(hulls.lag, 1e-3))
            self._gain[:, slots] = hulls.gain

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
        if self._gain is not None:
            thrust = thrust * self._gain
        left, right = thrust.reshape(2, -1)
        tau = np.zeros((3, len(left)))
        np.add(left, right, out=tau[0])
        np.subtract(left, right, out=tau[2])
        tau[2] *= self.coefficients.lever
        return tau

    def _thrusters(self) -> Float64:
        """Let the thrust follow its command: first order."""
        if self._follow is None:
            return self._constant
        self.thrust += (self._command - self.thrust) * self._follow
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
        coriolis: Coriolis = "once",
    ) -> None:
        self._state, self._vessel, self._flows = state, vessel, bool(conditions.currents)
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
        np.clip(state.thrust, state.thrust_min, self._vessel.thrust_max_n, out=state.thrust)
        state.thrust *= state.active
        elapsed_s = state.decisions.astype(np.float64) * self._period
        self.forces.decide(state.thrust, state.heading, state.active, elapsed_s)
        self.motion.advance(
            state.north_east.reshape(2, -1),
            state.heading.reshape(-1),
            state.nu.reshape(3, -1),
            self.forces,
        )
        if self._flows or state.drift.any():
            self._drift()
        state.position.real, state.position.imag = state.north_east
        if self._flows:
            self._flow_on(elapsed_s + self._period)
        state.take_aim(np.arange(state.shape[0]))
        state.scripted += state.scripted_velocity * self._period
        if state.scripted_turn.any():
            turn = state.scripted_turn * self._period
            state.scripted_velocity *= np.exp(1j * turn)
            state.scripted_heading += turn

    def _drift(self) -> None:
        """Let the current carry who is under way: the motion so far was through the water."""
        state, motion = self._state, self.motion
        drift = state.drift * state.active
        times = self._substep * np.arange(len(motion.trajectory))
        carried = np.stack([drift.real, drift.imag]).reshape(2, -1)
        motion.trajectory += times[:, None, None] * carried
        state.north_east += (times[-1] * carried).reshape(state.north_east.shape)

    def _flow_on(self, time_s: Float64) -> None:
        """Take the vessels into the water where they are now: their way over ground stays."""
        state = self._state
        water = state.water(time_s)
        change = (water - state.drift) * np.exp(-1j * state.heading) * state.active
        state.nu[0] -= change.real
        state.nu[1] -= change.imag
        state.drift = water

    def grounded(self) -> tuple[Mask, Mask]:
        """Tell which vessels touched land, and which a fence, in the decision just made."""
        state, motion = self._state, self.motion
        if state.land is None:
            nobody = np.zeros(state.shape, bool)
            return nobody, nobody
        count = len(motion.trajectory)
        return state.land.touched(
            motion.trajectory.reshape(count, 2, *state.shape),
            motion.headings.reshape(count, *state.shape),
            strayed(motion.trajectory).reshape(state.shape),
            state.active,
            state.half,
        )

    def touched(self) -> tuple[Mask, Mask]:
        """Tell which vessels touched a vessel, and which a buoy, in the decision just made."""
        state, radius = self._state, self._state.radius
        flat = self.motion.trajectory
        trajectory = flat.reshape(len(flat), 2, *state.shape)
        far = strayed(flat).reshape(state.shape)
        vessel = between_vessels(trajectory, far, state.there, radius) & state.active
        if state.scripted.shape[1]:
            vessel |= self._with_scripted(trajectory, far)
        there, buoys = state.active, (state.buoy, state.buoy_there, state.buoy_radius)
        touched = with_buoys(trajectory, far, there, radius, *buoys)
        if state.land is not None and touched.any():
            touched &= self._touches_pile(trajectory, touched) | ~state.land.there[:, None]
        return vessel, touched

    def _touches_pile(self, trajectory: Float64, near: Mask) -> Mask:
        """Tell whose rectangle, of those near one, touched a buoy: narrow places need no circle."""
        state, touched = self._state, np.zeros(self._state.shape, bool)
        e, o = np.nonzero(near)
        headings = self.motion.headings.reshape(len(trajectory), *state.shape)[1:, e, o]
        own = trajectory[1:, 0, e, o] + 1j * trajectory[1:, 1, e, o]
        between = (state.buoy[e] - own[..., None]) * np.exp(-1j * headings)[..., None]
        gap = outside(between, state.half[e, o][:, None])
        hit = (gap < state.buoy_radius[e]) & state.buoy_there[e]
        touched[e, o] = hit.any(axis=(0, 2))
        return touched

    def _with_scripted(self, trajectory: Float64, far: Float64) -> Mask:
        """Tell whose circle, (E, V), touched a scripted vessel's rectangle."""
        state, touched = self._state, np.zeros(self._state.shape, bool)
        apart = np.abs(state.scripted[:, None] - state.position[..., None])
        reach = state.scripted_radius + np.abs(state.scripted_velocity) * self._period
        near = apart < reach[:, None] + (state.radius + 2 * far)[..., None]
        near &= state.active[..., None] & (state.scripted_radius > 0.0)[:, None]
        e, o, k = np.nonzero(near)
        if e.size:
            own = trajectory[1:, 0, e, o] + 1j * trajectory[1:, 1, e, o]
            times = self._substep * np.arange(1, len(own) + 1) - self._period
            theirs = state.scripted[e, k] + state.scripted_velocity[e, k] * times[:, None]
            gap = rectangle_gap(
                theirs - own, state.scripted_heading[e, k], state.scripted_half[e, k]
            )
            hit = gap.min(axis=0) < state.radius[e, o]
            touched[e[hit], o[hit]] = True
        return touched


def rectangle_gap(between: NDArray[np.complexfloating], heading: Float64, half: Float64) -> Float64:
    """Give the distance from points to rectangles [m]; 0 inside. All broadcast.

    Parameters
    ----------
    between : (...) complex
        [m] [N] From the point to the rectangle's centre.
    heading : (...) float
        [rad]
    half : (..., 2) float
        [m] Half of length and beam.
    """
    return outside(between * np.exp(-1j * heading), half)


def outside(place: NDArray[np.complexfloating], half: Float64) -> Float64:
    """Give the distance [m] of places, x + i y, from the rectangle that lies along these axes."""
    along = np.maximum(np.abs(place.real) - half[..., 0], 0.0)
    gap: Float64 = np.hypot(along, np.maximum(np.abs(place.imag) - half[..., 1], 0.0))
    return gap


# Contacts are checked at every sub-step. First a bound: two circles whose distance at the start
# exceeds their radii and the farthest that either strayed from there cannot have touched. The few
# pairs that are left are checked in full.


def strayed(trajectory: Float64) -> Float64:
    """Give the farthest, (N,) [m], that each vessel was from where it began; (S + 1, 2, N) in."""
    offset = trajectory[1:] - trajectory[0]
    offset *= offset
    farthest: Float64 = np.sqrt((offset[:, 0] + offset[:, 1]).max(axis=0))
    return farthest


def between_vessels(trajectory: Float64, strayed: Float64, there: Mask, radius: Float64) -> Mask:
    """Tell which vessels touched another one.

    Parameters
    ----------
    trajectory : (S + 1, 2, E, V) float64
        North, east [m] of V vessels in E episodes, before and after each of S sub-steps.
    strayed : (E, V) float64
        [m] Farthest from the first position.
    there : (E, V) bool
        Which of them are on the water.
    radius : (E, V) float64
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
        hit = _closest(offset) < radius[episode, i] + radius[episode, j]
        touched[episode[hit], i[hit]] = True
        touched[episode[hit], j[hit]] = True
    return touched


def with_buoys(
    trajectory: Float64,
    strayed: Float64,
    there: Mask,
    radius: Float64,
    buoy: Points,
    buoy_there: Mask,
    buoy_radius: Float64,
) -> Mask:
    """Tell which vessels touched a buoy; buoys (E, M), the rest as in `between_vessels`."""
    touched, buoy_radius = np.zeros(there.shape, bool), np.broadcast_to(buoy_radius, buoy.shape)
    if not buoy.shape[1]:
        return touched
    x, y = trajectory[0][..., None]
    north, east = x - buoy.real[:, None], y - buoy.imag[:, None]
    reach = (radius + strayed)[..., None] + buoy_radius[:, None]
    near = north * north + east * east < reach * reach
    near &= there[..., None] & buoy_there[:, None]
    episode, vessel, which = np.nonzero(near)
    if episode.size:
        centre = buoy[episode, which]
        offset = trajectory[1:, :, episode, vessel] - np.stack([centre.real, centre.imag])
        hit = _closest(offset) < radius[episode, vessel] + buoy_radius[episode, which]
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
