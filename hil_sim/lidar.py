"""A LiDAR in the waves: casts the sensor's real beam pattern against everything around it.

Rays go through what is nearer than the sensor's least range, as in VRX; the water hides what is
under it. A sensor that turns while the vessel moves fires each slice of its scan from where it is
then, and tells each point's time; a simulator's sensor fires all rays at once, as VRX's.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from twinscrew.hil_sim.bodies import Bodies
from twinscrew.hil_sim.shapes import Shape
from twinscrew.hil_sim.slices import Echoes, merged, slices
from twinscrew.runtime.messages.types import Float32, PointCloud
from twinscrew.runtime.perception.sensor import Sensor
from twinscrew.runtime.settings import Fraction, NonNegative, Positive, Settings

WATER = -1
"""The object number of an echo from the water."""
NOTHING = -2
"""The object number of a ray without an echo, in an organised cloud."""


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
class Scan:
    """A cloud, and the truth about it."""

    cloud: PointCloud
    object_ids: NDArray[np.int32]
    """(N,) Which body gave each point (a row of `Bodies`), or `WATER`, or `NOTHING`."""


class Lidar:
    """One kind of vessel's LiDAR. It keeps a workspace: one LiDAR serves one thread at a time."""

    def __init__(
        self, sensor: Sensor, settings: LidarSettings, shapes: Sequence[Shape], own_shape: int = 0
    ) -> None:
        """Prepare the beams and the shapes; `own_shape` is what carries the sensor."""
        self._sensor = sensor
        self._settings = settings
        self._directions_S: Float32 = sensor.directions_S().reshape(-1, 3)
        self._columns = len(sensor.azimuths)
        self._slices = slices(sensor, shapes, own_shape)
        rolling = sensor.scan_duration_s > 0
        self._time_offsets = sensor.time_offsets.astype(np.float32) if rolling else None
        self._stamp_offset_ns = round(1e9 * float(sensor.time_offsets[-1])) if rolling else 0

    def scan(self, bodies: Bodies, own: int, now_ns: int, rng: Generator) -> Scan:
        """Give the scan that ends now, of the sensor carried by body `own`.

        `rng` is drawn from once a kind of randomness, always in the same order: the same generator
        state and bodies give the same scan.
        """
        beam, distance, body = self._echoes(bodies, own)
        if self._settings.water_echoes > 0:
            water = self._water_echoes(beam, bodies, own, rng)
            beam, distance, body = merged([(beam, distance, body), water])
        if self._settings.dropout > 0:
            kept = rng.random(len(beam)) >= self._settings.dropout
            beam, distance, body = beam[kept], distance[kept], body[kept]
        noise = rng.standard_normal(len(beam), dtype=np.float32)
        measured = distance.astype(np.float32) + np.float32(self._sensor.noise_sigma_m) * noise
        return self._make_scan(now_ns - self._stamp_offset_ns, beam, measured, body)

    def _echoes(self, bodies: Bodies, own: int) -> Echoes:
        if len(self._slices) == 1:
            return self._slices[0].cast(bodies, own)
        return merged([part.cast(bodies.moved(part.time_s), own) for part in self._slices])

    def _water_echoes(
        self, taken: NDArray[np.int32], bodies: Bodies, own: int, rng: Generator
    ) -> Echoes:
        """Give echoes from the water, at one level, by rays without another echo."""
        R_NB = bodies.R_NB[own]
        sensor_z = bodies.position_N[own, 2] + R_NB[2] @ self._sensor.mount_position_B
        height = bodies.water_z[own] - sensor_z
        down = self._directions_S @ (R_NB @ self._sensor.R_BS)[2].astype(np.float32)
        rays = np.flatnonzero(down > height / self._sensor.range_max_m).astype(np.int32)
        distance = height / down[rays]
        share = self._settings.water_echoes * np.exp(-distance / self._settings.water_range_m)
        echoes = rng.random(len(rays)) < share
        echoes &= distance >= self._sensor.range_min_m
        echoes &= ~np.isin(rays, taken, assume_unique=True)
        beam = rays[echoes]
        return beam, distance[echoes], np.full(len(beam), WATER, dtype=np.int32)

    def _make_scan(
        self, stamp_ns: int, beam: NDArray[np.int32], distance: Float32, body: NDArray[np.int32]
    ) -> Scan:
        points_S = self._directions_S[beam] * distance[:, None]
        settings, rays = self._settings, len(self._directions_S)
        intensity = np.where(body == WATER, settings.water_intensity, settings.object_intensity)
        object_ids = body.copy()
        if settings.organised:
            points_S = _spread(points_S, beam, rays, np.inf)
            intensity = _spread(intensity, beam, rays, 0)
            object_ids = _spread(object_ids, beam, rays, NOTHING)
            beam = np.arange(rays, dtype=np.int32)
        times = self._time_offsets
        cloud = PointCloud(
            stamp_ns=stamp_ns,
            frame_id=settings.frame_id,
            points_S=points_S,
            intensity=intensity.astype(np.float32),
            ring=(beam // self._columns).astype(np.uint16),
            time_offset_s=None if times is None else times[beam % self._columns],
        )
        return Scan(cloud=cloud, object_ids=object_ids)


def _spread(values: NDArray[Any], beam: NDArray[np.int32], rays: int, empty: float) -> NDArray[Any]:
    """Put each value at its ray's place in an array of all rays."""
    full = np.full((rays, *values.shape[1:]), empty, dtype=values.dtype)
    full[beam] = values
    return full
