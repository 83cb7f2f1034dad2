"""The equations of motion in numpy, written to be read: one function a term.

    M nu_r' + C(nu_r) nu_r + D(nu_r) nu_r = tau_thrust + tau_weight + tau_lift + tau_wind

Paper, eq. (1); Fossen (2021), chapters 3, 6, 7 and 10. All moments are about base_link, all
vectors in B. nu_r is the velocity relative to the water, which moves with a steady current: a
frame that moves with the current is inertial, so the equations hold in it as they stand.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from twinscrew.hil_sim.sea.sea import Sea
from twinscrew.hil_sim.vessel.dynamics import join
from twinscrew.hil_sim.vessel.state import VesselState
from twinscrew.runtime.vessel_description import VesselDescription

Array = NDArray[np.float64]


def rotation(q: Array) -> Array:
    """Give R_NB, (V, 3, 3), of unit quaternions, (V, 4). Fossen (2021), chapter 2."""
    w, x, y, z = q.T
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    return np.moveaxis(np.array(rows), -1, 0)


def wrench(force: Array, position: Array) -> Array:
    """Give force and moment, (..., 6), of a force that acts at a position."""
    return np.concatenate([force, np.cross(np.broadcast_to(position, force.shape), force)], -1)


def coriolis(M: Array, nu: Array) -> Array:
    """Give C(nu) nu, (V, 6), by Kirchhoff's equations. Fossen (2021), chapter 3."""
    v, w = nu[:, :3], nu[:, 3:]
    momentum = nu @ M.T
    p, L = momentum[:, :3], momentum[:, 3:]
    return np.concatenate([np.cross(w, p), np.cross(v, p) + np.cross(w, L)], -1)


def damping(parameters: VesselDescription, nu_r: Array) -> Array:
    """Give D(nu_r) nu_r, (V, 6). Fossen (2021), chapter 6; diagonal."""
    linear, quadratic = np.array(parameters.linear_drag), np.array(parameters.quadratic_drag)
    return (linear + quadratic * np.abs(nu_r)) * nu_r


def segment_area(radius: float, height: Array) -> Array:
    """Give the area [m2] of a circle's segment of a height in [0, radius]."""
    rest = radius - height
    return radius**2 * np.arccos(rest / radius) - rest * np.sqrt(radius**2 - rest**2)


def lift(parameters: VesselDescription, position_N: Array, R: Array, sea: Sea, t: float) -> Array:
    """Give the hulls' buoyancy, (V, 6), at the wave surface. VRX 2.3.2."""
    b = parameters.buoyancy
    p_N = position_N[:, None, :] + np.einsum("vij,pj->vpi", R, b.points_B)
    depth = p_N[..., 2] + sea.elevation(p_N[..., :2], t)
    area = segment_area(b.hull_radius_m, np.clip(depth, 0.0, b.hull_radius_m))
    share = b.hull_length_m / b.points_per_hull
    up = -area * share * b.water_density_kgpm3 * b.gravity_mps2
    force_B = up[..., None] * R[:, None, 2, :]
    return wrench(force_B, b.points_B).sum(axis=1)


def air(parameters: VesselDescription, R: Array, wind_N: Array, world_frame: bool) -> Array:
    """Give the force of the air, (V, 6), that moves by wind_N, (V, 3), relative to the vessel.

    Fossen (2021), chapter 10, in the form of VRX; `world_frame` is VRX's own use of it, in which
    the coefficients go with east and north instead of along and across the vessel.
    """
    w = parameters.windage
    if world_frame:
        u, v = wind_N[:, 1], wind_N[:, 0]
        zero = np.zeros_like(u)
        force_N = np.stack([w.across * v * np.abs(v), w.along * u * np.abs(u), zero], -1)
        moment_N = np.stack([zero, zero, 2.0 * w.yaw * u * v], -1)
        turned = [np.einsum("vij,vi->vj", R, a) for a in (force_N, moment_N)]
        return np.concatenate(turned, -1)
    wind_B = np.einsum("vij,vi->vj", R, wind_N)
    u, v = wind_B[:, 0], wind_B[:, 1]
    zero = np.zeros_like(u)
    force = [w.along * u * np.abs(u), w.across * v * np.abs(v), zero]
    return np.stack([*force, zero, zero, -2.0 * w.yaw * u * v], -1)


