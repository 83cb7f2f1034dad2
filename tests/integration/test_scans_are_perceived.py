"""The simulator's scans through the runtime's perception."""

from __future__ import annotations

import numpy as np
import pytest

from twinscrew.hil_sim.lidar import LidarSettings
from twinscrew.hil_sim.scenario import load_scenario
from twinscrew.hil_sim.world import World, WorldSettings, make_world
from twinscrew.runtime.geometry import rotation_2d
from twinscrew.runtime.messages.types import Float64
from twinscrew.runtime.perception.segmentation import Perception
from twinscrew.runtime.perception.sensor import load_sensor

NEAR_M = 18.0
"""[m] Within perception's 20 m with all their points."""


def surely_visible(world: World, vessel: int) -> Float64:
    """North and east of the vessels and buoys that are near."""
    places_N = np.vstack([world.state.position_N[:, :2], world.scenario.buoys[:, :2]])
    others = np.delete(places_N, vessel, axis=0)
    near = np.linalg.norm(others - places_N[vessel], axis=1) < NEAR_M
    return others[near]


@pytest.mark.parametrize("water_echoes", [0.0, 0.5])
@pytest.mark.parametrize("sensor", ["vrx32", "vrx16"])
def test_vessels_and_buoys_near_by_are_found_and_the_water_is_not(
    sensor: str, water_echoes: float
) -> None:
    settings = WorldSettings(lidar=LidarSettings(water_echoes=water_echoes))
    perception = Perception(load_sensor(sensor))
    visible, found, spurious = 0, 0, 0
    for seed in range(4):
        world = make_world(load_scenario("random", 5, 4, seed), sensor=sensor, settings=settings)
        world.advance(5.0, np.zeros((5, 2)))
        places_N = np.vstack([world.state.position_N[:, :2], world.scenario.buoys[:, :2]])
        for i in range(5):
            objects = perception.step(world.cloud(i), world.state.q_NB[i])
            turn = rotation_2d(float(world.state.heading[i]))
            objects_N = objects.p_L @ turn.T + places_N[i]
            for place_N in surely_visible(world, i):
                visible += 1
                found += (np.linalg.norm(objects_N - place_N, axis=1) < 2.0).any()
            off = np.linalg.norm(objects_N[:, None] - places_N, axis=2).min(axis=1) > 3.5
            spurious += int(off.sum())
    assert visible > 10
    assert found >= 0.9 * visible
    assert spurious == 0
