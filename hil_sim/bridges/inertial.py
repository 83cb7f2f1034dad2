"""Motion between two states of the simulator, as an inertial sensor on board would feel it.

Within a step the velocity is a straight line, so that the acceleration is constant and a filter
that integrates the specific force over the step gets exactly the simulator's change of velocity,
moorings and collisions included.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from twinscrew.hil_sim.bridges.ardupilot_json import Motion, Quaternion, Vector
from twinscrew.hil_sim.vessel.state import VesselState
from twinscrew.runtime.geometry import rotation_from_quaternion

GRAVITY_MPS2 = 9.80665
"""[m/s2] Standard gravity, which ArduPilot calibrates its accelerometers with (GRAVITY_MSS)."""


@dataclass(frozen=True, slots=True)
class Moment:
    """One vessel at one time."""

    time_s: float
    """[s] Simulated."""
    position_N: Vector
    """[m]"""
    q_NB: Quaternion
    """[-]"""
    velocity_N: Vector
    """[m/s]"""
    rates_B: Vector
    """[rad/s]"""


def moment(state: VesselState, vessel: int, time_s: float) -> Moment:
    """Give one vessel's moment out of the simulator's state."""
    q_NB = state.q_NB[vessel]
    north, east, down = (rotation_from_quaternion(q_NB) @ state.velocity_B[vessel]).tolist()
    w, x, y, z = q_NB.tolist()
    a, b, c = state.position_N[vessel].tolist()
    p, q, r = state.rates_B[vessel].tolist()
    return Moment(time_s, (a, b, c), (w, x, y, z), (north, east, down), (p, q, r))


def motion_between(before: Moment, after: Moment, time_s: float, told_s: float) -> Motion:
    """Give the motion at a time between two moments (or at it, if they are the same).

    Parameters
    ----------
    before, after
        The moments around `time_s`.
    time_s
        [s] When, in simulated time.
    told_s
        [s] What time ArduPilot is told.
    """
    step_s = after.time_s - before.time_s
    f = (time_s - before.time_s) / step_s if step_s > 0.0 else 1.0
    q_NB = _blend_attitude(before.q_NB, after.q_NB, f)
    per_s = 1.0 / step_s if step_s > 0.0 else 0.0
    north, east, down = (
        (v1 - v0) * per_s for v0, v1 in zip(before.velocity_N, after.velocity_N, strict=True)
    )
    return Motion(
        time_s=told_s,
        rates_B=_blend(before.rates_B, after.rates_B, f),
        specific_force_B=_into_body(q_NB, (north, east, down - GRAVITY_MPS2)),
        position_N=_blend(before.position_N, after.position_N, f),
        q_NB=q_NB,
        velocity_N=_blend(before.velocity_N, after.velocity_N, f),
    )


def _blend(a: Vector, b: Vector, f: float) -> Vector:
    return a[0] + (b[0] - a[0]) * f, a[1] + (b[1] - a[1]) * f, a[2] + (b[2] - a[2]) * f


def _blend_attitude(a: Quaternion, b: Quaternion, f: float) -> Quaternion:
    """Go the short way in a straight line, and normalise: a step turns by less than a degree."""
    sign = 1.0 if sum(x * y for x, y in zip(a, b, strict=True)) >= 0.0 else -1.0
    w, x, y, z = ((1.0 - f) * p + f * sign * q for p, q in zip(a, b, strict=True))
    norm = math.sqrt(w * w + x * x + y * y + z * z)
    return w / norm, x / norm, y / norm, z / norm


def _into_body(q_NB: Quaternion, v_N: Vector) -> Vector:
    """Express a vector of N in B: R_NB' v. Fossen (2021), eq. 2.72, transposed."""
    w, x, y, z = q_NB
    north, east, down = v_N
    return (
        (1 - 2 * (y * y + z * z)) * north + 2 * (x * y + z * w) * east + 2 * (x * z - y * w) * down,
        2 * (x * y - z * w) * north + (1 - 2 * (x * x + z * z)) * east + 2 * (y * z + x * w) * down,
        2 * (x * z + y * w) * north + 2 * (y * z - x * w) * east + (1 - 2 * (x * x + y * y)) * down,
    )
