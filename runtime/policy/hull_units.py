"""A hull's own units: what makes one set of numbers serve every hull.

Boats of different size behave alike when lengths are counted in hull lengths, times in length over
top speed, and forces in greatest thrusts (Froude's scaling, where mass and drag scale too). The
planners' numbers are tuned for the default vessel; in units they serve every hull.
"""

from __future__ import annotations

from typing import NamedTuple

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
