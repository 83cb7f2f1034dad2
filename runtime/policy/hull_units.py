"""A hull's own units: what makes one set of numbers serve every hull.

Boats of different size behave alike when lengths are counted in hull lengths, times in length over
top speed, and forces in greatest thrusts (Froude's scaling, where mass and drag scale too). The
planners' numbers are tuned for the default vessel; in units they serve every hull.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from twinscrew.runtime.messages.types import Float64
from twinscrew.runtime.policy.vessel_model import VesselParameters
from twinscrew.runtime.vessel_description import PlaneModel, VesselDescription


class HullUnits(NamedTuple):
    """A hull's own units of length, time and force, as factors of another hull's."""

    length: float
    time: float
    force: float

    @property
    def speed(self) -> float:
        """Factor of speeds."""
        return self.length / self.time


LEAST_TIME = 0.4
"""[-] Times shrink no further: a decision period of 0.5 s becomes 0.2 s, two scans at 10 Hz."""


def units_of(vessel: VesselDescription, reference: VesselDescription) -> HullUnits:
    """Give a vessel's units, as factors of a reference's.

    Length over top speed is the unit of time, greatest thrust that of force. A small, fast hull
    counts as longer than it is, so that its time is at least `LEAST_TIME`.
    """
    speed = vessel.top_speed_mps / reference.top_speed_mps
    time = max(vessel.length_m / reference.length_m / speed, LEAST_TIME)
    return HullUnits(time * speed, time, vessel.thrusters.max_n / reference.thrusters.max_n)


def in_units(plane: PlaneModel, units: HullUnits) -> VesselParameters:
    """Give the model's numbers in other units; angles have none, so the motion is the same."""
    length, time, force = units
    mass = force * time**2 / length
    linear, quadratic = force * time / length, force * time**2 / length**2
    square, spacing = length**2, plane.thruster_spacing_m
    return VesselParameters(
        mass_kg=plane.mass_kg / mass,
        izz=plane.izz / (mass * square),
        x_udot=plane.x_udot / mass,
        y_vdot=plane.y_vdot / mass,
        n_rdot=plane.n_rdot / (mass * square),
        x_u=plane.x_u / linear,
        y_v=plane.y_v / linear,
        n_r=plane.n_r / (linear * square),
        x_uu=plane.x_uu / quadratic,
        y_vv=plane.y_vv / quadratic,
        n_rr=plane.n_rr / (mass * square),
        length=plane.length / length,
        width=plane.width / length,
        thrust_min_n=plane.thrust_min_n / force,
        thrust_max_n=plane.thrust_max_n / force,
        thruster_spacing_m=None if spacing is None else spacing / length,
    )


HULL_COLUMNS = (
    "radius",
    "top_speed",
    "astern_speed",
    "acceleration",
    "turn_rate",
    "turn_acceleration",
    "sway_damping",
    "mass_ratio",
    "thrust_lag",
    "thrust_min",
)
"""What a policy is told of the hull that it drives, in this order:

radius [m] of the circle that holds it; steady speed at full thrust ahead, and astern [m/s];
acceleration from rest at full thrust [m/s2]; steady yaw rate [rad/s] and yaw acceleration from rest
[rad/s2] with one propeller full ahead and one full astern; sway damping over mass at 1 m/s [1/s];
mass with added mass in surge over that in sway [-]; time constant of the thrust [s]; least thrust
of a propeller [N]. In the hull's own units, as everything that a policy sees (`units_of`).
"""
HULL_UNITS = ("m", "m/s", "m/s", "m/s2", "rad/s", "rad/s2", "1/s", "-", "s", "N")


def hull_columns(
    inertia: Float64,
    linear: Float64,
    quadratic: Float64,
    moment_arm: Float64,
    radius: Float64,
    limits: tuple[Float64, Float64],
    lag: Float64,
) -> Float64:
    """Give what a policy is told of hulls, (..., 10), as `HULL_COLUMNS` says.

    Parameters
    ----------
    inertia, linear, quadratic : (3, ...) float64
        [kg, kg, kg m2], [kg/s, kg/s, kg m2/s], [kg/m, kg/m, kg m2] With added mass; drag positive.
    moment_arm, radius : (...) float64
        [m] From the centre line to a thruster; of the circle that holds the hull.
    limits : two of (...) float64
        [N] Least and greatest thrust of a propeller.
    lag : (...) float64
        [s] Time constant with which thrust follows its command.
    """
    low, high = limits
    moment = (high - low) * moment_arm
    sway = (linear[1] + quadratic[1]) / inertia[1]
    return np.stack(
        [
            radius,
            _steady(2 * high, linear[0], quadratic[0]),
            _steady(-2 * low, linear[0], quadratic[0]),
            2 * high / inertia[0],
            _steady(moment, linear[2], quadratic[2]),
            moment / inertia[2],
            sway,
            inertia[0] / inertia[1],
            lag,
            low,
        ],
        axis=-1,
    )


def _steady(force: Float64, linear: Float64, quadratic: Float64) -> Float64:
    """Give the speed at which drag equals a force: the positive root of linear u + quadratic u2."""
    return 2 * force / (linear + np.sqrt(linear**2 + 4 * quadratic * force))


def describe_hull(p: VesselParameters, lag_s: float = 0.0) -> Float64:
    """Give what a policy is told of a vessel, (10,), as `HULL_COLUMNS` says."""
    return hull_columns(
        np.array(p.inertia),
        np.array(p.linear_drag),
        np.array(p.quadratic_drag),
        np.array(p.lever),
        np.array(p.radius),
        (np.array(p.thrust_min_n), np.array(p.thrust_max_n)),
        np.array(lag_s),
    )
