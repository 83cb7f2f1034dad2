"""The physics of a decision: thrust, motion through the sub-steps, and who touched whom."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from twinscrew.runtime.messages.types import Float64
from twinscrew.training import contacts
from twinscrew.training.conditions import Conditions
from twinscrew.training.dynamics import Dynamics
from twinscrew.training.environment_settings import RATE_LIMIT, EnvironmentSettings
from twinscrew.training.vessel_state import Mask, State


class Sailing:
    """Moves the vessels of a state; remembers the conditions of each episode."""

    def __init__(self, settings: EnvironmentSettings, state: State) -> None:
        self._settings, self._state = settings, state
        shape = state.shape
        self.conditions = Conditions(
            settings.conditions, settings.vessel, shape, settings.substep_s
        )
        vessels = shape[0] * shape[1]
        self.dynamics = Dynamics(self.conditions.coefficients, vessels, settings.substeps)

    def begin(self, slots: NDArray[np.intp], chance: Float64) -> None:
        """Draw the conditions of new episodes from uniform numbers, (n, V + 1, CHANCES)."""
        self.conditions.begin(slots, chance)

    def move(self, action: NDArray[np.floating]) -> None:
        """Change the thrusts and sail through the sub-steps of a decision.

        Parameters
        ----------
        action : (E, V, 2) float
            As for `VectorEnv.step`.
        """
        state = self._state
        self._command(action)
        elapsed_s = state.decisions.astype(np.float64) * self._settings.period_s
        self.conditions.decide(state.thrust, state.heading, state.active, elapsed_s)
        self.dynamics.advance(
            state.north_east.reshape(2, -1),
            state.heading.reshape(-1),
            state.nu.reshape(3, -1),
            self.conditions.force,
        )
        state.position.real, state.position.imag = state.north_east

    def touched(self) -> tuple[Mask, Mask]:
        """Tell which vessels touched a vessel, and which a buoy, in the decision just sailed."""
        state, radius = self._state, self._settings.vessel.radius
        flat = self.dynamics.trajectory
        trajectory = flat.reshape(len(flat), 2, *state.shape)
        strayed = contacts.strayed(flat).reshape(state.shape)
        vessel = contacts.between_vessels(trajectory, strayed, state.there, radius) & state.active
        buoy = contacts.with_buoys(
            trajectory,
            strayed,
            state.active,
            radius,
            state.buoy,
            state.buoy_there,
            self._settings.map.buoy_radius_m,
        )
        return vessel, buoy

    def _command(self, action: NDArray[np.floating]) -> None:
        vessel, thrust = self._settings.vessel, self._state.thrust
        rate = np.clip(np.asarray(action, np.float64), -1.0, 1.0) * RATE_LIMIT
        thrust += rate.transpose(2, 0, 1) * self._settings.period_s
        np.clip(thrust, vessel.thrust_min_n, vessel.thrust_max_n, out=thrust)
        thrust *= self._state.active
