"""How vessels move: the equations of motion, stepped for all vessels at once."""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import NDArray

from twinscrew.hil_sim.sea.sea import Sea
from twinscrew.hil_sim.vessel import step as equations
from twinscrew.hil_sim.vessel.parameters import VesselParameters
from twinscrew.hil_sim.vessel.state import VesselState
from twinscrew.runtime.settings import NonNegative, Positive, Settings

Array = NDArray[np.float64]


class DynamicsSettings(Settings):
    """How the equations are used. The defaults are ours, `as_vrx` is VRX's way."""

    step_s: Positive = 0.01
    """[s] Fixed step of the integrator; VRX: 0.05."""
    wind_frame: Literal["body", "vrx_world_frame"] = "body"
    """Whose axes the wind coefficients belong to: the vessel's, or (VRX's quirk) the world's."""
    thrust_lag_s: NonNegative = 0.0
    """[s] Time constant of the propellers; VRX: none."""


def as_vrx() -> DynamicsSettings:
    """Give the settings with which VRX runs."""
    return DynamicsSettings(step_s=0.05, wind_frame="vrx_world_frame")


class VesselDynamics:
    """Moves vessels of one kind. Holds no state: everything it needs comes as arguments."""

    def __init__(
        self, parameters: VesselParameters, settings: DynamicsSettings | None = None
    ) -> None:
        self.parameters = parameters
        self.settings = settings or DynamicsSettings()

    def step(
        self, state: VesselState, command_N: Array, sea: Sea, time_s: float, dt_s: float
    ) -> VesselState:
        """Move all vessels on by one step.

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
        """
        return equations.step(
            self.parameters,
            state,
            command_N,
            sea,
            time_s,
            dt_s,
            lag_s=self.settings.thrust_lag_s,
            world_frame=self.settings.wind_frame == "vrx_world_frame",
        )
