"""A LiDAR in the waves: casts the sensor's real beam pattern against everything around it.

Rays go through what is nearer than the sensor's least range, as in VRX; the water hides what is
under it. All rays of a scan are taken at once (a simulator's sensor, like VRX's).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from twinscrew.hil_sim._native import Caster
from twinscrew.hil_sim.shapes import Shape
from twinscrew.runtime.messages.types import Float32, Float64, PointCloud
from twinscrew.runtime.perception.sensor import Sensor
from twinscrew.runtime.settings import Fraction, NonNegative, Positive, Settings

WATER = -1
"""The object number of an echo from the water."""
NOTHING = -2
"""The object number of a ray without an echo, in an organised cloud."""
ABSENT = -1
"""The shape number of a body that is not there."""


class LidarSettings(Settings, frozen=True, kw_only=True):
    """What the simulated sensor does beside measuring; its beams and noise are the sensor's own."""

    frame_id: str = "lidar"
    """What the clouds say their frame is."""
    dropout: Fraction = 0.0
    """[-] Share of echoes lost, at random; VRX loses none."""
    organised: bool = False
    """True: one point a ray, infinite where nothing echoed, as VRX; False: echoes alone."""
    water_echoes: Fraction = 0.0
    """[-] Share of rays that meet the water straight below and echo; decays with distance."""
    water_range_m: Positive = 10.0
    """[m] Distance over which that share falls to 1/e: grazing rays are mirrored away."""
    object_intensity: NonNegative = 100.0
    """[-] Intensity of an echo from an object."""
    water_intensity: NonNegative = 1.0
    """[-] Intensity of an echo from the water: low, so that perception can drop it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Bodies:
    """Everything a LiDAR can see, at one moment."""

    shape: NDArray[np.int32]
    """(K,) Number of each body's shape, or `ABSENT`."""
    position_N: Float64
    """[m] [N] (K, 3)"""
    R_NB: Float64
    """(K, 3, 3) Turns a vector of a body's frame into N."""
    water_z: Float64
    """[m] [N] (K,) Down coordinate of the water surface around each body."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Scan:
    """A cloud, and the truth about it."""

    cloud: PointCloud
    object_ids: NDArray[np.int32]
    """(N,) Which body gave each point (a row of `Bodies`), or `WATER`, or `NOTHING`."""


class Lidar:
    """One vessel's LiDAR. It keeps a workspace: one LiDAR serves one thread at a time."""

    def __init__(
        self, sensor: Sensor, settings: LidarSettings, shapes: Sequence[Shape], own_shape: int = 0
    ) -> None:
        """Prepare the beams and the shapes; `own_shape` is what carries the sensor."""
        self._sensor = sensor
        self._settings = settings
        self._directions_S: Float32 = sensor.directions_S().reshape(-1, 3).astype(np.float32)
        self._columns = len(sensor.azimuths)
        rays = len(self._directions_S)
        self._beam = np.empty(rays, dtype=np.int32)
        self._range = np.empty(rays, dtype=np.float64)
        self._body = np.empty(rays, dtype=np.int32)
        self._position_B = np.ascontiguousarray(sensor.mount_position_B, dtype=np.float64)
        self._R_BS = np.ascontiguousarray(sensor.R_BS, dtype=np.float64)
        self._caster = Caster(
            sensor.elevations, sensor.azimuths, sensor.range_min_m, sensor.range_max_m
        )
        for shape in shapes:
            self._caster.add_shape(shape.kinds, shape.centres, shape.rotations, shape.halves)
        self._caster.mount(own_shape, self._position_B, self._R_BS)

    def scan(self, bodies: Bodies, own: int, stamp_ns: int, rng: Generator) -> Scan:
        """Give the scan of the sensor carried by body `own`.

        `rng` is drawn from once a kind of randomness, always in the same order: the same generator
        state and bodies give the same scan.
        """
        R_NS = bodies.R_NB[own] @ self._R_BS
        p_NS = bodies.position_N[own] + bodies.R_NB[own] @ self._position_B
        beam, distance, body = self._echoes(bodies, own, p_NS, R_NS)
        if self._settings.water_echoes > 0:
            water = self._water_echoes(beam, bodies.water_z[own] - p_NS[2], R_NS, rng)
            beam, distance, body = _merged(beam, distance, body, water)
        if self._settings.dropout > 0:
            kept = rng.random(len(beam)) >= self._settings.dropout
            beam, distance, body = beam[kept], distance[kept], body[kept]
        noise = rng.standard_normal(len(beam), dtype=np.float32)
        measured = distance.astype(np.float32) + np.float32(self._sensor.noise_sigma_m) * noise
        return self._make_scan(stamp_ns, beam, measured, body)

    def _echoes(
        self, bodies: Bodies, own: int, p_NS: Float64, R_NS: Float64
    ) -> tuple[NDArray[np.int32], Float64, NDArray[np.int32]]:
        count = self._caster.cast(
            p_NS,
            R_NS,
            bodies.shape,
            bodies.position_N,
            bodies.R_NB,
            bodies.water_z,
            own,
            self._beam,
            self._range,
            self._body,
        )
        return self._beam[:count], self._range[:count], self._body[:count]

    def _water_echoes(
        self, taken: NDArray[np.int32], height: float, R_NS: Float64, rng: Generator
    ) -> tuple[NDArray[np.int32], Float64]:
        """Give beam numbers and distances [m] of echoes from the water, `height` m below."""
        down = self._directions_S @ R_NS[2].astype(np.float32)
        rays = np.flatnonzero(down > height / self._sensor.range_max_m).astype(np.int32)
        distance = height / down[rays]
        share = self._settings.water_echoes * np.exp(-distance / self._settings.water_range_m)
        echoes = rng.random(len(rays)) < share
        echoes &= distance >= self._sensor.range_min_m
        echoes &= ~np.isin(rays, taken, assume_unique=True)
        return rays[echoes], distance[echoes]

    def _make_scan(
        self, stamp_ns: int, beam: NDArray[np.int32], distance: Float32, body: NDArray[np.int32]
    ) -> Scan:
        points_S = self._directions_S[beam] * distance[:, None]
        settings = self._settings
        intensity = np.where(body == WATER, settings.water_intensity, settings.object_intensity)
        ring = (beam // self._columns).astype(np.uint16)
        object_ids = body.copy()
        if settings.organised:
            points_S = _spread(points_S, beam, len(self._directions_S), np.inf)
            intensity = _spread(intensity, beam, len(self._directions_S), 0)
            object_ids = _spread(object_ids, beam, len(self._directions_S), NOTHING)
            ring = (np.arange(len(self._directions_S)) // self._columns).astype(np.uint16)
        cloud = PointCloud(
            stamp_ns=stamp_ns,
            frame_id=settings.frame_id,
            points_S=points_S,
            intensity=intensity.astype(np.float32),
            ring=ring,
        )
        return Scan(cloud=cloud, object_ids=object_ids)


def _merged(
    beam: NDArray[np.int32],
    distance: Float64,
    body: NDArray[np.int32],
    water: tuple[NDArray[np.int32], Float64],
) -> tuple[NDArray[np.int32], Float64, NDArray[np.int32]]:
    """Put the water's echoes among the objects', in order of beam number."""
    beams = np.concatenate([beam, water[0]])
    order = np.argsort(beams, kind="stable")
    bodies = np.concatenate([body, np.full(len(water[0]), WATER, dtype=np.int32)])
    return beams[order], np.concatenate([distance, water[1]])[order], bodies[order]


def _spread(values: NDArray[Any], beam: NDArray[np.int32], rays: int, empty: float) -> NDArray[Any]:
    """Put each value at its ray's place in an array of all rays."""
    full = np.full((rays, *values.shape[1:]), empty, dtype=values.dtype)
    full[beam] = values
    return full
