"""Scripted ships: how they move, what they look like, what it is to touch them."""

import math
from dataclasses import replace

import numpy as np
import pytest

from twinscrew.hil_sim.scenario import load_scenario
from twinscrew.hil_sim.traffic import Traffic, TrafficEntry
from twinscrew.hil_sim.world import make_world
from twinscrew.runtime.errors import ConfigError


def entry(**more) -> TrafficEntry:
    given = {
        "start_m": (0.0, 0.0),
        "course_deg": 90.0,
        "speed_mps": 4.0,
        "length_m": 20.0,
        "beam_m": 6.0,
    }
    return TrafficEntry(**(given | more))


def sailed(seconds, **more) -> Traffic:
    traffic = Traffic([entry(**more)])
    for _ in range(round(20 * seconds)):
        traffic.step(0.05)
    return traffic


def test_a_ship_keeps_course_and_speed():
    traffic = sailed(30)
    np.testing.assert_allclose(traffic.position_N[0], (0.0, 120.0), atol=1e-9)
    np.testing.assert_allclose(traffic.velocity_N[0], (0.0, 4.0), atol=1e-12)


def test_before_the_first_step_it_lies_still():
    traffic = Traffic([entry()])
    assert not traffic.velocity_N.any()


def test_one_that_manoeuvres_alters_course_in_time_and_not_at_once():
    before, soon, late = (sailed(t, behaviour="manoeuvre") for t in (9.9, 12.0, 60.0))
    assert before.heading[0] == pytest.approx(math.pi / 2)
    assert math.radians(91) < soon.heading[0] < math.radians(140)
    assert late.heading[0] == pytest.approx(math.radians(150))
    assert np.hypot(*late.velocity_N[0]) == pytest.approx(4.0)


def test_one_that_stops_loses_its_way_and_keeps_its_course():
    traffic = sailed(100, behaviour="stop")
    assert not traffic.velocity_N.any()
    assert traffic.position_N[0, 0] == pytest.approx(0.0, abs=1e-9)
    assert 40.0 + 70.0 < traffic.position_N[0, 1] < 40.0 + 90.0


def test_one_that_drifts_points_elsewhere_than_it_goes():
    traffic = sailed(10, behaviour="drift", speed_mps=0.5, heading_deg=30.0)
    assert traffic.heading[0] == pytest.approx(math.radians(30))
    np.testing.assert_allclose(traffic.position_N[0], (0.0, 5.0), atol=1e-9)


def test_it_visits_its_waypoints_in_order_and_goes_on():
    places = [(0.0, 80.0), (200.0, 80.0)]
    traffic, nearest = Traffic([entry(waypoints=tuple(places))]), np.full(2, np.inf)
    for _ in range(20 * 100):
        traffic.step(0.05)
        nearest = np.minimum(nearest, np.hypot(*(traffic.position_N[0] - places).T))
    assert (nearest <= 12.0).all()
    assert np.hypot(*traffic.velocity_N[0]) == pytest.approx(4.0)


@pytest.mark.parametrize("bad", [{"length_m": 2.0, "beam_m": 3.0}, {"behaviour": "flee"}])
def test_a_ship_that_cannot_be_is_refused(tmp_path, bad):
    file = tmp_path / "scenario.toml"
    keys = {"length_m": 20.0, "beam_m": 6.0} | bad
    words = "".join(f"{key} = {value!r}\n" for key, value in keys.items())
    file.write_text(
        "[[vessel]]\nstart_m = [0, 0]\nheading_deg = 0\ngoal_m = [9, 9]\n[[traffic]]\n"
        f"start_m = [0, 50]\ncourse_deg = 0\nspeed_mps = 1.0\n{words}"
    )
    with pytest.raises(ConfigError, match=r"beam_m must|behaviour"):
        load_scenario(file)


def scenario(**more):
    made = load_scenario("ship_crossing")
    return replace(made, sea="calm", traffic=(entry(**more),))


def test_the_lidar_sees_a_hull_of_the_ships_size():
    world = make_world(scenario(start_m=(20.0, 45.0), course_deg=90.0), sensor="vrx32")
    world.moor(0, np.array([5.0, 45.0]))
    scan = world.cloud(0)
    points = scan.points_S[np.isfinite(scan.points_S).all(axis=1)]
    side = points[(points[:, 0] > 8.0) & (points[:, 2] < 1.0)]
    assert len(side) > 300
    # 20 m wide, 12 m ahead: its side is seen from end to end.
    assert 17.0 < np.ptp(side[:, 1]) <= 20.5


def test_traffic_waits_for_the_first_vessel_to_be_released():
    world = make_world(scenario())
    world.moor(0, np.array([5.0, 45.0]))
    world.advance(1.0, np.zeros((1, 2)))
    assert world.traffic.position_N[0].tolist() == [0.0, 0.0]
    world.release(0)
    world.advance(1.0, np.zeros((1, 2)))
    assert world.traffic.position_N[0, 1] == pytest.approx(4.0)


def test_the_gap_to_a_ship_is_the_distance_to_its_rectangle():
    world = make_world(scenario(start_m=(25.0, 45.0)))  # across the way, 20 m ahead
    radius = max(r for _, r in world.vessels[0].circles_m)
    assert world.gaps.shape == (1, 2)
    assert world.gaps[0, 1] == pytest.approx(20.0 - 3.0 - radius, abs=0.3)
    world = make_world(scenario(start_m=(5.0, 52.0)))
    assert world.nearest[0] < 0.0
