"""Scans by rays and equations, as real spinning LiDARs fire them: nothing of the simulator's.

Upright cylinders, turned boxes and one rough plane are met by rays whose azimuths differ from beam
to beam, whose ranges come in steps, some of which are lost; then the points are mixed.
Sources: VLP-16 (63-9243), HDL-32E (63-9113) and OS1 (rev. C) user manuals.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

Array = NDArray[np.float64]
GROUND, NOTHING = -1, -2
"""What a ray has met, if it is no object."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Firing:
    """How a sensor fires."""

    name: str
    elevations: Array
    """[rad] (M,) Of each beam."""
    columns: int
    """[-] Firings of all beams in a turn."""
    offsets: Array
    """[rad] (M,) Azimuth of each beam beyond the firing's."""
    origin_m: float = 0.0
    """[m] Beams begin this far from the axis."""
    quantum_m: float = 0.002
    """[m] Ranges are multiples of it."""
    sigma_m: float = 0.015
    """[m] Standard deviation of a range."""


def vlp16() -> Firing:
    """16 lasers, one every 2.304 us of a firing's 55.296 us, at 10 Hz; elevations not in order."""
    order = np.array([-15, 1, -13, 3, -11, 5, -9, 7, -7, 9, -5, 11, -3, 13, -1, 15.0])
    step = 2 * np.pi * 10.0 * 55.296e-6
    return Firing(
        name="vlp16",
        elevations=np.radians(order),
        columns=1808,
        offsets=step * np.arange(16.0) * 2.304 / 55.296,
    )


def hdl32e() -> Firing:
    """32 lasers, one every 1.152 us of a firing's 46.08 us, at 10 Hz."""
    low = -30.67 + 4.0 / 3.0 * np.arange(32)
    order = np.empty(32)
    order[::2], order[1::2] = low[:16], low[16:]
    step = 2 * np.pi * 10.0 * 46.08e-6
    return Firing(
        name="hdl32e",
        elevations=np.radians(order),
        columns=2170,
        offsets=step * np.arange(32.0) * 1.152 / 46.08,
    )


def os1_64() -> Firing:
    """64 beams over 45 degrees in 1024 columns; each fourth beam looks the same way."""
    return Firing(
        name="os1_64",
        elevations=np.radians(np.linspace(22.5, -22.5, 64)),
        columns=1024,
        offsets=np.radians(np.tile([4.23, 1.41, -1.41, -4.23], 16)),
        origin_m=0.0277,
        quantum_m=0.001,
        sigma_m=0.01,
    )


def vrx(beams: int) -> Firing:
    """A simulator's: all beams at once."""
    lowest, highest, columns = {
        16: (-np.pi / 12, np.pi / 12, 1875),
        32: (-0.186, 0.54, 2187),
    }[beams]
    return Firing(
        name=f"vrx{beams}",
        elevations=np.linspace(lowest, highest, beams),
        columns=columns - 1,
        offsets=np.zeros(beams),
        quantum_m=1e-6,
        sigma_m=0.01,
    )


FIRINGS = {f.name: f for f in (vlp16(), hdl32e(), os1_64(), vrx(16), vrx(32))}


@dataclass(frozen=True, slots=True, kw_only=True)
class Thing:
    """An upright cylinder (one size) or a turned box (two) between two heights over the ground."""

    x: float
    y: float
    size: tuple[float, ...]
    low: float
    high: float
    turn: float = 0.0

    @property
    def reach(self) -> float:
        """[m] The radius of the circle around it."""
        return self.size[0] if len(self.size) == 1 else math.hypot(*self.size) / 2


@dataclass(frozen=True, slots=True, kw_only=True)
class Scan:
    """Points in the file's axes: x forward, y left, z up; and what each is of."""

    points: NDArray[np.float32]
    ring: NDArray[np.uint16]
    thing: NDArray[np.int32]
    intensity: NDArray[np.float32] = field(default_factory=lambda: np.empty(0, np.float32))


