"""Orders of ground stations become goals of a whole boat, and the last order counts."""

import numpy as np
import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from tests.harness.boat import Boat, odometry, stamp

from twinscrew.runtime.charts.static_map import Disc
from twinscrew.runtime.geometry import quaternion_from_euler
from twinscrew.runtime.ground.orders import OrderSettings
from twinscrew.runtime.ground.stations import Stations
from twinscrew.runtime.mavlink import Wire
from twinscrew.runtime.messages import cdr
from twinscrew.runtime.messages.types import Goal, Odometry

US, STATION = (1, 191), (255, 190)
ACTIVE, PAUSED, COMPLETE = 3, 4, 5


class Sea:
    """A boat that is carried wherever a test wants it, and a station."""

    def __init__(self, **changes: object) -> None:
        stations = Stations(OrderSettings(**changes), None, US)
        self.boat = Boat(waypoints_m=(), stations=stations)
        self.station, self.ear = Wire(*STATION), Wire(9, 9)
        self.fed: list[str] = []

    @property
    def mission(self):
        return self.boat.vessel.pipeline.mission

    @property
    def goal(self) -> list[float] | None:
        goal = self.mission.goal
        return None if goal is None else goal.position_N.tolist()

    def say(self, message) -> list:
        """Let the station say something, and the desk serve; gives what goes out."""
        self.boat.vessel.receive(self.station.encode(message), self.boat.now_s)
        return self.serve()

    def serve(self) -> list:
        out = self.boat.vessel.tick(self.boat.now_s)
        self.fed += [taken.topic for taken in out.messages if not taken.made_here]
        return self.ear.decode(out.autopilot)

    def upload(self, *places: tuple[float, float]) -> list:
        sent = self.say(mavlink.MAVLink_mission_count_message(*US, len(places)))
        for seq, (north, east) in enumerate(places):
            x, y = round(north * 1e4), round(east * 1e4)
            sent += self.say(
                mavlink.MAVLink_mission_item_int_message(*US, seq, 1, 16, 0, 1, 0, 0, 0, 0, x, y, 0)
            )
        return sent + self.serve()

    def go(self, frame: int, x: float, y: float) -> list:
        return self.say(
            mavlink.MAVLink_set_position_target_local_ned_message(
                0, *US, frame, 0b110111111000, x, y, 0, 0, 0, 0, 0, 0, 0, 0, 0
            )
        )

    def move_to(self, north: float, east: float) -> list:
        """Carry the boat there at 3 m/s, and let it look about; gives what it tells."""
        begin = np.array(self.boat.place)
        steps = 1 + int(np.hypot(*(begin - (north, east))) / 0.3)
        sent = []
        for k in range(steps + 2):
            share = min(1.0, (k + 1) / steps)
            self.boat.place = tuple(begin + share * ((north, east) - begin))
            self.boat.sent.clear()
            self.boat.sail(0.1)
            sent += [*self.boat.sent, *self.serve()]
        return sent


@pytest.fixture
def sea() -> Sea:
    sea = Sea()
    sea.boat.sail(2.0)
    return sea


def of(kind: str, messages: list) -> list:
    return [message for message in messages if message.get_type() == kind]


def test_a_mission_is_sailed_place_after_place_and_each_one_is_told(sea) -> None:
    told = sea.upload((3.0, 0.0), (6.0, 0.0), (6.0, 3.0))
    assert of("MISSION_ACK", told)[0].type == 0
    assert sea.fed == ["route"]
    assert sea.goal == [3.0, 0.0]
    told = sea.move_to(2.0, 0.0)
    assert [m.seq for m in of("MISSION_ITEM_REACHED", told)] == [0]
    assert of("MISSION_CURRENT", told)[-1].seq == 1
    assert of("MISSION_CURRENT", told)[-1].mission_state == ACTIVE
    assert sea.goal == [6.0, 0.0]
    sea.move_to(4.0, 0.0)
    told = sea.move_to(5.0, 1.5)
    assert [m.seq for m in of("MISSION_ITEM_REACHED", told)] == [2]
    assert of("MISSION_CURRENT", told)[-1].mission_state == COMPLETE
    assert sea.boat.vessel.decision.arrived


