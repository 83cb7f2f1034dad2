"""What the turning of a LiDAR within its scan does to objects, and what deskewing leaves of it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from msgspec import structs
from numpy.random import Generator

from twinscrew.hil_sim.bench.perception_scenes import Scene, open_scene
from twinscrew.hil_sim.bodies import Bodies
from twinscrew.hil_sim.lidar import Lidar, LidarSettings
from twinscrew.runtime.geometry import quaternion_from_euler
from twinscrew.runtime.messages.types import Float64, Objects
from twinscrew.runtime.perception.segmentation import Perception
from twinscrew.runtime.perception.sensor import Sensor, load_sensor

YAW_RATE = 1.0
"""[rad/s] Of the WAM-V with -500 and 1000 N, steady; its speed ahead is then `SURGE`."""
SURGE = 0.58
"""[m/s]"""
SCENES = 40
NOW_NS = 1_000_000_000
MATCH_M = 3.0
"""[m] Objects farther apart are not the same: vessels are 1 m apart at least."""
LEVEL = quaternion_from_euler(0.0, 0.0, 0.0)


def run_deskew(scenes: int = SCENES) -> dict[str, float]:
    """Measure how far objects are off where a scan taken at once shows them, median and p95 [m].

    A VLP-16 on a vessel at its full rate of turn, among vessels and buoys; "skewed" takes no
    motion out, "deskewed" is told the rates and the velocity.
    """
    sensor = structs.replace(load_sensor("vlp16"), mount=load_sensor("vrx16").mount)
    rng = np.random.default_rng(2)
    skewed, deskewed = (np.concatenate(e) for e in zip(*_errors(sensor, rng, scenes), strict=True))
    return {
        "objects": len(skewed),
        "yaw_rate_radps": YAW_RATE,
        "skewed_p50_m": round(float(np.median(skewed)), 3),
        "skewed_p95_m": round(float(np.percentile(skewed, 95)), 3),
        "deskewed_p50_m": round(float(np.median(deskewed)), 3),
        "deskewed_p95_m": round(float(np.percentile(deskewed, 95)), 3),
    }


def _errors(sensor: Sensor, rng: Generator, scenes: int) -> list[tuple[Float64, Float64]]:
    still = structs.replace(sensor, scan_duration_s=0.0)
    at_once, turning = Perception(still), Perception(sensor)
    rates_B, velocity_B = np.array([0.0, 0.0, YAW_RATE]), np.array([SURGE, 0.0, 0.0])
    errors = []
    for _ in range(scenes):
        scene = open_scene(rng)
        bodies = _level(scene)
        shapes, settings = scene.shapes, LidarSettings()
        scan = Lidar(sensor, settings, shapes).scan(_moving(bodies), 0, NOW_NS, rng)
        then = _moving(bodies).moved((scan.cloud.stamp_ns - NOW_NS) * 1e-9)
        truth = at_once.step(Lidar(still, settings, shapes).scan(then, 0, 0, rng).cloud, LEVEL)
        raw = turning.step(scan.cloud, LEVEL)
        clean = turning.step(scan.cloud, LEVEL, rates_B, velocity_B)
        errors.append(_offsets(truth, raw, clean))
    return errors


def _level(scene: Scene) -> Bodies:
    """Give the scene's bodies, the own vessel upright: it turns about the vertical."""
    R_NB = scene.bodies.R_NB.copy()
    R_NB[0] = np.eye(3)
    return replace(scene.bodies, R_NB=R_NB)


def _moving(bodies: Bodies) -> Bodies:
    """Let body 0 turn and go ahead; all else stands still."""
    velocity_N, rates_B = np.zeros((2, len(bodies.shape), 3))
    velocity_N[0] = bodies.R_NB[0] @ [SURGE, 0.0, 0.0]
    rates_B[0, 2] = YAW_RATE
    return replace(bodies, velocity_N=velocity_N, rates_B=rates_B)


def _offsets(truth: Objects, raw: Objects, clean: Objects) -> tuple[Float64, Float64]:
    """Give how far raw and clean objects are from those of the truth that all three show."""
    pairs = [(_nearest(p, raw), _nearest(p, clean)) for p in truth.p_L]
    near = np.array([pair for pair in pairs if max(pair) < MATCH_M]).reshape(-1, 2)
    return near[:, 0], near[:, 1]


def _nearest(p_L: Float64, objects: Objects) -> float:
    return float(np.hypot(*(objects.p_L - p_L).T).min(initial=np.inf))
