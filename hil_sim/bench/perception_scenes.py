"""Random scenes with a known truth, for scoring perception: vessels, buoys and quays in waves."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.random import Generator

from twinscrew.hil_sim.bodies import Bodies
from twinscrew.hil_sim.lidar import Lidar, LidarSettings, Scan
from twinscrew.hil_sim.shapes import Shape, boxes_shape, load_shape, vessel_shape
from twinscrew.runtime.geometry import quaternion_from_euler, rotation_from_quaternion
from twinscrew.runtime.messages.types import Float64
from twinscrew.runtime.perception.sensor import Sensor
from twinscrew.runtime.vessel_description import load_vessel

VESSEL, BUOY, QUAY = 0, 1, 2
"""Numbers of the shapes; every quay is a shape of its own from `QUAY` on."""
RADII = {VESSEL: 2.8, BUOY: 0.75}
"""[m] Collision radii (parameters.md)."""
AFLOAT = 0.112
"""[m] How deep a WAM-V's origin lies under the surface at rest (hil_sim.vessel.rest)."""
TILT = np.radians(2.0)
"""[rad] Standard deviation of roll and pitch in a sea as the paper's."""
HEAVE = 0.08
"""[m] Standard deviation of heave against the local surface."""
QUAY_HEIGHT = 1.5
"""[m] Over the still water."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Scene:
    """What stands where; body 0 carries the sensor."""

    bodies: Bodies
    shapes: tuple[Shape, ...]
    q_NB: Float64
    """(4,) Attitude of body 0."""

    def scan(self, sensor: Sensor, settings: LidarSettings, rng: Generator) -> Scan:
        """Give the scan that body 0 takes."""
        lidar = Lidar(sensor, settings, self.shapes)
        return lidar.scan(self.bodies, 0, 0, rng)


def open_scene(rng: Generator) -> Scene:
    """Up to four vessels and four buoys within 5 to 20 m, no two nearer than 1 m."""
    return _scene(rng, quays=np.empty((0, 3)))


def harbour_scene(rng: Generator) -> Scene:
    """As the open scene, between one to three quays of 20 to 60 m, from 6 to 16 m off."""
    count = int(rng.integers(1, 4))
    turns = rng.uniform(-np.pi, np.pi) + np.arange(count) * np.pi / 2
    offsets, lengths = rng.uniform(6.0, 16.0, count), rng.uniform(20.0, 60.0, count)
    return _scene(rng, quays=np.column_stack([turns, offsets, lengths]))


def _scene(rng: Generator, quays: Float64) -> Scene:
    kinds = [VESSEL] * int(rng.integers(1, 5)) + [BUOY] * int(rng.integers(0, 5))
    placed = [(VESSEL, np.zeros(2))]
    for kind in kinds:
        place = _free_place(rng, kind, placed, quays)
        if place is not None:
            placed.append((kind, place))
    shape = [kind for kind, _ in placed] + [QUAY + i for i in range(len(quays))]
    places = np.array([place for _, place in placed] + [np.zeros(2)] * len(quays))
    return _afloat(rng, np.array(shape, dtype=np.int32), places, quays)


def _free_place(
    rng: Generator, kind: int, placed: list[tuple[int, Float64]], quays: Float64
) -> Float64 | None:
    """Give a place clear of everything, evenly spread over distance; none after 100 tries."""
    for _ in range(100):
        bearing, distance = rng.uniform(-np.pi, np.pi), rng.uniform(5.0, 20.0)
        place = distance * np.array([np.cos(bearing), np.sin(bearing)])
        apart = [np.hypot(*(place - p)) - RADII[kind] - RADII[k] for k, p in placed]
        ashore = [offset - place @ _normal(turn) - RADII[kind] for turn, offset, _ in quays]
        if min(apart) >= 1.0 and min(ashore, default=np.inf) >= 1.0:
            return place
    return None


def _normal(turn: float) -> Float64:
    return np.array([np.cos(turn), np.sin(turn)])


def _quay(turn: float, offset: float, length: float) -> Shape:
    """Give a quay 4 m wide whose face is `offset` off in direction `turn`."""
    centre = np.append((offset + 2.0) * _normal(turn), 0.5 - QUAY_HEIGHT / 2)
    size = np.array([[4.0, length, QUAY_HEIGHT + 1.0]])
    return boxes_shape(centre[None], size, np.array([turn]))


def _afloat(
    rng: Generator,
    shape: np.ndarray[tuple[int], np.dtype[np.int32]],
    places: Float64,
    quays: Float64,
) -> Scene:
    """Put the bodies at random attitudes and heights on the water; the quays stand still."""
    count, afloat = len(shape), shape < QUAY
    roll, pitch = rng.normal(0.0, TILT, (2, count)) * (shape == VESSEL)
    yaw = rng.uniform(-np.pi, np.pi, count) * afloat
    heave = rng.normal(0.0, HEAVE, count) * afloat
    position = np.column_stack([places, heave + AFLOAT * (shape == VESSEL)])
    q = [quaternion_from_euler(*angles) for angles in zip(roll, pitch, yaw, strict=True)]
    bodies = Bodies(
        shape=shape,
        position_N=position,
        R_NB=np.array([rotation_from_quaternion(q_NB) for q_NB in q]),
        water_z=np.zeros(count),
    )
    shapes = (vessel_shape(load_vessel()), load_shape("light_buoy"), *map(_quay, *quays.T))
    return Scene(bodies=bodies, shapes=shapes, q_NB=q[0])
