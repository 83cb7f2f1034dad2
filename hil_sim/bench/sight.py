"""How far vessels are seen, and what is said of what moves and what stands out there.

`reach`: scans of one vessel alone, at each distance with random headings and tilts. `passages`: a
vessel goes past at random, in open water and along a quay of 150 m behind it.
"""

from __future__ import annotations

from collections import defaultdict
from typing import Any

import numpy as np
from numpy.random import Generator

from twinscrew.hil_sim.bench.harbour_scenes import (
    OWN,
    PASSAGE_S,
    SCAN_S,
    Body,
    make_quay,
    sights,
)
from twinscrew.hil_sim.bench.perception_scenes import AFLOAT, HEAVE, TILT
from twinscrew.hil_sim.bodies import Bodies
from twinscrew.hil_sim.lidar import Lidar, LidarSettings
from twinscrew.hil_sim.shapes import Shape, load_shape, vessel_shape
from twinscrew.hil_sim.traffic import TrafficEntry, shape_of
from twinscrew.runtime.geometry import quaternion_from_euler, rotation_from_quaternion
from twinscrew.runtime.messages.types import Float64
from twinscrew.runtime.perception.segmentation import Perception
from twinscrew.runtime.perception.sensor import Mount, Sensor, load_sensor
from twinscrew.runtime.tracking.lidar import SensorView
from twinscrew.runtime.tracking.tracker import Tracker
from twinscrew.runtime.vessel_description import load_vessel

SENSORS = ("vrx16", "vrx32", "vlp16", "hdl32e", "os1_64")
MOUNT = Mount(x_m=0.43, y_m=0.0, z_m=1.93)
"""Of those whose descriptions have none."""
DISTANCES_M = (15, 20, 25, 30, 35, 40, 45, 50, 55)
SCANS = 12
"""[-] Of each vessel at each distance, by each sensor."""
SIZES_M = {"boat of 4 m": (4.0, 1.6), "boat of 8 m": (8.0, 2.8), "ship of 20 m": (20.0, 5.5)}
"""[m] Length and beam."""
SPEEDS_MPS = (1.5, 3.0, 5.0)
PASSAGES = 8
SETTLE_S = 3.0
"""[s] What is reported before is not judged: an outline is known after a second or two."""
NEAR_M = 3.0
"""[m] A track this near a hull's outline is one of it."""
BANDS_M = (0.0, 20.0, 40.0, 60.0)


def run() -> dict[str, Any]:
    """Measure: {"reach": {sensor: {vessel: {distance: share}}}, "passages": {what: figures}}."""
    rng = np.random.default_rng(0)
    reach = {name: _reach(_mounted(name), rng) for name in SENSORS}
    return {"sight": {"reach": reach, "passages": _passages(_mounted("vrx32"))}}


def _mounted(name: str) -> Sensor:
    sensor = load_sensor(name)
    return sensor if sensor.mount is not None else sensor.mounted(MOUNT)


def ship_shape(length_m: float, beam_m: float) -> Shape:
    """Give what a scripted ship of a size looks like."""
    return shape_of(
        TrafficEntry(
            start_m=(0.0, 0.0), course_deg=0.0, speed_mps=0.0, length_m=length_m, beam_m=beam_m
        )
    )


def _reach(sensor: Sensor, rng: Generator) -> dict[str, dict[str, float]]:
    """Give the share of scans in which a vessel is an object, by vessel and distance."""
    perception, own = Perception(sensor), vessel_shape(load_vessel())
    kinds = {"buoy": load_shape("light_buoy"), "WAM-V": own}
    kinds |= {name: ship_shape(*size) for name, size in SIZES_M.items()}
    table: dict[str, dict[str, float]] = {}
    for name, shape in kinds.items():
        lidar = Lidar(sensor, LidarSettings(), (own, shape))
        table[name] = {
            f"{distance} m": float(
                np.mean([_is_seen(perception, lidar, distance, rng) for _ in range(SCANS)])
            )
            for distance in DISTANCES_M
        }
    return table


def _is_seen(perception: Perception, lidar: Lidar, distance: float, rng: Generator) -> bool:
    bearing, yaw = rng.uniform(-np.pi, np.pi, 2)
    place = distance * np.array([np.cos(bearing), np.sin(bearing)])
    roll, pitch = rng.normal(0.0, TILT, 2).tolist()
    q_NB = quaternion_from_euler(roll, pitch, 0.0)
    other = quaternion_from_euler(0.0, 0.0, yaw)
    bodies = Bodies(
        shape=np.array([0, 1], dtype=np.int32),
        position_N=np.array([[0.0, 0.0, AFLOAT + rng.normal(0.0, HEAVE)], [*place, 0.0]]),
        R_NB=np.array([rotation_from_quaternion(q) for q in (q_NB, other)]),
        water_z=np.zeros(2),
    )
    scan = lidar.scan(bodies, OWN, 0, rng)
    return len(perception.step(scan.cloud, q_NB).radius) > 0


