"""Where a vessel floats when nothing disturbs it: its draught and trim on still water."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from twinscrew.hil_sim.sea.sea import Sea, SeaSettings, WaveSettings, WindSettings
from twinscrew.hil_sim.vessel.dynamics import FleetDynamics, VesselDynamics
from twinscrew.hil_sim.vessel.state import VesselState, level_quaternion
from twinscrew.runtime.errors import ConfigError

Array = NDArray[np.float64]

HEAVE, PITCH = 2, 4
"""Rows of the two motions that have a weight or a moment to balance."""
NUDGE = 1e-6
"""[m, rad] Step of the finite differences."""
TOLERANCE = 1e-10
"""[m/s2, rad/s2] Acceleration that counts as none."""
ITERATIONS = 50
"""[-] Newton needs about 6."""


def still_water() -> Sea:
    """Give a sea without waves, wind and current."""
    settings = SeaSettings(waves=WaveSettings(gain=0.0), wind=WindSettings(mean_mps=0.0))
    return Sea(settings, np.random.default_rng(0))


def at_rest(dynamics: VesselDynamics, places_N: Array, headings: Array) -> VesselState:
    """Put vessels on still water, without motion and thrust, in equilibrium.

    Parameters
    ----------
    dynamics : VesselDynamics
        Whose parameters decide the equilibrium.
    places_N : (V, 2) float64
        North, east [m].
    headings : (V,) float64
        Headings [rad], clockwise from north.

    Raises
    ------
    ConfigError
        The vessel has no equilibrium upright.
    """
    down, pitch = equilibrium(dynamics)
    count = len(places_N)
    return VesselState(
        position_N=np.column_stack([places_N, np.full(count, down)]),
        q_NB=level_quaternion(headings, pitch),
        velocity_B=np.zeros((count, 3)),
        rates_B=np.zeros((count, 3)),
        thrust=np.zeros((count, 2)),
    )


def fleet_at_rest(fleet: FleetDynamics, places_N: Array, headings: Array) -> VesselState:
    """Put vessels of several kinds on still water; see `at_rest`."""
    if len(fleet.kinds) == 1:
        return at_rest(fleet.kinds[0][0], places_N, headings)
    count = len(places_N)
    state = VesselState(
        position_N=np.zeros((count, 3)),
        q_NB=np.zeros((count, 4)),
        velocity_B=np.zeros((count, 3)),
        rates_B=np.zeros((count, 3)),
        thrust=np.zeros((count, 2)),
    )
    for dynamics, rows in fleet.kinds:
        kind = at_rest(dynamics, places_N[rows], headings[rows])
        state.position_N[rows], state.q_NB[rows] = kind.position_N, kind.q_NB
    return state


def equilibrium(dynamics: VesselDynamics) -> tuple[float, float]:
    """Find by Newton's method the down coordinate [m] and pitch [rad] without acceleration."""
    water = still_water()
    x = np.array([0.5 * dynamics.parameters.buoyancy.hull_radius_m, 0.0])
    for _ in range(ITERATIONS):
        # One batch: the guess, and the guess nudged in either unknown.
        a = _unbalanced(dynamics, x + NUDGE * np.array([[0, 0], [1, 0], [0, 1]]), water)
        if np.all(np.abs(a[0]) < TOLERANCE):
            return float(x[0]), float(x[1])
        slope = ((a[1:] - a[0]) / NUDGE).T
        if np.linalg.matrix_rank(slope) < 2:  # out of the water, or as deep as the model goes
            break
        x = x - np.linalg.solve(slope, a[0])
    raise ConfigError("the vessel finds no equilibrium on still water")


def _unbalanced(dynamics: VesselDynamics, x: Array, water: Sea) -> Array:
    """Give the heave and pitch accelerations, (K, 2), at (down, pitch), (K, 2)."""
    still = np.zeros((len(x), 3))
    state = VesselState(
        position_N=np.column_stack([still[:, :2], x[:, 0]]),
        q_NB=np.column_stack([np.cos(x[:, 1] / 2), still[:, 0], np.sin(x[:, 1] / 2), still[:, 0]]),
        velocity_B=still,
        rates_B=still,
        thrust=np.zeros((len(x), 2)),
    )
    return dynamics.acceleration(state, water, 0.0)[:, [HEAVE, PITCH]]
