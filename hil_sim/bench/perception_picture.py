"""Pictures of what perception and tracking make of a scan, with the truth."""

from __future__ import annotations

from itertools import islice
from pathlib import Path

import numpy as np

from twinscrew.hil_sim.bench.perception_scenes import QUAY, RADII, harbour_scene
from twinscrew.hil_sim.bench.perception_score import body_frame
from twinscrew.hil_sim.bench.tracking import SENSOR, Look, looks
from twinscrew.hil_sim.lidar import LidarSettings
from twinscrew.hil_sim.perceive.picture import draw
from twinscrew.runtime.geometry import rotation_2d
from twinscrew.runtime.messages.types import Float64, Odometry
from twinscrew.runtime.perception.segmentation import Perception
from twinscrew.runtime.perception.sensor import load_sensor
from twinscrew.runtime.tracking.lidar import SensorView
from twinscrew.runtime.tracking.tracker import Tracker

EPISODE, SCANS = 101, 116
"""[-] Which episode of the tracking bench is drawn, and after how many scans."""
HARBOUR = 4
"""[-] Seed of the harbour that is drawn."""
LIDAR = LidarSettings(water_echoes=0.3)


def draw_all(folder: Path) -> None:
    """Draw open water, with tracks, and a harbour."""
    folder.mkdir(parents=True, exist_ok=True)
    draw_open(folder / "perception_open.png")
    draw_harbour(folder / "perception_harbour.png")


def draw_open(file: Path, scans: int = SCANS) -> None:
    """Draw what one of five vessels under way sees, tracks, and should see."""
    perception = Perception(load_sensor(SENSOR))
    tracker = Tracker(view=SensorView.of(perception.sensor))
    for look in islice(looks(EPISODE, perception=perception), scans):
        tracks, last = tracker.step(look.objects, look.odometry), look
    tracked = _seen_from(last.odometry, tracks.p_N, tracks.v_N, tracks.radius)
    draw(perception, last.cloud, last.objects, file, truth_of(last), tracked)


def truth_of(look: Look) -> Float64:
    """Give what there is around the vessel; see `picture.draw`."""
    truth = look.truth
    radius = np.where(truth.is_vessel > 0, RADII[0], RADII[1])
    return _seen_from(look.odometry, truth.p_N, truth.v_N, radius)


def draw_harbour(file: Path, seed: int = HARBOUR) -> None:
    """Draw one scan between quays, with what is afloat there."""
    rng = np.random.default_rng(seed)
    scene = harbour_scene(rng)
    perception = Perception(load_sensor(SENSOR))
    cloud = scene.scan(perception.sensor, LIDAR, rng).cloud
    objects = perception.step(cloud, scene.q_NB)
    shapes = scene.bodies.shape
    afloat = np.flatnonzero((shapes < QUAY) & (np.arange(len(shapes)) > 0))
    rows = [(*body_frame(scene, int(k)), 0.0, 0.0, RADII[int(shapes[k])]) for k in afloat]
    draw(perception, cloud, objects, file, np.array(rows).reshape(-1, 5))


def _seen_from(odometry: Odometry, p_N: Float64, v_N: Float64, radius: Float64) -> Float64:
    """Give places, velocities over ground and radii, (K, 5), in the vessel's axes."""
    R_NL = rotation_2d(odometry.heading)
    return np.column_stack([(p_N - odometry.position_N[:2]) @ R_NL, v_N @ R_NL, radius])
