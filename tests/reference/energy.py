"""Mechanical energy and momentum of vessels on still water, written from the definitions."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from tests.reference.vessel_step import rotation

from twinscrew.hil_sim.vessel.dynamics import join
from twinscrew.hil_sim.vessel.state import VesselState
from twinscrew.runtime.vessel_description import VesselDescription

Array = NDArray[np.float64]


def mass_matrix(vessel: VesselDescription) -> Array:
    return join(vessel.parts).mass_matrix() + np.diag(vessel.added_mass)


def twist(state: VesselState) -> Array:
    return np.concatenate([state.velocity_B, state.rates_B], axis=1)


def kinetic(vessel: VesselDescription, state: VesselState) -> Array:
    nu = twist(state)
    return 0.5 * np.einsum("vi,ij,vj->v", nu, mass_matrix(vessel), nu)


def segment_volume(radius: float, height: Array) -> Array:
    """The integral of a circle's segment area over its height, [m3]."""
    c = radius - height
    half_chord = np.sqrt(radius**2 - c**2)
    return radius**2 * (half_chord - c * np.arccos(c / radius)) - half_chord**3 / 3


def potential(vessel: VesselDescription, state: VesselState) -> Array:
    """Of weight, and of hulls pushed into still water, [J]."""
    b, body = vessel.buoyancy, join(vessel.parts)
    R = rotation(state.q_NB)
    centre_down = state.position_N[:, 2] + R[:, 2] @ body.centre_B
    depth = state.position_N[:, None, 2] + np.einsum("vj,pj->vp", R[:, 2], b.points_B)
    wet = np.clip(depth, 0, b.hull_radius_m)
    beyond = np.maximum(depth - b.hull_radius_m, 0) * 0.5 * np.pi * b.hull_radius_m**2
    volume = segment_volume(b.hull_radius_m, wet) + beyond
    scale = b.hull_length_m / b.points_per_hull * b.water_density_kgpm3 * b.gravity_mps2
    return scale * volume.sum(axis=1) - body.mass * b.gravity_mps2 * centre_down


def momentum(vessel: VesselDescription, state: VesselState) -> tuple[Array, Array]:
    """Linear and angular momentum about N's origin, (V, 3) each, in N."""
    both = twist(state) @ mass_matrix(vessel).T
    R = rotation(state.q_NB)
    p = np.einsum("vij,vj->vi", R, both[:, :3])
    L = np.einsum("vij,vj->vi", R, both[:, 3:])
    return p, L + np.cross(state.position_N, p)
