"""What sensors do wrong: repeat themselves, see badly, tell the wrong time."""

from __future__ import annotations

import math
import struct
from dataclasses import replace
from typing import Final

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from twinscrew.hil_sim.faults.effects import Immediate
from twinscrew.hil_sim.faults.kinds import ClockJump, Noise
from twinscrew.runtime.geometry import quaternion_from_euler, quaternion_product
from twinscrew.runtime.messages import cdr
from twinscrew.runtime.messages.types import (
    NANOSECONDS_PER_SECOND,
    Float32,
    Float64,
    Odometry,
    PointCloud,
)
from twinscrew.runtime.perception.sensor import load_sensor

PHANTOM_RANGE_M: Final = 30.0
"""[m] Phantoms are nearer than this; what is farther than 20 m is not perceived anyway."""
SENSOR: Final = load_sensor("vrx32")
"""The LiDAR of the vessels at which faults are made."""
OBJECT_INTENSITY: Final = 100.0
"""[-] Of echoes that are not the water's (`LidarSettings`)."""
GHOST_AT_M: Final = 14.0
"""[m] How far away vessels are that are not there,"""
GHOST_MPS: Final = 1.5
"""[m/s] how fast they go round the boat,"""
GHOST_HALF_M: Final = 0.8
"""[m] half of how wide they are,"""
GHOST_BELOW_M: Final = (0.2, 1.6)
"""[m] and between which depths below the LiDAR they are seen: it stands 1.9 m over the water."""
SWELL_S: Final = 5.0
"""[s] Period of a swell."""
_STAMP: Final = struct.Struct("<iI")
_STAMP_AT: Final = 4
"""[B] A stamped message begins with CDR's header, then the stamp, as we write it."""


def stamp_of(payload: bytes) -> int:
    """Give the stamp [ns] of a message that bears one."""
    seconds, nanoseconds = _STAMP.unpack_from(payload, _STAMP_AT)
    return int(seconds) * NANOSECONDS_PER_SECOND + int(nanoseconds)


def with_stamp(payload: bytes, stamp_ns: int) -> bytes:
    """Give the same message with another stamp [ns]."""
    stamp = _STAMP.pack(*divmod(stamp_ns, NANOSECONDS_PER_SECOND))
    return payload[:_STAMP_AT] + stamp + payload[_STAMP_AT + _STAMP.size :]


class Freezing(Immediate):
    """The last message before it, or the first in it, is repeated in the place of all others."""

    def __init__(self, last: bytes | None = None, *, stamps_move: bool) -> None:
        self._stamps_move = stamps_move
        self._first = last

    def put(self, payload: bytes, now_s: float) -> list[bytes]:  # noqa: ARG002
        """See `Effect`."""
        if self._first is None:
            self._first = payload
        if not self._stamps_move:
            return [self._first]
        return [with_stamp(self._first, stamp_of(payload))]


class Jumping(Immediate):
    """The clock of the stamps is wrong."""

    def __init__(self, settings: ClockJump) -> None:
        self._jump_ns = round(settings.jump_s * NANOSECONDS_PER_SECOND)
        self._every, self._count = settings.every, 0

    def put(self, payload: bytes, now_s: float) -> list[bytes]:  # noqa: ARG002
        """See `Effect`."""
        self._count += 1
        if self._count % self._every:
            return [payload]
        return [with_stamp(payload, stamp_of(payload) + self._jump_ns)]


class NoisyPoints(Immediate):
    """A LiDAR in spray."""

    def __init__(self, settings: Noise, rng: Generator) -> None:
        self._settings, self._rng = settings, rng

    def put(self, payload: bytes, now_s: float) -> list[bytes]:  # noqa: ARG002
        """See `Effect`."""
        cloud = cdr.decode_point_cloud(payload)
        if self._settings.ghosts or self._settings.visibility_m > 0.0:
            cloud = _seen_otherwise(cloud, self._settings, self._rng)
        return [cdr.encode_point_cloud(noisy_cloud(cloud, self._settings, self._rng))]


class NoisyOdometry(Immediate):
    """A position that is worse than usual."""

    def __init__(self, settings: Noise, rng: Generator) -> None:
        self._settings, self._rng = settings, rng

    def put(self, payload: bytes, now_s: float) -> list[bytes]:  # noqa: ARG002
        """See `Effect`."""
        odometry = cdr.decode_odometry(payload)
        return [cdr.encode_odometry(noisy_odometry(odometry, self._settings, self._rng))]