def test_the_boat_drives_on_while_it_turns_to_the_next_place(sea) -> None:
    sea.upload((3.0, 0.0), (60.0, 0.0))
    sea.boat.sail(1.0)
    assert sea.boat.moves
    since_s = sea.boat.now_s
    sea.move_to(2.0, 0.0)
    assert "waypoint_reached" in sea.boat.names
    assert all(thrust.any() for t, thrust in sea.boat.thrusts if t > since_s)


def test_a_goal_replaces_a_mission_which_is_kept_and_can_be_resumed(sea) -> None:
    sea.upload((30.0, 0.0), (60.0, 0.0))
    told = sea.go(1, 5.0, 5.0)
    assert sea.goal == [5.0, 5.0]
    assert of("MISSION_CURRENT", told)[-1].mission_state == PAUSED
    sea.say(mavlink.MAVLink_mission_set_current_message(*US, 1))
    assert sea.goal == [60.0, 0.0]


def test_a_goal_of_the_bus_replaces_a_mission_too(sea) -> None:
    sea.upload((30.0, 0.0))
    goal = Goal(stamp_ns=stamp(3.0), position_N=np.array([-8.0, 2.0]))
    sea.boat.take_in("goal", cdr.encode_goal(goal))
    (current,) = of("MISSION_CURRENT", sea.serve())
    assert current.mission_state == PAUSED
    assert sea.goal == [-8.0, 2.0]
    sea.say(mavlink.MAVLink_mission_clear_all_message(*US, 0))
    assert sea.goal == [-8.0, 2.0], "clearing a mission that is not sailed leaves the goal alone"


def test_clearing_the_mission_that_is_sailed_stops_the_boat(sea) -> None:
    sea.upload((30.0, 0.0))
    sea.boat.sail(1.0)
    assert sea.boat.moves
    sea.say(mavlink.MAVLink_mission_clear_all_message(*US, 0))
    sea.boat.sail(0.3)
    assert sea.goal is None
    assert not sea.boat.moves
    assert "goal_missing" in sea.boat.names


def test_a_goal_that_is_sent_again_and_again_is_one_goal(sea) -> None:
    for _ in range(5):
        sea.go(1, 20.0, 0.0)
    assert sea.fed == ["goal"]
    sea.go(1, 20.0, 1.0)
    assert sea.fed == ["goal", "goal"]


def test_places_from_the_vessel_and_from_its_bow(sea) -> None:
    east = quaternion_from_euler(0.0, 0.0, np.pi / 2)
    now = odometry(sea.boat.now_s + 0.02, 0.2, 0.1)
    turned = Odometry(
        stamp_ns=now.stamp_ns,
        position_N=now.position_N,
        q_NB=east,
        velocity_B=now.velocity_B,
        rates_B=now.rates_B,
    )
    sea.boat.take_in("odometry", cdr.encode_odometry(turned))
    sea.go(mavlink.MAV_FRAME_LOCAL_OFFSET_NED, 10.0, 1.0)
    assert sea.goal == pytest.approx([10.2, 1.1])
    sea.go(mavlink.MAV_FRAME_BODY_FRD, 10.0, 1.0)  # ahead is east, starboard is south
    assert sea.goal == pytest.approx([-0.8, 10.1])


def test_before_it_knows_where_it_is_a_place_from_the_vessel_is_refused() -> None:
    sea = Sea()
    told = sea.go(mavlink.MAV_FRAME_BODY_FRD, 10.0, 0.0) + sea.serve()
    assert sea.fed == []
    assert any("unknown" in message.text for message in of("STATUSTEXT", told))


def test_what_was_refused_is_told_in_words(sea) -> None:
    told = sea.go(21, 1.0, 1.0) + sea.serve()
    assert any(m.text.startswith("goal refused: its frame") for m in of("STATUSTEXT", told))


