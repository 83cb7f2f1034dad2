import numpy as np
import pytest

from twinscrew.runtime.errors import ConfigError
from twinscrew.runtime.messages.types import Berth, Goal, Odometry, Station
from twinscrew.runtime.vessel.mission import Mission, MissionSettings


def at(north: float, east: float) -> Odometry:
    return Odometry(
        stamp_ns=3,
        position_N=np.array([north, east, 0.0]),
        q_NB=np.array([1.0, 0, 0, 0]),
        velocity_B=np.zeros(3),
        rates_B=np.zeros(3),
    )


def names(mission: Mission, *places: tuple[float, float]) -> list[str | None]:
    events = [mission.step(at(*place)) for place in places]
    return [event.name if event else None for event in events]


def test_without_a_goal_there_is_nothing_to_reach() -> None:
    mission = Mission()
    assert mission.goal is None
    assert names(mission, (0, 0), (0, 0)) == ["goal_missing", None]
    assert not mission.arrived


def test_waypoints_are_reached_one_after_another() -> None:
    mission = Mission(MissionSettings(waypoints_m=((10, 0), (20, 0))))
    assert names(mission, (20, 0), (8.1, 0), (12, 0), (18.5, 0)) == [
        None,
        "waypoint_reached",
        None,
        "goal_reached",
    ]
    assert mission.arrived


def test_arrival_is_told_once_and_lasts_while_the_boat_drifts() -> None:
    mission = Mission(MissionSettings(waypoints_m=((10, 0),)))
    assert names(mission, (10, 0), (10, 0), (30, 0)) == ["goal_reached", None, None]
    assert mission.arrived


def test_holding_station_heads_back_after_twice_the_radius() -> None:
    mission = Mission(MissionSettings(waypoints_m=((10, 0),), hold_station=True))
    names(mission, (10, 0), (13, 0))
    assert mission.arrived
    names(mission, (14.5, 0))
    assert not mission.arrived
    assert names(mission, (11, 0)) == ["goal_reached"]


def test_a_goal_from_the_bus_replaces_all_others() -> None:
    mission = Mission(MissionSettings(waypoints_m=((10, 0), (20, 0))))
    names(mission, (10, 0), (20, 0))
    event = mission.set_goal(Goal(stamp_ns=9, position_N=np.array([-5.0, 2.0])))
    assert event.name == "goal_set"
    assert not mission.arrived
    assert mission.goal is not None
    assert mission.goal.position_N.tolist() == [-5, 2]


def test_a_waypoint_that_is_not_finite_is_refused() -> None:
    with pytest.raises(ConfigError, match="waypoints_m"):
        Mission(MissionSettings(waypoints_m=((float("nan"), 0),)))


def test_a_place_to_hold_is_headed_for_then_kept_and_found_again_when_driven_off() -> None:
    mission = Mission(MissionSettings(waypoints_m=((90, 0),), goal_radius_m=2.0))
    told = mission.set_station(Station(stamp_ns=9, position_N=np.array([10.0, 0.0])))
    assert told.name == "station_set"
    assert names(mission, (0, 0)) == [None]
    assert mission.target is not None
    assert mission.station is None
    assert names(mission, (6, 0), (9, 0)) == [None, "station_held"]
    assert mission.station is not None
    assert mission.target is None
    assert not mission.arrived
    assert names(mission, (15, 0)) == ["station_left"]
    assert mission.station is not None
    names(mission, (21, 0))
    assert mission.station is None
    assert mission.target.position_N.tolist() == [10.0, 0.0]


def test_a_goal_ends_a_place_and_a_place_ends_goals() -> None:
    mission = Mission()
    mission.set_station(Station(stamp_ns=1, position_N=np.zeros(2)))
    names(mission, (0, 0))
    mission.set_goal(Goal(stamp_ns=2, position_N=np.array([30.0, 0.0])))
    assert mission.station is None
    assert mission.target.position_N.tolist() == [30.0, 0.0]
    assert mission.orders == 2


def test_on_arrival_the_last_goal_is_held_if_so_wished() -> None:
    stops = Mission(MissionSettings(waypoints_m=((10, 0),)))
    holds = Mission(MissionSettings(waypoints_m=((10, 0),), on_arrival="hold"))
    for mission in (stops, holds):
        assert names(mission, (9, 0), (12, 0)) == ["goal_reached", None]
        assert mission.arrived
    assert stops.station is None
    assert holds.station.position_N.tolist() == [10.0, 0.0]


def test_a_boat_that_held_on_its_way_to_a_berth_still_heads_for_where_the_way_in_begins() -> None:
    mission = Mission(MissionSettings(goal_radius_m=2.0))
    mission.set_berth(Berth(stamp_ns=9, face_N=np.array([[0.0, 0.0], [0.0, 10.0]])))
    mission.line_up_N = np.array([20.0, 5.0])
    names(mission, (50, 5))
    assert not mission.berths
    mission.hold(at(50, 5))
    names(mission, (50, 5))
    mission.resume()
    names(mission, (50, 5))
    assert not mission.berths
    assert mission.target.position_N.tolist() == [20.0, 5.0]
    names(mission, (24, 5), (50, 5))
    assert mission.berths


def test_outside_the_envelope_a_boat_that_holds_on_arrival_holds_where_it_is() -> None:
    mission = Mission(MissionSettings(waypoints_m=((90, 0),), on_arrival="hold"))
    mission.hold(at(20, 5))
    names(mission, (20, 6))
    assert mission.station.position_N.tolist() == [20.0, 5.0]
    mission.resume()
    names(mission, (20, 6))
    assert mission.station is None
    assert mission.target.position_N.tolist() == [90.0, 0.0]


def test_a_place_held_outside_the_envelope_is_not_reported_as_the_ordered_one() -> None:
    mission = Mission(MissionSettings(on_arrival="hold"))
    mission.set_station(Station(stamp_ns=9, position_N=np.array([90.0, 0.0])))
    mission.hold(at(20, 5))
    assert names(mission, (20, 5), (20, 5)) == [None, None]
    assert mission.reached == 0
    mission.resume()
    assert names(mission, (20, 5), (89, 0)) == [None, "station_held"]


def test_after_a_hold_on_the_way_to_a_berth_the_policy_goes_on_with_the_way() -> None:
    mission = Mission()
    mission.set_berth(Berth(stamp_ns=1, face_N=np.array([[0.0, 0.0], [9.0, 0.0]])))
    mission.line_up_N = np.array([-10.0, 9.0])
    mission.hold(at(-40, 9))
    mission.resume()
    names(mission, (-40, 9))
    assert not mission.berths
    assert mission.target is not None


def test_however_long_the_way_in_a_boat_on_it_stays_near_its_berth() -> None:
    mission = Mission(MissionSettings(goal_radius_m=0.5))
    mission.set_berth(Berth(stamp_ns=1, face_N=np.array([[0.0, 0.0], [9.0, 0.0]])))
    mission.line_up_N = np.array([-9.0, 9.0])
    names(mission, (-9, 9), (4.5, 1))
    assert mission.berths


@pytest.mark.parametrize("stays", [{"on_arrival": "hold"}, {"hold_station": True}])
def test_a_goal_that_is_kept_after_arrival_is_one_that_may_be_taken_back(stays) -> None:
    mission = Mission(MissionSettings(waypoints_m=((10, 0),), **stays))
    names(mission, (10, 0))
    assert mission.arrived
    assert mission.bound_N.tolist() == [[10.0, 0.0]]
    stops = Mission(MissionSettings(waypoints_m=((10, 0),)))
    names(stops, (10, 0))
    assert len(stops.bound_N) == 0
