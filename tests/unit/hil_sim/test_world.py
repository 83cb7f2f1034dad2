from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from twinscrew.hil_sim.lidar import LidarSettings
from twinscrew.hil_sim.odometry import OdometrySettings
from twinscrew.hil_sim.scenario import Scenario, load_scenario
from twinscrew.hil_sim.world import EPOCH_NS, World, WorldSettings, make_world
from twinscrew.runtime.errors import ConfigError

NOISY = WorldSettings(
    lidar=LidarSettings(dropout=0.1, water_echoes=0.1),
    odometry=OdometrySettings(position_sigma_m=0.1),
)
OFF = np.zeros((2, 2))


def calm(name: str = "head_on", **changes: object) -> Scenario:
    return dataclasses.replace(load_scenario(name), sea="calm", **changes)


def history(world: World) -> list[np.ndarray]:
    """Everything a world says in two seconds."""
    said = []
    commands = np.full((world.scenario.vessels, 2), [800.0, 600.0])
    for _ in range(20):
        world.advance(0.1, commands)
        said += [world.state.position_N, world.state.q_NB]
        for vessel in range(world.scenario.vessels):
            said += [world.cloud(vessel).points_S, world.odometry(vessel).position_N]
    return said


def test_the_same_seed_gives_the_same_world_to_the_last_bit() -> None:
    scenario = load_scenario("random", 3, 2, seed=1)
    first = history(make_world(scenario, sensor="vrx16", seed=7, settings=NOISY))
    again = history(make_world(scenario, sensor="vrx16", seed=7, settings=NOISY))
    other = history(make_world(scenario, sensor="vrx16", seed=8, settings=NOISY))
    assert all(np.array_equal(a, b) for a, b in zip(first, again, strict=True))
    assert not np.array_equal(first[2], other[2])


def test_a_vessels_noise_does_not_depend_on_what_the_others_are_asked() -> None:
    alone, busy = (make_world(calm(), settings=NOISY) for _ in range(2))
    for _ in range(3):
        busy.cloud(0)
        busy.odometry(0)
    np.testing.assert_array_equal(alone.cloud(1).points_S, busy.cloud(1).points_S)
    np.testing.assert_array_equal(alone.odometry(1).position_N, busy.odometry(1).position_N)


def test_vessels_do_not_share_their_noise() -> None:
    world = make_world(calm(), settings=NOISY)
    error = [world.odometry(i).position_N - world.state.position_N[i] for i in range(2)]
    assert not np.array_equal(error[0], error[1])


def test_time_is_an_exact_count_of_steps_from_the_epoch() -> None:
    world = make_world(calm(), epoch_ns=1000)
    assert (world.stamp_ns, world.time_s) == (1000, 0.0)
    for _ in range(7):
        world.advance(0.1, OFF)
    assert world.stamp_ns == 1000 + 700_000_000
    assert world.cloud(0).stamp_ns == world.odometry(1).stamp_ns == world.stamp_ns
    assert make_world(calm()).stamp_ns == EPOCH_NS


def test_a_duration_that_is_no_whole_number_of_steps_is_refused() -> None:
    world = make_world(calm())
    for duration in (0.015, -0.1, float("nan")):
        with pytest.raises(ValueError, match="whole number of steps"):
            world.advance(duration, OFF)


@pytest.mark.parametrize("commands", [np.zeros((1, 2)), np.full((2, 2), np.nan), np.zeros(4)])
def test_commands_that_are_none_are_refused(commands: np.ndarray) -> None:
    with pytest.raises(ValueError, match="2 pairs of finite numbers"):
        make_world(calm()).step(commands)


def test_vessels_start_where_the_scenario_says_at_rest_and_stay_there_in_a_calm() -> None:
    world = make_world(calm("crossing"))
    start = world.state
    np.testing.assert_array_equal(start.position_N[:, :2], world.scenario.starts[:, :2])
    np.testing.assert_allclose(start.heading, world.scenario.starts[:, 2], atol=1e-9)
    world.advance(2.0, OFF)
    np.testing.assert_allclose(world.state.position_N, start.position_N, atol=1e-3)