def push(parameters: VesselDescription, thrust: Array) -> Array:
    """Give the propellers' force, (V, 6), along the hull."""
    force = np.zeros((*thrust.shape, 3))
    force[..., 0] = thrust
    return wrench(force, parameters.thrusters.positions_B).sum(axis=1)


def acceleration(
    parameters: VesselDescription, state: VesselState, sea: Sea, t: float, world_frame: bool
) -> Array:
    """Give nu', (V, 6) [m/s2, rad/s2], in B."""
    body = join(parameters.parts)
    M = body.mass_matrix() + np.diag(parameters.added_mass)
    R = rotation(state.q_NB)
    current_N = np.append(sea.current_N, 0.0)
    velocity_r = state.velocity_B - np.einsum("vij,i->vj", R, current_N)
    nu_r = np.concatenate([velocity_r, state.rates_B], -1)
    wind_N = np.append(sea.wind(t), 0.0) - np.einsum("vij,vj->vi", R, state.velocity_B)
    weight = body.mass * parameters.buoyancy.gravity_mps2 * R[:, 2, :]
    tau = (
        push(parameters, state.thrust)
        + wrench(weight, body.centre_B)
        + lift(parameters, state.position_N, R, sea, t)
        + air(parameters, R, wind_N, world_frame)
        - coriolis(M, nu_r)
        - damping(parameters, nu_r)
    )
    return np.linalg.solve(M, tau.T).T


def turn(q: Array, angle: Array) -> Array:
    """Turn attitudes, (V, 4), by rotation vectors in B, (V, 3) [rad]. Fossen (2021), chapter 2."""
    half = 0.5 * np.linalg.norm(angle, axis=-1, keepdims=True)
    dw, d = np.cos(half), 0.5 * np.sinc(half / np.pi) * angle
    w, v = q[:, :1], q[:, 1:]
    scalar = w * dw - np.sum(v * d, -1, keepdims=True)
    turned = np.concatenate([scalar, w * d + dw * v + np.cross(v, d)], -1)
    return turned / np.linalg.norm(turned, axis=-1, keepdims=True)


def lagged(thrust: Array, command: Array, lag_s: float, dt: float) -> Array:
    """Give the thrust after dt of a first-order lag; without lag, the command."""
    return command if lag_s == 0.0 else command + (thrust - command) * np.exp(-dt / lag_s)


def step(
    parameters: VesselDescription,
    state: VesselState,
    command: Array,
    sea: Sea,
    t: float,
    dt: float,
    *,
    lag_s: float = 0.0,
    world_frame: bool = False,
) -> VesselState:
    """Move vessels on by dt with semi-implicit Euler: new velocity first, then pose with it."""
    limits = parameters.thrusters
    thrust = lagged(state.thrust, np.clip(command, limits.min_n, limits.max_n), lag_s, dt)
    pushed = VesselState(
        position_N=state.position_N,
        q_NB=state.q_NB,
        velocity_B=state.velocity_B,
        rates_B=state.rates_B,
        thrust=thrust,
    )
    nu_dot = acceleration(parameters, pushed, sea, t, world_frame)
    current_N = np.append(sea.current_N, 0.0)
    R = rotation(state.q_NB)
    velocity_r = state.velocity_B - np.einsum("vij,i->vj", R, current_N) + dt * nu_dot[:, :3]
    rates_B = state.rates_B + dt * nu_dot[:, 3:]
    q_NB = turn(state.q_NB, dt * rates_B)
    return VesselState(
        position_N=state.position_N + dt * (np.einsum("vij,vj->vi", R, velocity_r) + current_N),
        q_NB=q_NB,
        velocity_B=velocity_r + np.einsum("vij,i->vj", rotation(q_NB), current_N),
        rates_B=rates_B,
        thrust=thrust,
    )