def _passages(sensor: Sensor) -> dict[str, dict[str, float]]:
    """Give how well vessels that pass are known, and what is said of the quay behind them."""
    movers: dict[str, list[tuple[int, float]]] = defaultdict(list)
    quays: dict[str, list[float]] = defaultdict(list)
    for size in SIZES_M:
        for seed in range(PASSAGES):
            for has_quay in (False, True):
                rng = np.random.default_rng(seed)
                bodies = _passage(rng, SIZES_M[size], has_quay=has_quay)
                _score(sensor, bodies, rng, size, movers, quays)
    figures: dict[str, dict[str, float]] = {}
    for name, rows in sorted(movers.items()):
        counts, errors = np.array(rows).T
        figures[name] = {
            "scans": len(rows),
            "seen_share": float(np.mean(counts > 0)),
            "tracks_mean": float(counts[counts > 0].mean()),
            "velocity_error_median_mps": float(np.nanmedian(errors)),
            "velocity_error_p90_mps": float(np.nanpercentile(errors, 90)),
        }
    for name, speeds in sorted(quays.items()):
        fast = np.array(speeds)
        figures[name] = {
            "reports": len(fast),
            "fast_share": float(np.mean(fast > 1.0)),
            "speed_rms_mps": float(np.sqrt(np.mean(fast**2))),
        }
    return figures


def _passage(rng: Generator, size: tuple[float, float], *, has_quay: bool) -> list[Body]:
    """Give the own vessel, one that goes past at 12 to 45 m, and a quay beyond her way."""
    speed, heading = rng.choice(SPEEDS_MPS), rng.uniform(-np.pi, np.pi)
    side = np.array([-np.sin(heading), np.cos(heading)])
    abeam = rng.uniform(12.0, 45.0)
    bodies = [
        Body(vessel_shape(load_vessel()), np.zeros(2), 0.0, rng.uniform(1.0, 2.0), tilts=True),
        Body(ship_shape(*size), abeam * side, heading, float(speed)),
    ]
    if has_quay:
        off = abeam + 0.5 * size[1] + rng.uniform(4.0, 15.0) + 2.0
        bodies.append(Body(make_quay(150.0, rng.uniform(0.8, 2.5)), off * side, heading))
    return bodies


def _score(
    sensor: Sensor,
    bodies: list[Body],
    rng: Generator,
    size: str,
    movers: dict[str, list[tuple[int, float]]],
    quays: dict[str, list[float]],
) -> None:
    tracker = Tracker(view=SensorView.of(sensor))
    where = "open water" if len(bodies) == 2 else "before a quay"
    for number, sight in enumerate(sights(sensor, bodies, rng)):
        tracks = tracker.step(sight.objects, sight.odometry)
        time_s = number * SCAN_S
        if time_s < SETTLE_S:
            continue
        places = [b.start_N + (time_s - PASSAGE_S / 2) * b.v_N for b in bodies]
        own_N = sight.odometry.position_N[:2]
        gaps = np.array(
            [
                [_gap(p_N, b, place) for b, place in zip(bodies[1:], places[1:], strict=True)]
                for p_N in tracks.p_N
            ]
        ).reshape(-1, len(bodies) - 1)
        whose = np.where(gaps.min(axis=1) <= NEAR_M, gaps.argmin(axis=1) + 1, 0)
        mine = whose == 1
        away = float(np.hypot(*(places[1] - own_N)))
        if away < BANDS_M[-1]:
            errors = np.hypot(*(tracks.v_N[mine] - bodies[1].v_N).T)
            worst = float(errors.max()) if mine.any() else np.nan
            movers[f"{size}, {where}, {_band(away)}"].append((int(mine.sum()), worst))
        for p_N, v_N in zip(tracks.p_N[whose == 2], tracks.v_N[whose == 2], strict=True):
            distance = float(np.hypot(*(p_N - own_N)))
            quays[f"quay behind, {_band(min(distance, 59.9))}"].append(float(np.hypot(*v_N)))


def _band(distance: float) -> str:
    k = int(np.searchsorted(BANDS_M, distance, side="right"))
    return f"{BANDS_M[k - 1]:.0f} to {BANDS_M[k]:.0f} m"


def _gap(p_N: Float64, body: Body, place: Float64) -> float:
    """[m] Give how far a place lies outside of the hull of a body."""
    d = p_N - place
    c, s = np.cos(body.heading), np.sin(body.heading)
    beyond = np.abs([c * d[0] + s * d[1], c * d[1] - s * d[0]]) - body.shape.halves[0][:2]
    return float(np.hypot(*np.maximum(beyond, 0.0)))
