"""Passages along quays and past ships, on given paths: all velocities are known.

A vessel rolls and pitches along a quay, in some passages towards a second one across its way, and a
ship of 8 to 25 m passes on the other side, or lies there.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.random import Generator

from twinscrew.hil_sim.bench.perception_scenes import AFLOAT, HEAVE, TILT
from twinscrew.hil_sim.bench.perception_score import echo_counts, labelled_echoes
from twinscrew.hil_sim.bodies import Bodies
from twinscrew.hil_sim.lidar import Lidar, LidarSettings
from twinscrew.hil_sim.shapes import Shape, boxes_shape, vessel_shape
from twinscrew.runtime.geometry import quaternion_from_euler, rotation_from_quaternion
from twinscrew.runtime.messages.types import NANOSECONDS_PER_SECOND, Float64, Objects, Odometry
from twinscrew.runtime.perception.segmentation import Perception
from twinscrew.runtime.perception.sensor import Sensor
from twinscrew.runtime.vessel_description import load_vessel

OWN = 0
"""The row of the vessel that looks."""
PASSAGE_S = 25.0
SCAN_S = 0.1


@dataclass(frozen=True, slots=True)
class Body:
    """What lies or moves straight on."""

    shape: Shape
    start_N: Float64
    """[m] (2,) Its place in the middle of the passage."""
    heading: float
    """[rad]"""
    speed: float = 0.0
    """[m/s] Ahead."""
    tilts: bool = False
    """True if the waves move it."""

    @property
    def v_N(self) -> Float64:
        """[m/s] (2,) Of its place."""
        return self.speed * np.array([np.cos(self.heading), np.sin(self.heading)])


@dataclass(frozen=True, slots=True)
class Sight:
    """One scan, as objects, and of which body each is."""

    objects: Objects
    odometry: Odometry
    body: list[int]
    """(K,) Rows of the bodies that have most of their echoes."""


def passage(rng: Generator) -> list[Body]:
    """Give all bodies; the first is the own vessel."""
    speed = rng.uniform(1.0, 3.0)
    bodies = [Body(vessel_shape(load_vessel()), np.zeros(2), 0.0, speed, tilts=True)]
    height = rng.uniform(0.8, 2.5)
    beside = np.array([rng.uniform(-10.0, 10.0), rng.uniform(7.0, 13.0) + 2.0])
    bodies.append(Body(make_quay(rng.uniform(15.0, 60.0), height), beside, rng.normal(0.0, 0.05)))
    if rng.uniform() < 0.5:
        across = rng.uniform(10.0, 30.0)  # to starboard: the ship passes to port of it
        ahead = np.array([speed * PASSAGE_S / 2 + rng.uniform(8.0, 12.0), across / 2 - 3.0])
        bodies.append(Body(make_quay(across, height), ahead, np.pi / 2))
    length = rng.uniform(8.0, 25.0)
    beam = length * rng.uniform(0.2, 0.3)
    abeam = np.array([0.0, -(beam / 2 + rng.uniform(5.0, 9.0))])
    way = rng.choice([0.0, np.pi]) + rng.normal(0.0, 0.1)
    under_way = rng.uniform(0.5, 4.0) if rng.uniform() < 0.8 else 0.0
    bodies.append(
        Body(_ship(length, beam, rng.uniform(1.0, 3.5)), abeam, way, under_way, tilts=True)
    )
    return bodies


def make_quay(length: float, height: float) -> Shape:
    """Give a quay 4 m wide along x; its top is so far [m] over the water."""
    size = np.array([[length, 4.0, height + 1.0]])
    return boxes_shape(np.array([[0.0, 0.0, (1.0 - height) / 2]]), size, np.zeros(1))


def _ship(length: float, beam: float, freeboard: float) -> Shape:
    """Give a hull, and a house on its after part."""
    centres = [[0.0, 0.0, (0.6 - freeboard) / 2], [-length / 4, 0.0, -freeboard - 1.0]]
    sizes = [[length, beam, freeboard + 0.6], [length / 5, 0.7 * beam, 2.0]]
    return boxes_shape(np.array(centres), np.array(sizes), np.zeros(2))


def sights(sensor: Sensor, bodies: list[Body], rng: Generator) -> Iterator[Sight]:
    """Give what the own vessel sees on its way, which weaves by a metre or two."""
    perception = Perception(sensor)
    lidar = Lidar(sensor, LidarSettings(), tuple(body.shape for body in bodies))
    swells = [_Swell(rng) if body.tilts else None for body in bodies]
    weave, pulse = rng.uniform(0.0, 2.0), 2 * np.pi / rng.uniform(10.0, 20.0)
    for number in range(round(PASSAGE_S / SCAN_S)):
        time_s = number * SCAN_S - PASSAGE_S / 2
        places = np.array([body.start_N + time_s * body.v_N for body in bodies])
        headings = np.array([body.heading for body in bodies])
        places[OWN, 1] = weave * np.sin(pulse * time_s)
        headings[OWN] = np.arctan2(weave * pulse * np.cos(pulse * time_s), bodies[OWN].speed)
        tilts = np.array([np.zeros(3) if s is None else s.at(time_s) for s in swells])
        q_NB = [quaternion_from_euler(*a) for a in zip(*tilts.T[:2], headings, strict=True)]
        position_N = np.column_stack([places, tilts[:, 2]])
        position_N[OWN, 2] += AFLOAT
        odometry = Odometry(
            stamp_ns=round(number * SCAN_S * NANOSECONDS_PER_SECOND),
            position_N=position_N[OWN],
            q_NB=q_NB[OWN],
            velocity_B=np.array([bodies[OWN].speed, 0.0, 0.0]),
            rates_B=np.zeros(3),
        )
        afloat = Bodies(
            shape=np.arange(len(bodies), dtype=np.int32),
            position_N=position_N,
            R_NB=np.array([rotation_from_quaternion(q) for q in q_NB]),
            water_z=np.zeros(len(bodies)),
        )
        scan = lidar.scan(afloat, OWN, odometry.stamp_ns, rng)
        objects = perception.step(scan.cloud, odometry.q_NB)
        counts = echo_counts(*labelled_echoes(perception, scan), len(bodies), len(objects.radius))
        yield Sight(objects, odometry, counts[:-1].argmax(axis=0).tolist())


class _Swell:
    """Roll, pitch and heave of one body: three sines each."""

    def __init__(self, rng: Generator) -> None:
        self._pulse = 2 * np.pi / rng.uniform(2.0, 5.0, (3, 3))
        self._phase = rng.uniform(0.0, 2 * np.pi, (3, 3))

    def at(self, time_s: float) -> Float64:
        """Give roll and pitch [rad] and heave [m], (3,)."""
        unit = np.sqrt(2 / 3) * np.sin(self._pulse * time_s + self._phase).sum(axis=1)
        moved: Float64 = unit * np.array([TILT, TILT, HEAVE])
        return moved
