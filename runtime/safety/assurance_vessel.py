"""Where the vessel goes: the assurance's own prediction, in three degrees of freedom.

The equations of `policy.vessel_model` (Fossen (2021), chapters 3 and 6), written for one vessel
in plain numbers: some forty steps take less than numpy needs for two. A test compares the two.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Annotated, NamedTuple

import numpy as np
from msgspec import Meta

from twinscrew.runtime.messages.types import Float64
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

Law = Callable[[float, float], Thrust]
"""What a manoeuvre wants of the propellers, by the time from now [s] and the surge then [m/s]."""


def slewed(thrust: Thrust, wanted: Thrust, step_n: float) -> Thrust:
    """Change each thrust by at most a step [N] towards what is wanted."""
    return (
        thrust[0] + min(max(wanted[0] - thrust[0], -step_n), step_n),
        thrust[1] + min(max(wanted[1] - thrust[1], -step_n), step_n),
    )


def predict(
    vessel: AssuranceVessel,
    motion: Motion,
    thrust: Thrust,
    law: Law,
    *,
    steps: int,
    dt: float,
    slew_nps: float,
) -> Float64:
    """Sail a manoeuvre: Euler steps of the velocity, trapezoids of the position.

    Parameters
    ----------
    motion, thrust
        How the vessel moves, and what its propellers give, now.
    law
        The manoeuvre.
    steps : int
        Number of time steps T.
    dt : float
        Their length [s].
    slew_nps : float
        How fast each thrust may change [N/s].

    Returns
    -------
    path : (T + 1, 3) float64
        x, y [m], heading [rad], from now on, in the vessel's present levelled frame.
    """
    (m11, m22, m66), lever = vessel.inertia, vessel.lever_m
    (x_u, y_v, n_r), (x_uu, y_vv, n_rr) = vessel.linear_drag, vessel.quadratic_drag
    u, v, r = motion
    x = y = heading = 0.0
    path = [(x, y, heading)]
    for step in range(steps):
        wanted = law(step * dt, u)
        if wanted != thrust:
            thrust = slewed(thrust, wanted, slew_nps * dt)
        left, right = thrust
        surge = left + right + m22 * v * r - (x_u + x_uu * abs(u)) * u
        sway = -m11 * u * r - (y_v + y_vv * abs(v)) * v
        yaw = (left - right) * lever + (m11 - m22) * u * v - (n_r + n_rr * abs(r)) * r
        # The mean of the velocities before and after: the new ones alone would brake too well.
        du, dv, dr = dt * surge / m11, dt * sway / m22, dt * yaw / m66
        ahead, across, turn = u + du / 2.0, v + dv / 2.0, dt * (r + dr / 2.0)
        cosine, sine = math.cos(heading + turn / 2.0), math.sin(heading + turn / 2.0)
        x += dt * (cosine * ahead - sine * across)
        y += dt * (sine * ahead + cosine * across)
        u, v, r, heading = u + du, v + dv, r + dr, heading + turn
        path.append((x, y, heading))
    return np.array(path)
