"""How vessels move: their mass, and the equations of motion, stepped for all vessels at once.

The equations are in hil_sim/native/vessel_step.cpp; docs/simulator.md explains them, and
tests/reference/vessel_step.py says the same in numpy.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from twinscrew.hil_sim._native import VesselModel
from twinscrew.hil_sim.sea.sea import Sea
from twinscrew.hil_sim.vessel.state import VesselState
from twinscrew.runtime.settings import NonNegative, Positive, Settings
from twinscrew.runtime.vessel_description import Part, VesselDescription, lift_per_area

Array = NDArray[np.float64]


class DynamicsSettings(Settings, frozen=True):
    """How the equations are used. The defaults are ours; `as_vrx` is VRX's way."""

    step_s: Positive = 0.01
    """[s] Step that the simulator's drivers take; VRX: 0.05."""
    wind_frame: Literal["body", "vrx_world_frame"] = "body"
    """Whose axes the wind coefficients belong to: the vessel's, or (VRX's quirk) the world's."""
    thrust_lag_s: NonNegative | None = None
    """[s] Time constant of the propellers; None: the vessel's (WAM-V, as VRX: 0)."""


def as_vrx() -> DynamicsSettings:
    """Give the settings with which VRX 2.3.2 runs."""
    return DynamicsSettings(step_s=0.05, wind_frame="vrx_world_frame")


class VesselDynamics:
    """Moves vessels of one kind. Holds no state: everything it needs comes as arguments."""

    def __init__(
        self, parameters: VesselDescription, settings: DynamicsSettings | None = None
    ) -> None:
        self.parameters = parameters
        self.settings = settings or DynamicsSettings()
        self._model = _native_model(parameters, self.settings)

    def step(
        self, state: VesselState, command_N: Array, sea: Sea, time_s: float, dt_s: float
    ) -> VesselState:
        """Move all vessels on by one step of semi-implicit Euler.

        Parameters
        ----------
        state : VesselState
            V vessels at `time_s`.
        command_N : (V, 2) float64
            Thrust commands [N], left and right; clipped to what the propellers can do.
        sea : Sea
            Waves, wind and current.
        time_s : float
            Time [s] since the sea was flat.
        dt_s : float
            Length of the step [s].

        Returns
        -------
        state : VesselState
            The vessels at `time_s + dt_s`.

        Raises
        ------
        ValueError
            A number is not finite, or the arrays do not have one row a vessel.
        """
        after = _blank(state.count)
        self._model.step(
            *_arrays(state), command_N, *_sea_at(sea, state, time_s), time_s, dt_s, *_arrays(after)
        )
        return after

    def acceleration(self, state: VesselState, sea: Sea, time_s: float) -> Array:
        """Give the accelerations, (V, 6) [m/s2, rad/s2], in B, relative to the water."""
        nu_dot = np.empty((state.count, 6))
        self._model.acceleration(*_arrays(state), *_sea_at(sea, state, time_s), time_s, nu_dot)
        return nu_dot


class FleetDynamics:
    """Moves vessels of several kinds: each kind by its own equations."""

    def __init__(
        self, vessels: Sequence[VesselDescription], settings: DynamicsSettings | None = None
    ) -> None:
        """Take each vessel's description, in the order of the state's rows."""
        kinds = list(dict.fromkeys(vessel.key for vessel in vessels))
        of = np.array([kinds.index(vessel.key) for vessel in vessels])
        self.kinds = tuple(
            (VesselDynamics(vessels[rows[0]], settings), rows)
            for rows in (np.flatnonzero(of == number) for number in range(len(kinds)))
        )
        """Each kind's equations, and which rows of the state are its."""

    def step(
        self, state: VesselState, command_N: Array, sea: Sea, time_s: float, dt_s: float
    ) -> VesselState:
        """See `VesselDynamics.step`."""
        if len(self.kinds) == 1:
            return self.kinds[0][0].step(state, command_N, sea, time_s, dt_s)
        after = _blank(state.count)
        for dynamics, rows in self.kinds:
            some = dynamics.step(_rows(state, rows), command_N[rows], sea, time_s, dt_s)
            for whole, part in zip(_arrays(after), _arrays(some), strict=True):
                whole[rows] = part
        return after


