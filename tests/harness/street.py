"""A street, and scans of it as public data sets give them: HDL-64E, HDL-32E and VLP-16."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from twinscrew.hil_sim.bodies import Bodies
from twinscrew.hil_sim.lidar import Lidar, LidarSettings
from twinscrew.hil_sim.shapes import boxes_shape
from twinscrew.runtime.perception.sensor import Beams, Columns, Mount, Sensor, load_sensor

HDL_64E = np.concatenate([np.linspace(-24.33, -8.83, 32), np.linspace(-8.33, 2.0, 32)])
"""[deg] The lower block's beams are 1/2 degree apart, the upper one's 1/3 (user's manual)."""
CARS = ((8.0, -3.0), (15.0, -3.2), (-9.0, 3.0), (-16.0, -3.0))
POLES = ((6.0, 5.0), (12.0, 5.0), (-6.0, -5.0), (-13.0, 5.2))
WALLS = (-9.0, 9.0)
"""[m] Left and right of the sensor, along the street."""


@dataclass(frozen=True, slots=True, kw_only=True)
class StreetScan:
    """A scan in the file's axes: x forward, y left, z up."""

    points: NDArray[np.float32]
    ring: NDArray[np.uint16]
    body: NDArray[np.int32]


def like_kitti(**changes: float) -> StreetScan:
    """A car-borne HDL-64E at 10 m/s: corrected for motion, its blocks 0.1 m apart."""
    sensor = _sensor("hdl32e", HDL_64E, 2083)
    scan = _scan(sensor, height=1.73)
    points = scan.points.copy()
    turned = np.arctan2(points[:, 1], points[:, 0]) / (2 * np.pi)
    points[:, 0] += 10.0 * 0.1 * turned
    points[:, 2] += np.where(scan.ring >= 32, 0.1, 0.0).astype(np.float32)
    return StreetScan(points=points, ring=scan.ring, body=scan.body)


def like_nuscenes() -> StreetScan:
    """A car-borne HDL-32E that turns 20 times a second."""
    return _scan(_sensor("hdl32e", None, 1084), height=1.84)


def like_vlp16() -> StreetScan:
    return _scan(_sensor("vlp16", None, 1808), height=1.5)


def _sensor(like: str, elevations: NDArray[np.float64] | None, columns: int) -> Sensor:
    from msgspec import structs

    sensor = load_sensor(like)
    beams = sensor.beams if elevations is None else Beams(elevations_deg=tuple(elevations.tolist()))
    return structs.replace(
        sensor,
        beams=beams,
        columns=Columns(count=columns, first_rad=2.9, span_rad=-6.283185307179586, endpoint=False),
        scan_duration_s=0.0,
        noise_sigma_m=0.02,
        mount=Mount(x_m=0.0, y_m=0.0, z_m=0.0),
    )


def _scan(sensor: Sensor, height: float) -> StreetScan:
    """Stand in the middle of the street; the sensor is `height` over the ground."""
    boxes = [
        ((0.0, 0.0, 50.0), (0.1, 0.1, 0.1)),  # the carrier: out of sight, under the ground
        ((0.0, 0.0, height + 0.5), (400.0, 400.0, 1.0)),
        *(((x, -y, height - 0.85), (4.2, 1.8, 1.3)) for x, y in CARS),
        *(((x, -y, height - 2.0), (0.25, 0.25, 4.0)) for x, y in POLES),
        *(((0.0, -y, height - 2.5), (120.0, 0.5, 5.0)) for y in WALLS),
    ]
    shapes = tuple(boxes_shape(np.array([c]), np.array([s]), np.zeros(1)) for c, s in boxes)
    count = len(shapes)
    bodies = Bodies(
        shape=np.arange(count, dtype=np.int32),
        position_N=np.zeros((count, 3)),
        R_NB=np.tile(np.eye(3), (count, 1, 1)),
        water_z=np.full(count, 100.0),
    )
    scan = Lidar(sensor, LidarSettings(), shapes).scan(bodies, 0, 0, np.random.default_rng(1))
    points_S = scan.cloud.points_S
    elevation = np.arctan2(-points_S[:, 2], np.hypot(points_S[:, 0], points_S[:, 1]))
    ring = np.abs(elevation[:, None] - sensor.elevations).argmin(axis=1).astype(np.uint16)
    return StreetScan(
        points=points_S * np.array([1, -1, -1], np.float32), ring=ring, body=scan.object_ids
    )
