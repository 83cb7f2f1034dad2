"""The vessel in three degrees of freedom: surge, sway and yaw, for any number of vessels at once.

Rigid body, added mass, Coriolis and linear and quadratic damping, driven by two thrusters:
paper, eq. (12); Fossen (2021), chapters 3 and 6. The matrices follow from Fossen with the centre of
gravity at the origin and a diagonal M = M_RB + M_A = diag(m - Xudot, m - Yvdot, Iz - Nrdot)::

    C(nu) nu = (-m22 v r,  m11 u r,  (m22 - m11) u v)      Fossen (2021), eqs. 3.63 and 6.54
    D(nu) nu = -(X_u + X_uu |u|, Y_v + Y_vv |v|, N_r + N_rr |r|) (.) nu
    tau      = (T_left + T_right, 0, (T_left - T_right) spacing / 2)
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from msgspec import Meta

from twinscrew.runtime.errors import ConfigError
from twinscrew.runtime.messages.types import Float64
from twinscrew.runtime.settings import Positive
from twinscrew.runtime.vessel_description import PlaneModel, load_vessel

Damping = Annotated[float, Meta(le=0.0)]
_DEFAULT = load_vessel().plane


class VesselParameters(PlaneModel, frozen=True):
    """One vessel's numbers, with Fossen's signs; the defaults are the default vessel's.

    `length`, `width` are overall; the thrusters stand half of `thruster_spacing_m` (where there is
    none: of the width) from the centre line.
    """

    mass_kg: Positive = _DEFAULT.mass_kg
    """[kg] Loaded."""
    izz: Positive = _DEFAULT.izz
    """[kg m2] Moment of inertia in yaw."""
    x_udot: float = _DEFAULT.x_udot
    """[kg] Added mass in surge, negative (the paper's is positive, which is unphysical)."""
    y_vdot: float = _DEFAULT.y_vdot
    """[kg] Added mass in sway."""
    n_rdot: float = _DEFAULT.n_rdot
    """[kg m2] Added inertia in yaw."""
    x_u: Damping = _DEFAULT.x_u
    """[kg/s] Linear damping in surge."""
    y_v: Damping = _DEFAULT.y_v
    """[kg/s] Linear damping in sway."""
    n_r: Damping = _DEFAULT.n_r
    """[kg m2/s] Linear damping in yaw."""
    x_uu: Damping = _DEFAULT.x_uu
    """[kg/m] Quadratic damping in surge."""
    y_vv: Damping = _DEFAULT.y_vv
    """[kg/m] Quadratic damping in sway."""
    n_rr: Damping = _DEFAULT.n_rr
    """[kg m2] Quadratic damping in yaw."""
    length: Positive = _DEFAULT.length
    """[m] Overall."""
    width: Positive = _DEFAULT.width
    """[m] Overall."""
    thrust_min_n: float = _DEFAULT.thrust_min_n
    """[N] Of each thruster."""
    thrust_max_n: float = _DEFAULT.thrust_max_n
    """[N] Of each thruster."""
    thruster_spacing_m: Positive | None = _DEFAULT.thruster_spacing_m
    """[m] Between the thrusters; None: the width."""

    def __post_init__(self) -> None:
        """Refuse what cannot float: an inertia that is not positive, an empty range of thrust."""
        if min(self.inertia) <= 0.0:
            raise ConfigError(f"the inertia with added mass must be positive, got {self.inertia}")
        if self.thrust_min_n >= self.thrust_max_n:
            raise ConfigError(
                f"must be below thrust_max_n {self.thrust_max_n}, got {self.thrust_min_n}",
                key="thrust_min_n",
            )

    @property
    def inertia(self) -> tuple[float, float, float]:
        """[kg, kg, kg m2] The diagonal of M_RB + M_A."""
        return self.mass_kg - self.x_udot, self.mass_kg - self.y_vdot, self.izz - self.n_rdot

    @property
    def linear_drag(self) -> tuple[float, float, float]:
        """[kg/s, kg/s, kg m2/s] The diagonal of the linear damping matrix."""
        return -self.x_u, -self.y_v, -self.n_r

    @property
    def quadratic_drag(self) -> tuple[float, float, float]:
        """[kg/m, kg/m, kg m2] The factors of |nu| in the damping matrix."""
        return -self.x_uu, -self.y_vv, -self.n_rr

    @property
    def coriolis(self) -> tuple[float, float, float]:
        """[kg] The factors of v r, u r, u v in -C(nu) nu."""
        m11, m22, _ = self.inertia
        return m22, -m11, m11 - m22

    @property
    def lever(self) -> float:
        """[m] From the centre line to a thruster."""
        return (self.thruster_spacing_m or self.width) / 2

    @property
    def radius(self) -> float:
        """[m] Of the circle that holds the vessel."""
        return math.hypot(self.length, self.width) / 2

    @property
    def top_speed(self) -> float:
        """[m/s] Straight ahead at full thrust, where X_u u + X_uu u^2 = 2 T_max."""
        force, linear, quadratic = 2 * self.thrust_max_n, -self.x_u, -self.x_uu
        drag = linear + math.sqrt(linear**2 + 4 * quadratic * force)
        return 2 * force / drag if drag else math.inf

    @property
    def turn_rate(self) -> float:
        """[rad/s] On the spot, one propeller full ahead and the other full astern."""
        moment = (self.thrust_max_n - self.thrust_min_n) * self.lever
        drag = -self.n_r + math.sqrt(self.n_r**2 - 4 * self.n_rr * moment)
        return 2 * moment / drag if drag else math.inf


class VesselModel:
    """The equations of motion; pure, every argument may have any leading batch dimensions."""

    def __init__(self, parameters: VesselParameters | None = None) -> None:
        self.parameters = parameters or VesselParameters()
        self._inertia = np.array(self.parameters.inertia)
        self._linear = np.array(self.parameters.linear_drag)
        self._quadratic = np.array(self.parameters.quadratic_drag)
        self._coriolis = np.array(self.parameters.coriolis)
        lever = self.parameters.lever
        self._thrusters = np.array([[1.0, 0.0, lever], [1.0, 0.0, -lever]])

    def force(self, thrust: Float64) -> Float64:
        """Give the force tau of the thrusters.

        Parameters
        ----------
        thrust : (..., 2) float64
            Left, right [N].

        Returns
        -------
        tau : (..., 3) float64
            Surge, sway force [N] and yaw moment [N m, clockwise positive], frame B.
        """
        tau: Float64 = np.asarray(thrust) @ self._thrusters
        return tau

    def acceleration(self, nu: Float64, tau: Float64) -> Float64:
        """Give nu's rate of change, (..., 3) [m/s2, m/s2, rad/s2].

        Parameters
        ----------
        nu : (..., 3) float64
            Surge, sway [m/s], yaw rate [rad/s]; over ground and through the water alike.
        tau : (..., 3) float64
            All forces on the hull but the water's [N, N, N m], frame B.
        """
        products = nu[..., _FIRST] * nu[..., _SECOND]  # v r, u r, u v
        damping = (self._linear + self._quadratic * np.abs(nu)) * nu
        rate: Float64 = (tau + self._coriolis * products - damping) / self._inertia
        return rate

    def step(
        self, pose: Float64, nu: Float64, thrust: Float64, dt: float, tau: Float64 | None = None
    ) -> tuple[Float64, Float64]:
        """Move by one time step: semi-implicit Euler, velocity first (Fossen (2021), app. B.1).

        Parameters
        ----------
        pose : (..., 3) float64
            North, east [m], heading [rad, clockwise].
        nu : (..., 3) float64
            Surge, sway [m/s], yaw rate [rad/s].
        thrust : (..., 2) float64
            Left, right [N].
        dt : float
            [s] The reference uses 0.05.
        tau : (..., 3) float64, optional
            Further forces on the hull (wind, waves) [N, N, N m], frame B.

        Returns
        -------
        pose, nu : (..., 3) float64
            After the step; the heading is not wrapped.
        """
        force = self.force(thrust)
        nu = nu + dt * self.acceleration(nu, force if tau is None else force + tau)
        cosine, sine = np.cos(pose[..., 2]), np.sin(pose[..., 2])
        surge, sway = nu[..., 0], nu[..., 1]
        rate = np.stack(
            [cosine * surge - sine * sway, sine * surge + cosine * sway, nu[..., 2]], axis=-1
        )
        return pose + dt * rate, nu

    def apply(self, thrust: Float64, rate: Float64, period: float) -> Float64:
        """Give the thrust command after a rate [N/s] has acted for a period [s], within limits."""
        limits = self.parameters.thrust_min_n, self.parameters.thrust_max_n
        clipped: Float64 = np.clip(thrust + rate * period, *limits)
        return clipped


_FIRST = np.array([1, 0, 0])
_SECOND = np.array([2, 2, 1])


# -- What the vessel would do: the paper's 25 actions, simulated at once from the present state.

LEVELS = (-1000.0, -500.0, 0.0, 500.0, 1000.0)
"""[N/s] The action set A of each propeller (paper, sec. V-B)."""


def action_set() -> Float64:
    """Give the 25 actions, (25, 2) [N/s], the gentlest first: it wins where costs are equal."""
    left, right = np.meshgrid(LEVELS, LEVELS, indexing="ij")
    actions = np.column_stack([left.ravel(), right.ravel()])
    return actions[np.argsort(np.abs(actions).sum(axis=1), kind="stable")]


@dataclass(frozen=True, slots=True)
class Rollout:
    """K actions, each held for T control steps, in the present frame B."""

    pose: Float64
    """(T, K, 3) x, y [m], heading [rad] relative to now, at the end of each step."""
    nu: Float64
    """(T, K, 3) Surge, sway [m/s], yaw rate [rad/s] in the vessel's frame then."""
    thrust: Float64
    """(T, K, 2) [N] Left, right, during each step."""

    @property
    def velocity(self) -> Float64:
        """[m/s] (T, K, 2) Velocities in the present frame B."""
        cosine, sine = np.cos(self.pose[..., 2]), np.sin(self.pose[..., 2])
        surge, sway = self.nu[..., 0], self.nu[..., 1]
        return np.stack([cosine * surge - sine * sway, sine * surge + cosine * sway], axis=-1)


def rollout(
    model: VesselModel, ego: Float64, actions: Float64, *, steps: int, step_s: float, dt: float
) -> Rollout:
    """Simulate actions that are repeated every control step.

    Parameters
    ----------
    model
        The vessel.
    ego : (7,) float
        The ego state of an `Observation`.
    actions : (K, 2) float64
        Thrust rates [N/s].
    steps : int
        Number of control steps T.
    step_s : float
        Length of a control step [s].
    dt : float
        Longest time step of the integration [s].
    """
    count, substeps = len(actions), max(1, int(np.ceil(step_s / dt - 1e-9)))
    pose, nu = np.zeros((count, 3)), np.tile(np.asarray(ego[2:5], dtype=np.float64), (count, 1))
    thrust = np.tile(np.asarray(ego[5:7], dtype=np.float64), (count, 1))
    poses, nus = np.empty((steps, count, 3)), np.empty((steps, count, 3))
    thrusts = np.empty((steps, count, 2))
    for step in range(steps):
        thrust = model.apply(thrust, actions, step_s)
        for _ in range(substeps):
            pose, nu = model.step(pose, nu, thrust, step_s / substeps)
        poses[step], nus[step], thrusts[step] = pose, nu, thrust
    return Rollout(pose=poses, nu=nus, thrust=thrusts)


def alignment(heading: Float64, velocity: Float64, direction: Float64) -> tuple[Float64, Float64]:
    """Give how far headings are off a direction, and the speed made good along it.

    Parameters
    ----------
    heading : (...) float64
        [rad]
    velocity : (..., 2) float64
        [m/s] In the frame of the direction.
    direction : (..., 2) float64
        Of any length; straight ahead where it is zero.

    Returns
    -------
    angle : (...) float64
        [rad] In [0, pi].
    speed : (...) float64
        [m/s]
    """
    length = np.hypot(direction[..., 0], direction[..., 1])[..., None]
    unit = np.where(length > 0.0, direction / np.where(length > 0.0, length, 1.0), _AHEAD)
    difference = heading - np.arctan2(unit[..., 1], unit[..., 0])
    angle: Float64 = np.abs(np.remainder(difference + np.pi, 2 * np.pi) - np.pi)
    speed: Float64 = (velocity * unit).sum(axis=-1)
    return angle, speed


_AHEAD = np.array([1.0, 0.0])