def test_a_mission_that_ends_with_a_place_to_stay_at_holds_it(sea) -> None:
    sent = sea.say(mavlink.MAVLink_mission_count_message(*US, 3))
    for seq, (command, north) in enumerate(((16, 3.0), (17, 6.0), (16, 90.0))):
        item = (seq, 1, command, 0, 1, 0, 0, 0, 45.0, round(north * 1e4), 0, 0)
        sent += sea.say(mavlink.MAVLink_mission_item_int_message(*US, *item))
    assert of("MISSION_ACK", sent + sea.serve())[0].type == 0
    assert sea.fed == ["route"]
    sea.move_to(2.5, 0.0)
    assert sea.fed == ["route", "hold"]
    told = sea.move_to(5.5, 0.0)
    assert [m.seq for m in of("MISSION_ITEM_REACHED", told)] == [1]
    assert of("MISSION_CURRENT", told)[-1].mission_state == ACTIVE
    station = sea.mission.station
    assert station.position_N.tolist() == pytest.approx([6.0, 0.0])
    assert station.heading == pytest.approx(np.radians(45.0))


def reposition(yaw: float, place: tuple[float, float] = (4.0, 3.0)):
    x, y = (round(metres * 1e4) for metres in place)
    return mavlink.MAVLink_command_int_message(*US, 1, 192, 0, 0, -1.0, 0.0, 0.0, yaw, x, y, 0.0)


def test_do_reposition_with_a_yaw_asks_to_stay_there_without_one_to_go_there(sea) -> None:
    for yaw in (float("nan"), 0.0):
        sea.say(reposition(yaw, (4.0, 3.0 + abs(np.nan_to_num(yaw)))))
    assert sea.fed == ["goal"]
    (answer,) = of("COMMAND_ACK", sea.say(reposition(1.5)))
    assert answer.result == 0
    assert sea.fed == ["goal", "hold"]
    assert sea.goal == pytest.approx([4.0, 3.0])
    sea.say(reposition(1.5))
    assert sea.fed == ["goal", "hold"]  # the same order again
    (answer,) = of("COMMAND_ACK", sea.say(reposition(90.0)))
    assert answer.result != 0


def test_loiter_as_a_command_holds_the_place_where_the_boat_is(sea) -> None:
    sea.move_to(2.0, 1.0)
    long = mavlink.MAVLink_command_long_message(*US, 17, 0, 0, 0, 0, 0, 0, 0, 0)
    (answer,) = of("COMMAND_ACK", sea.say(long))
    assert answer.result == 0
    assert sea.mission.goal.position_N.tolist() == pytest.approx([2.0, 1.0], abs=0.3)


def test_a_goal_that_was_forbidden_is_taken_when_it_is_asked_for_again_after_the_fence_is_gone(
    sea,
) -> None:
    vessel = sea.boat.vessel
    vessel.fence("station", (Disc(kind="fence", centre=(20.0, 0.0), radius_m=5.0),))
    sea.serve()
    sea.go(mavlink.MAV_FRAME_LOCAL_OFFSET_NED, 20.0, 0.0)
    assert sea.goal is None
    vessel.fence("station", ())
    sea.serve()
    sea.go(mavlink.MAV_FRAME_LOCAL_OFFSET_NED, 20.0, 0.0)
    assert sea.goal == [20.0, 0.0]


def test_a_mission_that_a_new_fence_forbids_is_not_told_as_sailed(sea) -> None:
    sea.upload((30.0, 0.0), (30.0, 30.0))
    sea.go(1, -40.0, 0.0)
    vessel = sea.boat.vessel
    start = mavlink.MAVLink_mission_set_current_message(*US, 0)
    vessel.receive(sea.station.encode(start), sea.boat.now_s)
    vessel.fence("station", (Disc(kind="fence", centre=(30.0, 30.0), radius_m=5.0),))
    sea.serve()
    assert sea.goal == [-40.0, 0.0]
    assert sea.boat.vessel.link.stations.server.mission.state != ACTIVE
    assert not of("MISSION_ITEM_REACHED", sea.move_to(-40.0, 0.0))