def scan(
    firing: Firing,
    things: list[Thing],
    rng: Generator,
    *,
    height: float = 1.9,
    ground: bool = True,
    tilt: tuple[float, float] = (0.0, 0.0),
    rough: float = 0.03,
    dropped: float = 0.02,
    misses: str = "left out",
    mixed: bool = True,
) -> Scan:
    """Scan things that stand on the ground.

    Parameters
    ----------
    height
        [m] Of the sensor over the ground.
    ground
        Whether the ground, or the water, gives echoes.
    tilt
        [rad] Roll and pitch of the sensor.
    rough
        [m] Standard deviation of the ground's height.
    dropped
        [-] Share of the echoes that are lost.
    misses
        What stands for a ray without an echo: "left out", "nan" or "zero".
    mixed
        Whether the points come in no order.
    """
    rays, ring, start = _rays(firing, rng)
    R = _rotation(*tilt)
    d, o = rays @ R.T, start @ R.T
    distance, thing = _ground(d, o, height, rough, rng) if ground else _nowhere(len(d))
    for number, one in enumerate(things):
        t = _met(one, d, o, height)
        nearer = t < distance
        distance, thing = np.where(nearer, t, distance), np.where(nearer, number, thing)
    distance = distance + firing.sigma_m * rng.standard_normal(len(d))
    distance = np.round(distance / firing.quantum_m) * firing.quantum_m
    lost = (rng.random(len(d)) < dropped) | ~(distance < 100.0) | (distance < 0.4)
    points = start + rays * np.where(lost, np.nan, distance)[:, None]
    thing = np.where(lost, NOTHING, thing)
    if misses == "zero":
        points = np.where(lost[:, None], 0.0, points)
    keep = np.arange(len(points)) if misses != "left out" else np.flatnonzero(~lost)
    keep = rng.permutation(keep) if mixed else keep
    return Scan(
        points=points[keep].astype(np.float32),
        ring=ring[keep].astype(np.uint16),
        thing=thing[keep].astype(np.int32),
        intensity=rng.uniform(1.0, 200.0, len(keep)).astype(np.float32),
    )


def _rays(firing: Firing, rng: Generator) -> tuple[Array, NDArray[np.intp], Array]:
    """Give unit vectors, their beams and where they begin, clockwise from anywhere."""
    begin = rng.uniform(-np.pi, np.pi)
    turn = begin - 2 * np.pi * np.arange(firing.columns) / firing.columns
    azimuth = (turn[:, None] - firing.offsets).reshape(-1)
    elevation = np.tile(firing.elevations, firing.columns)
    flat = np.column_stack([np.cos(azimuth), np.sin(azimuth)])
    rays = np.column_stack([np.cos(elevation)[:, None] * flat, np.sin(elevation)])
    # The emitter turns with the firing, not with the beam's own offset.
    axis = np.repeat(np.column_stack([np.cos(turn), np.sin(turn)]), len(firing.elevations), axis=0)
    start = firing.origin_m * np.column_stack([axis, np.zeros(len(axis))])
    rank = np.argsort(np.argsort(firing.elevations))
    return rays, np.tile(rank, firing.columns), start


def _rotation(roll: float, pitch: float) -> Array:
    c, s, cp, sp = np.cos(roll), np.sin(roll), np.cos(pitch), np.sin(pitch)
    about_x = np.array([[1, 0, 0], [0, c, -s], [0, s, c]])
    about_y = np.array([[cp, 0, sp], [0, 1, 0], [-sp, 0, cp]])
    rotation: Array = about_y @ about_x
    return rotation


def _nowhere(count: int) -> tuple[Array, NDArray[np.intp]]:
    return np.full(count, np.inf), np.full(count, NOTHING)


def _ground(
    d: Array, o: Array, height: float, rough: float, rng: Generator
) -> tuple[Array, NDArray[np.intp]]:
    with np.errstate(divide="ignore"):
        t = -(height + o[:, 2] + rough * rng.standard_normal(len(d))) / d[:, 2]
    hit = (t > 0.0) & (t < 100.0)
    return np.where(hit, t, np.inf), np.where(hit, GROUND, NOTHING)


def _met(thing: Thing, d: Array, o: Array, height: float) -> Array:
    """[m] Give how far along each ray its side is met; infinity if it is not."""
    c, s = np.cos(thing.turn), np.sin(thing.turn)
    turn = np.array([[c, s], [-s, c]])
    q, v = (o[:, :2] - [thing.x, thing.y]) @ turn.T, d[:, :2] @ turn.T
    near, far = _disc(q, v, thing.size[0]) if len(thing.size) == 1 else _box(q, v, thing.size)
    low, high = _slab(o[:, 2] + height, d[:, 2], thing.low, thing.high)
    begin, end = np.maximum(near, low), np.minimum(far, high)
    return np.where((begin < end) & (begin > 0.0), begin, np.inf)


def _disc(q: Array, v: Array, radius: float) -> tuple[Array, Array]:
    a, b = (v * v).sum(axis=1), (q * v).sum(axis=1)
    root = b * b - a * ((q * q).sum(axis=1) - radius**2)
    with np.errstate(invalid="ignore"):
        half = np.sqrt(root)
    near, far = (-b - half) / a, (-b + half) / a
    return np.where(root > 0, near, np.inf), np.where(root > 0, far, -np.inf)


def _box(q: Array, v: Array, size: tuple[float, ...]) -> tuple[Array, Array]:
    ends = [_slab(q[:, i], v[:, i], -size[i] / 2, size[i] / 2) for i in (0, 1)]
    return np.maximum(ends[0][0], ends[1][0]), np.minimum(ends[0][1], ends[1][1])


def _slab(q: Array, v: Array, low: float, high: float) -> tuple[Array, Array]:
    with np.errstate(divide="ignore", invalid="ignore"):
        one, other = (low - q) / v, (high - q) / v
    return np.fmin(one, other), np.fmax(one, other)
