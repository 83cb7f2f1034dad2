"""What a vessel is made of: parts, hulls, drag, thrusters.

Files give positions in VRX's axes (forward, port, up; keys ending in `_flu_m`); the properties
ending in `_B` are the one place where they become forward-starboard-down.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated

import numpy as np
from msgspec import Meta
from numpy.typing import NDArray

from twinscrew.runtime.errors import ConfigError
from twinscrew.runtime.geometry import flu_to_frd
from twinscrew.runtime.settings import Count, NonNegative, Positive, Settings, load, shipped

Array = NDArray[np.float64]
Vector = tuple[float, float, float]
Positives = tuple[NonNegative, NonNegative, NonNegative]
SixMagnitudes = tuple[NonNegative, NonNegative, NonNegative, NonNegative, NonNegative, NonNegative]


Size = Annotated[float, Meta(gt=0.0, le=500.0)]
"""[m] Of a vessel; none is longer."""


class Part(Settings, frozen=True):
    """One rigid part."""

    name: str
    mass_kg: Positive
    """[kg]"""
    position_flu_m: Vector
    """[m] [FLU] Its centre of gravity, from base_link."""
    inertia_kgm2: Positives
    """[kg m2] About its own centre, along the vessel's axes."""

    @property
    def position_B(self) -> Array:
        """[m] [B] (3,) Its centre of gravity."""
        return flu_to_frd(np.array(self.position_flu_m))


class Buoyancy(Settings, frozen=True):
    """Hulls as half-immersed cylinders whose lift acts at points."""

    hull_length_m: Size
    """[m] of each hull."""
    hull_radius_m: Size
    """[m] A point immersed deeper than this carries no more."""
    points_per_hull: Count
    """[-] Each point carries the hull's length divided by this."""
    points_flu_m: Annotated[tuple[Vector, ...], Meta(min_length=1)]
    """[m] [FLU] Where the lift acts: the keel, from base_link."""
    water_density_kgpm3: Positive
    """[kg/m3]"""
    gravity_mps2: Positive
    """[m/s2]"""

    @property
    def points_B(self) -> Array:
        """[m] [B] (P, 3) Where the lift acts."""
        return flu_to_frd(np.array(self.points_flu_m))


class Thrusters(Settings, frozen=True):
    """Two propellers that push along the hull."""

    left_flu_m: Vector
    """[m] [FLU] The left propeller, from base_link."""
    right_flu_m: Vector
    """[m] [FLU] The right propeller, from base_link."""
    min_n: Annotated[float, Meta(le=0.0)]
    """[N] Greatest thrust astern, each."""
    max_n: NonNegative
    """[N] Greatest thrust ahead, each."""

    @property
    def positions_B(self) -> Array:
        """[m] [B] (2, 3) Left, right."""
        return flu_to_frd(np.array([self.left_flu_m, self.right_flu_m]))


class Windage(Settings, frozen=True):
    """Force coefficients of the air."""

    along: NonNegative
    """[N s2/m2]"""
    across: NonNegative
    """[N s2/m2]"""
    yaw: NonNegative
    """[N s2/m]"""


class VesselParameters(Settings, frozen=True):
    """A vessel of six degrees of freedom. Orders of six: surge, sway, heave, roll, pitch, yaw."""

    length_m: Positive
    """[m] overall"""
    width_m: Positive
    """[m] overall"""
    collision_radius_m: Positive
    """[m] A circle around base_link that holds the vessel."""
    added_mass: SixMagnitudes
    """[kg, kg m2] Diagonal of M_A: positive adds inertia."""
    linear_drag: SixMagnitudes
    """[kg/s, kg m2/s] Positive magnitudes."""
    quadratic_drag: SixMagnitudes
    """[kg/m, kg m2] Positive magnitudes."""
    buoyancy: Buoyancy
    thrusters: Thrusters
    windage: Windage
    parts: Annotated[tuple[Part, ...], Meta(min_length=1)]


def load_vessel(name: str | Path = "wam_v") -> VesselParameters:
    """Read a vessel's parameters: a shipped one by name, or a file.

    Raises
    ------
    ConfigError
        The file cannot be used; it says which key and why.
    """
    path = shipped("vessels", name)
    parameters = load(path, VesselParameters)
    lift = len(parameters.buoyancy.points_flu_m) * largest_lift(parameters.buoyancy)
    weight = sum(part.mass_kg for part in parameters.parts) * parameters.buoyancy.gravity_mps2
    if lift <= weight:
        raise ConfigError(f"sinks: {lift:.0f} N of lift, {weight:.0f} N of weight", file=path)
    return parameters


def lift_per_area(buoyancy: Buoyancy) -> float:
    """Give the lift [N/m2] of one point for each square metre of its hull's wet section."""
    length = buoyancy.hull_length_m / buoyancy.points_per_hull
    return length * buoyancy.water_density_kgpm3 * buoyancy.gravity_mps2


def largest_lift(buoyancy: Buoyancy) -> float:
    """Give the lift [N] of one point that is immersed by the hull's radius: half a circle."""
    return 0.5 * math.pi * buoyancy.hull_radius_m**2 * lift_per_area(buoyancy)
