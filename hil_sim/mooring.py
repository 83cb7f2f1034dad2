"""Holding a vessel on station: a critically damped spring to its mooring, at the water surface.

The simulator, not the vessel's own propellers, holds a vessel that has arrived, as if a crew took
it over. It still heaves, rolls and pitches, is blown off a little, and is seen and can be hit.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from twinscrew.hil_sim.vessel.state import VesselState
from twinscrew.runtime.geometry import wrap
from twinscrew.runtime.messages.types import Float64


def moor(
    state: VesselState,
    R_NB: Float64,
    moored: NDArray[np.bool_],
    mooring_N: Float64,
    frequency: float,
    dt_s: float,
) -> VesselState:
    """Pull moored vessels to their moorings for one step, by changing their velocity.

    In north, east and heading the acceleration is -w^2 (x - x_mooring) - 2 w v; the damping is
    taken at the step's end (implicit Euler), so that no step is too long.

    Parameters
    ----------
    state : VesselState
        V vessels after the step's physics.
    R_NB : (V, 3, 3) float64
        Their attitudes.
    moored : (V,) bool
        Which are held.
    mooring_N : (V, 3) float64
        Where: north, east [m], heading [rad].
    frequency : float
        w [rad/s].
    dt_s : float
        The step's length [s].
    """
    stiffness, kept = frequency**2 * dt_s, 1.0 / (1.0 + 2.0 * frequency * dt_s)
    offset = state.position_N[moored, :2] - mooring_N[moored, :2]
    turned = wrap(state.heading[moored] - mooring_N[moored, 2])
    velocity_N = np.einsum("vij,vj->vi", R_NB[moored], state.velocity_B[moored])
    velocity_N[:, :2] = (velocity_N[:, :2] - stiffness * offset) * kept
    velocity_B, rates_B = state.velocity_B.copy(), state.rates_B.copy()
    velocity_B[moored] = np.einsum("vij,vi->vj", R_NB[moored], velocity_N)
    rates_B[moored, 2] = (rates_B[moored, 2] - stiffness * turned) * kept
    return replace(state, velocity_B=velocity_B, rates_B=rates_B)
