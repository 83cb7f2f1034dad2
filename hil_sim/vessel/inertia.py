"""Mass and inertia: the sum of the parts, about base_link.

Source: Fossen (2021), chapter 3.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from twinscrew.hil_sim.vessel.parameters import Part

Array = NDArray[np.float64]


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
