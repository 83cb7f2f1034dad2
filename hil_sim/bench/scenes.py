"""Clouds to measure time with: open water as simulated, and basins that fill the image."""

from __future__ import annotations

import numpy as np

from twinscrew.hil_sim.scenario import load_scenario
from twinscrew.hil_sim.world import make_world
from twinscrew.runtime.messages.types import Float64, Odometry, PointCloud
from twinscrew.runtime.perception.sensor import Sensor

WALL_M = (5.0, 9.0)
"""[m] Nearest and farthest wall of a basin: so near that no beam meets the water before it."""
PILES = 12
"""[-] Round piles standing in the basin."""
LAYOUT = 7
"""[-] Seed of the basin's walls and piles."""


def open_water(count: int, seed: int = 0) -> list[tuple[PointCloud, Odometry]]:
    """Give successive scans of one of 5 vessels among 4 buoys in the paper's sea, with odometry."""
    world = make_world(load_scenario("passage"), seed=seed)
    thrust = np.tile([600.0, 600.0], (world.scenario.vessels, 1))
    scans: list[tuple[PointCloud, Odometry]] = []
    for _ in range(count):
        world.advance(0.1, thrust)
        scans.append((world.cloud(0), world.odometry(0)))
    return scans


def basin(sensor: Sensor, points: int, seed: int) -> PointCloud:
    """Give a scan in which a given number of beams return: wavy walls, and piles before them.

    The basin is always the same; the noise is the seed's.
    """
    azimuths = np.asarray(sensor.azimuths, dtype=np.float64)
    distance = _basin(azimuths)
    noise = np.random.default_rng(seed)
    ranges = distance[None, :] / np.cos(sensor.elevations)[:, None]
    ranges = ranges + sensor.noise_sigma_m * noise.standard_normal(ranges.shape)
    cloud = (sensor.directions_S() * ranges[..., None]).astype(np.float32)
    columns = round(points / len(sensor.elevations))
    kept = np.ascontiguousarray(cloud[:, :columns].reshape(-1, 3))
    return PointCloud(
        stamp_ns=0,
        frame_id="lidar",
        points_S=kept,
        intensity=np.full(len(kept), 100.0, dtype=np.float32),
    )


def _basin(azimuths: Float64) -> Float64:
    """Give the horizontal distance [m] of what stands in each direction."""
    rng = np.random.default_rng(LAYOUT)
    distance = _wall(azimuths, rng)
    for centre in rng.uniform(-np.pi, np.pi, PILES):
        near = np.abs((azimuths - centre + np.pi) % (2 * np.pi) - np.pi) < rng.uniform(0.02, 0.1)
        distance = np.where(near, distance * rng.uniform(0.6, 0.9), distance)
    return distance


def _wall(azimuths: Float64, rng: np.random.Generator) -> Float64:
    near, far = WALL_M
    waves = np.zeros_like(azimuths)
    for k in (2, 3, 5, 8):
        waves += np.sin(k * azimuths + rng.uniform(0, 2 * np.pi)) / k
    unit = (waves - waves.min()) / np.ptp(waves)
    wall: Float64 = near + (far - near) * unit
    return wall