def _rows(state: VesselState, rows: NDArray[np.intp]) -> VesselState:
    position, attitude, velocity, rates, thrust = (array[rows] for array in _arrays(state))
    return VesselState(
        position_N=position, q_NB=attitude, velocity_B=velocity, rates_B=rates, thrust=thrust
    )


def _blank(count: int) -> VesselState:
    """Give a state whose arrays wait to be filled, laid out as the native code wants them."""
    return VesselState(
        position_N=np.empty((count, 3)),
        q_NB=np.empty((count, 4)),
        velocity_B=np.empty((count, 3)),
        rates_B=np.empty((count, 3)),
        thrust=np.empty((count, 2)),
    )


def _arrays(state: VesselState) -> tuple[Array, Array, Array, Array, Array]:
    return state.position_N, state.q_NB, state.velocity_B, state.rates_B, state.thrust


def _sea_at(sea: Sea, state: VesselState, time_s: float) -> tuple[Array, float, Array, Array]:
    current_N = sea.current(state.position_N[:, :2], time_s)
    return sea.wave_table, sea.wave_growth(time_s), sea.wind(time_s), current_N


def _native_model(parameters: VesselDescription, settings: DynamicsSettings) -> VesselModel:
    body = join(parameters.parts)
    mass = body.mass_matrix() + np.diag(parameters.added_mass)
    thrusters, windage = parameters.thrusters, parameters.windage
    lag_s = settings.thrust_lag_s
    lag_s = thrusters.time_constant_s if lag_s is None else lag_s
    return VesselModel(
        mass=mass,
        mass_inverse=np.asarray(np.linalg.inv(mass), dtype=np.float64),
        linear_drag=np.array(parameters.linear_drag),
        quadratic_drag=np.array(parameters.quadratic_drag),
        weight_n=body.mass * parameters.buoyancy.gravity_mps2,
        centre_B=body.centre_B,
        keel_B=parameters.buoyancy.points_B,
        hull_radius_m=parameters.buoyancy.hull_radius_m,
        lift_per_area=lift_per_area(parameters.buoyancy),
        propellers_B=thrusters.positions_B,
        thrust=np.array([thrusters.min_n, thrusters.max_n, lag_s, thrusters.slew_nps or np.inf]),
        windage=np.array([windage.along, windage.across, windage.yaw]),
        wind_world_frame=settings.wind_frame == "vrx_world_frame",
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class RigidBody:
    """Parts joined rigidly."""

    mass: float
    """[kg]"""
    centre_B: Array
    """[m] [B] (3,) Centre of gravity, from base_link."""
    inertia_B: Array
    """[kg m2] [B] (3, 3) About base_link."""

    def mass_matrix(self) -> Array:
        """Give M_RB about base_link, (6, 6)."""
        S = self.mass * skew(self.centre_B)
        return np.block([[self.mass * np.eye(3), -S], [S, self.inertia_B]])


def skew(a: Array) -> Array:
    """Give S(a), (3, 3), with S(a) b = a x b."""
    x, y, z = a
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def join(parts: Iterable[Part]) -> RigidBody:
    """Sum parts into one body; each inertia is moved to base_link by the parallel-axis theorem."""
    mass, moment, inertia = 0.0, np.zeros(3), np.zeros((3, 3))
    for part in parts:
        S = skew(part.position_B)
        mass += part.mass_kg
        moment += part.mass_kg * part.position_B
        # Parallel-axis theorem: I_b = I_g - m S(r) S(r).
        inertia += np.diag(part.inertia_kgm2) - part.mass_kg * S @ S
    return RigidBody(mass=mass, centre_B=moment / mass, inertia_B=inertia)