def noisy_cloud(cloud: PointCloud, settings: Noise, rng: Generator) -> PointCloud:
    """Move every echo along its ray, and put phantoms in the place of some."""
    points = cloud.points_S.astype(np.float64)
    distance = np.linalg.norm(points, axis=1, keepdims=True)
    with np.errstate(invalid="ignore", divide="ignore"):
        points *= 1.0 + rng.normal(0.0, settings.sigma_m, distance.shape) / distance
    count = min(settings.phantoms, len(points))
    at = rng.choice(len(points), size=count, replace=False)
    points[at] = rng.uniform(-1.0, 1.0, (count, 3)) * (PHANTOM_RANGE_M, PHANTOM_RANGE_M, 2.0)
    return replace(cloud, points_S=np.ascontiguousarray(points, dtype=np.float32))


def _seen_otherwise(cloud: PointCloud, settings: Noise, rng: Generator) -> PointCloud:
    """Let fog end beams, and vessels that are not there echo: on the beams of `SENSOR`."""
    rays = SENSOR.directions_S().reshape(-1, 3).astype(np.float64)
    distance, intensity = np.full(len(rays), np.inf), np.zeros(len(rays), dtype=np.float32)
    beam = _beams_of(cloud.points_S)
    distance[beam] = np.linalg.norm(cloud.points_S, axis=1)
    intensity[beam] = OBJECT_INTENSITY if cloud.intensity is None else cloud.intensity
    new = distance.copy()
    for number in range(settings.ghosts):
        at = _ghost(rays, math.tau * number / settings.ghosts, cloud.stamp_ns)
        new = np.minimum(new, at)
    if settings.visibility_m > 0.0:
        new = np.minimum(new, rng.exponential(settings.visibility_m, len(rays)))
        new[(new > SENSOR.range_max_m) & (new < distance)] = np.inf
    intensity[new < distance] = OBJECT_INTENSITY
    seen = np.flatnonzero(np.isfinite(new) & (new > SENSOR.range_min_m))
    points = (rays[seen] * new[seen, None]).astype(np.float32)
    ring = (seen // SENSOR.columns.count).astype(np.uint16)
    return replace(
        cloud,
        points_S=np.ascontiguousarray(points),
        intensity=intensity[seen],
        ring=None if cloud.ring is None else ring,
    )


def _beams_of(points_S: Float32) -> NDArray[np.int64]:
    """Give the beam of `SENSOR` that each point lies on, (N,)."""
    x, y, z = points_S.astype(np.float64).T
    row = np.abs(np.arctan2(-z, np.hypot(x, y))[:, None] - SENSOR.elevations).argmin(axis=1)
    first, step = SENSOR.azimuths[0], SENSOR.azimuths[1] - SENSOR.azimuths[0]
    column = np.rint(np.remainder((np.arctan2(y, x) - first) * np.sign(step), math.tau) / abs(step))
    columns = SENSOR.columns.count
    beams: NDArray[np.int64] = row * columns + column.astype(np.int64) % columns
    return beams


def _ghost(rays: Float64, bearing: float, stamp_ns: int) -> Float64:
    """Give how far along each ray, (N,) [m], a vessel lies that is not there; infinite: nowhere."""
    bearing += GHOST_MPS / GHOST_AT_M * (stamp_ns / NANOSECONDS_PER_SECOND % 1e4)
    at = GHOST_AT_M / np.hypot(rays[:, 0], rays[:, 1])
    below_m = rays[:, 2] * at
    across = np.remainder(np.arctan2(rays[:, 1], rays[:, 0]) - bearing + math.pi, math.tau)
    hit = np.abs(across - math.pi) < GHOST_HALF_M / GHOST_AT_M
    hit &= (below_m > GHOST_BELOW_M[0]) & (below_m < GHOST_BELOW_M[1])
    return np.where(hit, at, np.inf)


def noisy_odometry(odometry: Odometry, settings: Noise, rng: Generator) -> Odometry:
    """Move the position on the water, and with a swell."""
    phase = math.sin(math.tau * (odometry.stamp_ns / NANOSECONDS_PER_SECOND % 1e4) / SWELL_S)
    off = np.append(rng.normal(0.0, settings.sigma_m, 2), settings.heave_m * phase)
    roll = quaternion_from_euler(math.radians(settings.roll_deg) * phase, 0.0, 0.0)
    return replace(
        odometry,
        position_N=odometry.position_N + off,
        q_NB=quaternion_product(odometry.q_NB, roll),
    )
