"""Ray casting, written to be read: every ray against every solid, by clipping.

A ray inside a convex solid runs through an interval of distances. A box is three slabs, a cylinder
one slab and an endless tube: the ray's interval is where those overlap. (The C++ kernel finds entry
points on faces instead, and only for rays within each solid's window.)
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from twinscrew.hil_sim.bodies import ABSENT, Bodies
from twinscrew.hil_sim.shapes import BOX, Shape
from twinscrew.runtime.messages.types import Float64
from twinscrew.runtime.perception.sensor import Sensor

Interval = tuple[Float64, Float64]


def directions(sensor: Sensor) -> Float64:
    """Give the rays, (M * C, 3), frame S, in double precision."""
    e, a = np.meshgrid(sensor.elevations, sensor.azimuths, indexing="ij")
    rays = np.stack([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), -np.sin(e)], axis=-1)
    return rays.reshape(-1, 3)


def cast(
    sensor: Sensor, shapes: list[Shape], bodies: Bodies, own: int
) -> tuple[Float64, NDArray[np.int64]]:
    """Give every ray's distance, (M * C,) [m], infinite without an echo, and its body, or -2."""
    R_NS = bodies.R_NB[own] @ sensor.R_BS
    p_NS = bodies.position_N[own] + bodies.R_NB[own] @ sensor.mount_position_B
    rays_N = directions(sensor) @ R_NS.T
    depth, body = np.full(len(rays_N), np.inf), np.full(len(rays_N), -2)
    for i, number in enumerate(bodies.shape):
        water_z = np.inf if i == own else bodies.water_z[i]
        if number == ABSENT and i != own:
            continue
        shape = shapes[0 if i == own else number]
        for kind, centre, R_OP, half in zip(
            shape.kinds, shape.centres, shape.rotations, shape.halves, strict=True
        ):
            R_NP = bodies.R_NB[i] @ R_OP
            p_NP = bodies.position_N[i] + bodies.R_NB[i] @ centre
            entry = _entry(kind, half, (p_NS - p_NP) @ R_NP, rays_N @ R_NP)
            dry = p_NS[2] + np.where(np.isfinite(entry), entry, 0) * rays_N[:, 2] <= water_z
            seen = (entry >= sensor.range_min_m) & (entry <= sensor.range_max_m) & dry
            nearer = seen & (entry < depth)
            depth[nearer], body[nearer] = entry[nearer], i
    return depth, body


def _entry(kind: int, half: Float64, origin: Float64, rays: Float64) -> Float64:
    """Give where rays enter a solid, all in its own axes; infinite if they miss or start inside."""
    first, last = _slab(half[0], origin[0], rays[:, 0])
    for low, high in (
        [_slab(half[k], origin[k], rays[:, k]) for k in (1, 2)]
        if kind == BOX
        else [_tube(half[1], origin, rays)]
    ):
        first, last = np.maximum(first, low), np.minimum(last, high)
    return np.where((first <= last) & (first > 0), first, np.inf)


def _slab(half: float, origin: float, ray: Float64) -> Interval:
    """Give the distances between which rays are within +-half of one axis."""
    with np.errstate(divide="ignore", invalid="ignore"):
        a, b = (-half - origin) / ray, (half - origin) / ray
    parallel = ray == 0
    inside = abs(origin) <= half
    low = np.where(parallel, -np.inf if inside else np.inf, np.minimum(a, b))
    high = np.where(parallel, np.inf if inside else -np.inf, np.maximum(a, b))
    return low, high


def _tube(radius: float, origin: Float64, rays: Float64) -> Interval:
    """Give the distances between which rays are within an endless tube along x."""
    a = rays[:, 1] ** 2 + rays[:, 2] ** 2
    b = 2 * (rays[:, 1] * origin[1] + rays[:, 2] * origin[2])
    c = origin[1] ** 2 + origin[2] ** 2 - radius**2
    discriminant = b**2 - 4 * a * c
    root = np.sqrt(np.maximum(discriminant, 0))
    with np.errstate(divide="ignore", invalid="ignore"):
        low, high = (-b - root) / (2 * a), (-b + root) / (2 * a)
    missed = discriminant < 0
    return np.where(missed, np.inf, low), np.where(missed, -np.inf, high)
