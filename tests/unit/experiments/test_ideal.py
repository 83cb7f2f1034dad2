"""The truth, as a perception and a tracker would tell it."""

import numpy as np
import pytest

from twinscrew.hil_sim.experiments.episode import TruePerception, TrueTracker, surroundings
from twinscrew.hil_sim.scenario import load_scenario
from twinscrew.hil_sim.world import World, make_world
from twinscrew.runtime.errors import ConfigError
from twinscrew.runtime.geometry import rotation_2d


@pytest.fixture
def world() -> World:
    """The passage after three seconds full ahead."""
    world = make_world(load_scenario("passage"), seed=1)
    world.advance(3.0, np.full((5, 2), 1000.0))
    return world


def test_everything_within_reach_is_there_and_the_vessel_itself_is_not(world: World) -> None:
    around = surroundings(world, 0, 20.0)
    places = np.vstack([world.state.position_N[:, :2], world.scenario.buoys[:, :2]])
    distance = np.hypot(*(places - places[0]).T)
    reach = 20.0 + np.array([2.8] * 5 + [0.75] * 4)
    expected = [i for i in range(1, 9) if distance[i] <= reach[i]]
    assert around.row.tolist() == expected
    assert 0 < len(expected) < 8
    assert np.hypot(*around.p_N.T) == pytest.approx(distance[expected], abs=0.5)  # buoys drift


def test_a_vessel_that_has_left_is_not_seen(world: World) -> None:
    before = surroundings(world, 0, 50.0).row.tolist()
    world.remove(1)
    assert surroundings(world, 0, 50.0).row.tolist() == [row for row in before if row != 1]


def test_perception_gives_places_as_seen_from_the_vessel(world: World) -> None:
    perception = TruePerception(world, 2, 20.0)
    odometry = world.odometry(2)
    objects = perception.step(world.cloud(2), odometry.q_NB)
    back = objects.p_L @ rotation_2d(odometry.heading).T
    assert back == pytest.approx(surroundings(world, 2, 20.0).p_N, abs=1e-9)
    assert set(objects.radius) <= {2.8, 0.75}


def test_tracking_gives_places_and_velocities_over_ground(world: World) -> None:
    odometry = world.odometry(2)
    objects = TruePerception(world, 2, 20.0).step(world.cloud(2), odometry.q_NB)
    tracks = TrueTracker(world, 2, 20.0).step(objects, odometry)
    assert tracks.id.tolist() == surroundings(world, 2, 20.0).row.tolist()
    for id_, p_N, v_N in zip(tracks.id, tracks.p_N, tracks.v_N, strict=True):
        if id_ < 5:
            assert p_N == pytest.approx(world.state.position_N[id_, :2])
            own = world.odometry(int(id_))
            speed = np.hypot(*own.velocity_B[:2])
            assert np.hypot(*v_N) == pytest.approx(speed, abs=0.05)  # but for its tilt
            assert speed > 1.0
        else:
            assert np.hypot(*v_N) == 0.0


def test_quays_are_refused(tmp_path) -> None:
    file = tmp_path / "quay.toml"
    file.write_text(
        "[[vessel]]\nstart_m = [5, 5]\nheading_deg = 0\ngoal_m = [50, 5]\n"
        "[[quay]]\ncentre_m = [30, 20]\nsize_m = [10, 4, 1.5]\n"
    )
    with pytest.raises(ConfigError, match="a quay is no circle"):
        surroundings(make_world(load_scenario(file)), 0, 20.0)