def test_commands_drive_left_and_right() -> None:
    world = make_world(calm())
    world.advance(2.0, np.array([[500.0, 500.0], [300.0, -300.0]]))
    assert world.state.velocity_B[0, 0] > 1.0
    assert world.state.rates_B[1, 2] > 0.1  # more on the left turns to starboard
    assert world.state.position_N[0, 0] > 8.0


def test_weak_engines_give_no_more_than_their_limit() -> None:
    world = make_world(calm("overtaking"))
    world.advance(0.1, np.full((2, 2), 900.0))
    np.testing.assert_allclose(world.state.thrust, [[900.0, 900.0], [150.0, 150.0]])
    world.advance(0.1, np.full((2, 2), -400.0))
    np.testing.assert_allclose(world.state.thrust, [[-400.0, -400.0], [-150.0, -150.0]])


def test_the_closest_approach_is_kept_when_vessels_part_again() -> None:
    world = make_world(calm())
    ahead, astern = np.full((2, 2), 1000.0), np.full((2, 2), -500.0)
    gap = np.linalg.norm(np.diff(world.scenario.starts[:, :2], axis=0)) - 2 * 2.8
    assert world.closest_approach == pytest.approx([gap, gap])
    world.advance(3.0, ahead)
    world.advance(8.0, astern)
    nearest = world.closest_approach
    assert nearest[0] == nearest[1] < world.gaps[0, 1] - 1.0
    assert nearest[0] < gap - 5.0


def test_a_moored_vessel_stays_at_its_mooring_in_wind_and_waves() -> None:
    world = make_world(load_scenario("head_on"))
    world.moor(0, world.scenario.starts[0, :2])
    world.advance(30.0, np.full((2, 2), 1000.0))
    offset = world.state.position_N[0, :2] - world.scenario.starts[0, :2]
    assert np.linalg.norm(offset) < 1.0
    assert abs(world.state.heading[0] - world.scenario.starts[0, 2]) < 0.2
    assert (world.state.thrust[0] == 0).all()
    assert np.abs(world.state.velocity_B[0, 2]) > 0  # it still heaves
    assert np.linalg.norm(world.state.position_N[1, :2] - world.scenario.starts[1, :2]) > 60


def test_a_released_vessel_obeys_its_commands_again() -> None:
    world = make_world(calm())
    world.moor(0, world.scenario.starts[0, :2])
    world.advance(1.0, np.full((2, 2), 500.0))
    world.release(0)
    world.advance(2.0, np.full((2, 2), 500.0))
    assert world.state.velocity_B[0, 0] > 1.0


def test_a_removed_vessel_is_neither_seen_nor_touched() -> None:
    close = calm(starts=np.array([[8.0, 27.5, 0.0], [20.0, 27.5, 0.0]]))
    world = make_world(close)
    assert (world.scan(0).object_ids == 1).any()
    world.remove(1)
    assert not (world.scan(0).object_ids == 1).any()
    world.step(OFF)
    assert np.isinf(world.gaps[0, 1])


def test_quays_and_buoys_are_seen_and_measured() -> None:
    scenario = calm(
        buoys=np.array([[8.0, 40.0, 0.75]]), quays=np.array([[30.0, 27.5, 4.0, 30.0, 3.0, 0.0]])
    )
    world = make_world(scenario)
    assert set(world.scan(0).object_ids.tolist()) >= {2, 3}
    np.testing.assert_allclose(world.gaps[0, 2:], [12.5 - 0.75 - 2.8, 20.0 - 2.8])


def test_an_unknown_sea_is_refused() -> None:
    with pytest.raises(ConfigError, match="'calm', 'paper', 'rough'"):
        make_world(dataclasses.replace(load_scenario("head_on"), sea="stormy"))
