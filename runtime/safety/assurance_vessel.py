"""The own vessel, as the assurance's prediction takes it to be: three degrees of freedom."""

from __future__ import annotations

import math
from typing import Annotated, NamedTuple

from msgspec import Meta

from twinscrew.runtime.settings import NonNegative, Positive, Settings

Circle = tuple[float, Positive]


class AssuranceVessel(Settings, frozen=True):
    """What is assumed of the own vessel: by default the WAM-V of config/vessels/wam_v.toml."""

    inertia: tuple[Positive, Positive, Positive] = (280.0, 280.0, 708.0)
    """[kg, kg, kg m2] In surge, sway and yaw, added mass included (docs/simulator.md)."""
    linear_drag: tuple[NonNegative, NonNegative, NonNegative] = (100.0, 100.0, 800.0)
    """[kg/s, kg/s, kg m2/s] In surge, sway and yaw, positive (parameters: VRX 2.3.2)."""
    quadratic_drag: tuple[NonNegative, NonNegative, NonNegative] = (150.0, 100.0, 800.0)
    """[kg/m, kg/m, kg m2] The same, of the square."""
    lever_m: Positive = 1.027
    """[m] From the centre line to a propeller."""
    hull: Annotated[tuple[Circle, ...], Meta(min_length=1)] = ((0.0, 2.8),)
    """[m] Circles that cover the hull: how far ahead of the origin, radius (paper: one, 2.8 m)."""

    @property
    def extent_m(self) -> float:
        """[m] No part of the hull is farther from the origin."""
        return max(abs(ahead) + radius for ahead, radius in self.hull)

    def top_speed_mps(self, thrust_n: float) -> float:
        """[m/s] Straight ahead with this thrust of each propeller [N]: drag equals thrust."""
        linear, quadratic = self.linear_drag[0], self.quadratic_drag[0]
        if quadratic == 0.0:
            return 2.0 * thrust_n / linear if linear else math.inf
        root = math.sqrt(linear * linear + 8.0 * quadratic * thrust_n)
        return (root - linear) / (2.0 * quadratic)


class Motion(NamedTuple):
    """How the vessel moves now, over ground, in its levelled frame."""

    surge: float
    """[m/s]"""
    sway: float
    """[m/s]"""
    yaw_rate: float
    """[rad/s]"""


Thrust = tuple[float, float]
"""[N] Of the left and the right propeller."""

Push = tuple[float, float]
"""[N] x and y of a force that is not of the propellers, as of wind or current."""
STILL: Push = (0.0, 0.0)


def slewed(thrust: Thrust, wanted: Thrust, step_n: float) -> Thrust:
    """Change each thrust by at most a step [N] towards what is wanted."""
    return (
        thrust[0] + min(max(wanted[0] - thrust[0], -step_n), step_n),
        thrust[1] + min(max(wanted[1] - thrust[1], -step_n), step_n),
    )
