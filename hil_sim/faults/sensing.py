"""What sensors do wrong: repeat themselves, see badly, tell the wrong time."""

from __future__ import annotations

import struct
from dataclasses import replace
from typing import Final

import numpy as np
from numpy.random import Generator

from twinscrew.hil_sim.faults.effects import Immediate
from twinscrew.hil_sim.faults.kinds import ClockJump, Noise
from twinscrew.runtime.messages import cdr
from twinscrew.runtime.messages.types import NANOSECONDS_PER_SECOND, Odometry, PointCloud

PHANTOM_RANGE_M: Final = 30.0
"""[m] Phantoms are nearer than this; what is farther than 20 m is not perceived anyway."""
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


def noisy_odometry(odometry: Odometry, settings: Noise, rng: Generator) -> Odometry:
    """Move the position on the water."""
    off = np.append(rng.normal(0.0, settings.sigma_m, 2), 0.0)
    return replace(odometry, position_N=odometry.position_N + off)
