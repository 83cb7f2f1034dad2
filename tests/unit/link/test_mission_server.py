"""The mission protocol, from the station's side: what it sends, and what it is answered."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from tests.harness.work import examples

from twinscrew.runtime.datum import Datum, from_datum_N
from twinscrew.runtime.ground.missions import ASK_AGAIN_S, TRIES, MissionServer
from twinscrew.runtime.ground.orders import FollowRoute, GoalFrames, GoTo, OrderSettings, Pause

SYDNEY = Datum(latitude_deg=-33.7221, longitude_deg=150.6739)
STATION, OTHER, STRANGER = (255, 190), (255, 191), (42, 190)
US = (1, 191)
LOCAL, GLOBAL, GLOBAL_INT, RELATIVE = 1, 0, 5, 6
WAYPOINT, LAND = 16, 21


def local(seq, north, east, **changes):
    return item(seq, LOCAL, round(north * 1e4), round(east * 1e4), **changes)


def item(seq, frame, x, y, *, command=WAYPOINT, hold=0.0):
    params = (hold, 0, 0, 0)
    return mavlink.MAVLink_mission_item_int_message(
        *US, seq, frame, command, 0, 1, *params, x, y, 0.0
    )


class Talk:
    """A station that talks to a server; time stands still unless it is told to pass."""

    def __init__(self, datum=SYDNEY, **changes):
        options = OrderSettings(**changes)
        self.server = MissionServer(
            options, GoalFrames(datum, options.reach_m), lambda system: system in options.permitted
        )
        self.now_s = 0.0

    def say(self, message, station=STATION):
        """Say something; gives what is answered."""
        self.server.take(message, station, self.now_s)
        return self.answers()

    def answers(self):
        replies, self.server.replies = self.server.replies, []
        return replies

    def wait(self, seconds):
        self.now_s += seconds
        self.server.tick(self.now_s)
        return self.answers()

    def count(self, count, station=STATION, kind=0):
        return self.say(mavlink.MAVLink_mission_count_message(*US, count, kind), station)

    def upload(self, *items, station=STATION):
        """Upload as a station does, answering each request; gives the last answer."""
        answers = self.count(len(items), station)
        while answers and answers[-1].get_type() == "MISSION_REQUEST_INT":
            answers = self.say(items[answers[-1].seq], station)
        return answers[-1]

    def download(self):
        (count,) = self.say(mavlink.MAVLink_mission_request_list_message(*US, 0))
        return [
            self.say(mavlink.MAVLink_mission_request_int_message(*US, seq, 0))[0]
            for seq in range(count.count)
        ]


def kinds(messages):
    return [message.get_type() for message in messages]


def test_items_are_asked_for_one_by_one_and_a_whole_mission_is_accepted_and_sailed():
    talk = Talk()
    (first,) = talk.count(2)
    assert (first.get_type(), first.seq) == ("MISSION_REQUEST_INT", 0)
    assert (first.target_system, first.target_component) == STATION
    (second,) = talk.say(local(0, 10.0, 0.0))
    assert second.seq == 1
    (ack,) = talk.say(local(1, 10.0, 5.0))
    assert (ack.get_type(), ack.type) == ("MISSION_ACK", mavlink.MAV_MISSION_ACCEPTED)
    (order,) = talk.server.orders
    assert isinstance(order, FollowRoute)
    assert [(w.seq, w.north_m, w.east_m) for w in order.way] == [(0, 10.0, 0.0), (1, 10.0, 5.0)]


def test_places_on_the_earth_become_places_in_the_local_frame():
    talk = Talk()
    talk.upload(item(0, RELATIVE, -337220000, 1506740000))
    (waypoint,) = talk.server.orders[0].way
    expected = from_datum_N(SYDNEY, -33.722, 150.674)
    assert (waypoint.north_m, waypoint.east_m) == pytest.approx(tuple(expected[:2]))
    assert waypoint.north_m == pytest.approx(11.13, abs=0.01)


item_values = st.tuples(
    st.sampled_from([LOCAL, RELATIVE]),
    st.integers(-20_000_000, 20_000_000),
    st.integers(-20_000_000, 20_000_000),
)


@settings(max_examples=examples(50), deadline=None)
@given(st.lists(item_values, min_size=1, max_size=12))
def test_what_is_accepted_comes_back_as_it_was_sent(values):
    near_null = Datum(latitude_deg=0.0, longitude_deg=0.0)
    talk = Talk(datum=near_null, reach_m=1e7)
    sent = [item(seq, frame, x, y) for seq, (frame, x, y) in enumerate(values)]
    assert talk.upload(*sent).type == mavlink.MAV_MISSION_ACCEPTED
    told = [(m.seq, m.frame, m.command, m.x, m.y) for m in talk.download()]
    assert told == [(m.seq, m.frame, m.command, m.x, m.y) for m in sent]


def test_home_ahead_of_the_way_is_kept_but_not_sailed_to():
    talk = Talk()
    home = item(0, GLOBAL, 0, 0)
    talk.upload(home, item(1, RELATIVE, -337221000, 1506739000))
    assert [waypoint.seq for waypoint in talk.server.orders[0].way] == [1]
    assert talk.server.mission.current == 1
    assert len(talk.download()) == 2


def test_where_all_items_are_in_one_frame_the_first_is_sailed_to():
    talk = Talk()
    talk.upload(*(item(seq, GLOBAL_INT, -337221000 + seq, 1506739000) for seq in range(3)))
    assert [waypoint.seq for waypoint in talk.server.orders[0].way] == [0, 1, 2]


@pytest.mark.parametrize(("home", "sailed"), [("none", [0, 1]), ("first", [1])])
def test_whether_the_first_is_home_can_be_settled(home, sailed):
    talk = Talk(home=home)
    talk.upload(local(0, 1.0, 1.0), local(1, 2.0, 2.0))
    assert [waypoint.seq for waypoint in talk.server.orders[0].way] == sailed


@pytest.mark.parametrize(
    ("bad", "result", "word"),
    [
        (local(1, 1.0, 1.0, command=LAND), mavlink.MAV_MISSION_UNSUPPORTED, "NAV_WAYPOINT"),
        (item(1, 20, 0, 0), mavlink.MAV_MISSION_UNSUPPORTED_FRAME, "frame"),
        (local(1, 1.0, 1.0, hold=5.0), mavlink.MAV_MISSION_INVALID_PARAM1, "wait"),
        (item(1, RELATIVE, 910000000, 0), mavlink.MAV_MISSION_INVALID_PARAM5_X, "latitude"),
        (item(1, RELATIVE, 0, 1810000000), mavlink.MAV_MISSION_INVALID_PARAM6_Y, "longitude"),
        (item(1, RELATIVE, 0, 0), mavlink.MAV_MISSION_INVALID_PARAM5_X, "farther"),
    ],
)
def test_what_cannot_be_sailed_is_refused_with_its_reason_and_the_old_mission_stays(
    bad, result, word
):
    talk = Talk()
    talk.upload(local(0, 3.0, 4.0))
    talk.server.orders.clear()
    ack = talk.upload(local(0, 1.0, 1.0), bad, local(2, 2.0, 2.0))
    assert (ack.get_type(), ack.type) == ("MISSION_ACK", result)
    assert talk.server.orders == []
    assert "item 1" in talk.server.complaints[0]
    assert word in talk.server.complaints[0]
    assert [m.x for m in talk.download()] == [30_000]


def test_without_a_datum_places_on_the_earth_are_refused():
    talk = Talk(datum=None)
    assert talk.upload(item(0, RELATIVE, 0, 0)).type == mavlink.MAV_MISSION_UNSUPPORTED_FRAME
    assert "autopilot.datum" in talk.server.complaints[0]


def test_an_older_stations_items_in_floats_are_understood():
    talk = Talk()
    talk.count(1)
    params = (0, 0, 0, 0)
    (ack,) = talk.say(
        mavlink.MAVLink_mission_item_message(
            *US, 0, LOCAL, WAYPOINT, 0, 1, *params, 12.5, -3.25, 0.0
        )
    )
    assert ack.type == mavlink.MAV_MISSION_ACCEPTED
    (waypoint,) = talk.server.orders[0].way
    assert (waypoint.north_m, waypoint.east_m) == (12.5, -3.25)


@pytest.mark.parametrize("nonsense", [float("nan"), float("inf"), 1e30])
def test_a_float_that_is_no_place_is_refused(nonsense):
    talk = Talk()
    talk.count(1)
    params = (0, 0, 0, 0)
    (ack,) = talk.say(
        mavlink.MAVLink_mission_item_message(
            *US, 0, LOCAL, WAYPOINT, 0, 1, *params, nonsense, 0.0, 0.0
        )
    )
    assert ack.type == mavlink.MAV_MISSION_INVALID_PARAM5_X


def test_too_many_items_are_refused():
    talk = Talk(most_items=3)
    (ack,) = talk.count(4)
    assert ack.type == mavlink.MAV_MISSION_NO_SPACE
    assert talk.count(3)[0].get_type() == "MISSION_REQUEST_INT"


def test_a_lost_item_is_asked_for_again_and_at_last_given_up():
    talk = Talk()
    talk.count(2)
    requests = [kinds(talk.wait(ASK_AGAIN_S)) for _ in range(TRIES)]
    assert requests[:-1] == [["MISSION_REQUEST_INT"]] * (TRIES - 1)
    assert requests[-1] == ["MISSION_ACK"]
    assert "never came" in talk.server.complaints[0]
    assert talk.wait(60.0) == []
    assert talk.upload(local(0, 1.0, 1.0)).type == mavlink.MAV_MISSION_ACCEPTED


def test_an_item_that_was_not_asked_for_is_not_taken_in_its_place():
    talk = Talk()
    talk.count(3)
    (again,) = talk.say(local(2, 9.0, 9.0))
    assert (again.get_type(), again.seq) == ("MISSION_REQUEST_INT", 0)
    talk.say(local(0, 0.0, 0.0))
    assert talk.say(local(0, 8.0, 8.0)) == []  # came twice
    talk.say(local(1, 1.0, 1.0))
    talk.say(local(2, 2.0, 2.0))
    assert [w.north_m for w in talk.server.orders[0].way] == [0.0, 1.0, 2.0]


def test_an_item_without_an_upload_is_out_of_sequence():
    (ack,) = Talk().say(local(0, 1.0, 1.0))
    assert ack.type == mavlink.MAV_MISSION_INVALID_SEQUENCE


def test_if_the_last_word_was_lost_it_is_said_again():
    talk = Talk()
    talk.upload(local(0, 1.0, 1.0), local(1, 2.0, 2.0))
    (ack,) = talk.say(local(1, 2.0, 2.0))
    assert ack.type == mavlink.MAV_MISSION_ACCEPTED
    assert len(talk.server.orders) == 1


def test_a_second_station_must_wait_and_the_same_one_may_begin_again():
    talk = Talk()
    talk.count(2)
    (ack,) = talk.count(1, station=OTHER)
    assert ack.type == mavlink.MAV_MISSION_DENIED
    assert (ack.target_system, ack.target_component) == OTHER
    talk.say(local(0, 7.0, 7.0))
    assert talk.upload(local(0, 1.0, 1.0)).type == mavlink.MAV_MISSION_ACCEPTED
    assert [w.north_m for w in talk.server.orders[0].way] == [1.0]


def test_a_station_that_gives_up_leaves_the_way_to_the_next():
    talk = Talk()
    talk.count(2)
    talk.say(mavlink.MAVLink_mission_ack_message(*US, mavlink.MAV_MISSION_OPERATION_CANCELLED))
    assert talk.count(1, station=OTHER)[0].get_type() == "MISSION_REQUEST_INT"


def test_a_stranger_may_read_the_mission_but_not_change_it():
    talk = Talk()
    talk.upload(local(0, 1.0, 1.0))
    talk.server.orders.clear()
    assert talk.upload(local(0, 5.0, 5.0), station=STRANGER).type == mavlink.MAV_MISSION_DENIED
    clear = mavlink.MAVLink_mission_clear_all_message(*US, 0)
    assert talk.say(clear, STRANGER)[0].type == mavlink.MAV_MISSION_DENIED
    assert talk.say(mavlink.MAVLink_mission_set_current_message(*US, 0), STRANGER) == []
    assert talk.server.orders == []
    (count,) = talk.say(mavlink.MAVLink_mission_request_list_message(*US, 0), STRANGER)
    assert count.count == 1


def test_rally_points_are_not_ours():
    talk, kind = Talk(), mavlink.MAV_MISSION_TYPE_RALLY
    (ack,) = talk.count(1, kind=kind)
    assert (ack.type, ack.mission_type) == (mavlink.MAV_MISSION_UNSUPPORTED, kind)
    (ack,) = talk.say(mavlink.MAVLink_mission_request_list_message(*US, kind))
    assert (ack.type, ack.mission_type) == (mavlink.MAV_MISSION_UNSUPPORTED, kind)


@pytest.mark.parametrize("kind", [mavlink.MAV_MISSION_TYPE_MISSION, mavlink.MAV_MISSION_TYPE_ALL])
def test_a_cleared_mission_is_gone_and_sailed_no_further(kind):
    talk = Talk()
    talk.upload(local(0, 1.0, 1.0))
    (ack,) = talk.say(mavlink.MAVLink_mission_clear_all_message(*US, kind))
    assert ack.type == mavlink.MAV_MISSION_ACCEPTED
    assert isinstance(talk.server.orders[-1], Pause)
    assert talk.download() == []
    (ack,) = talk.say(mavlink.MAVLink_mission_request_int_message(*US, 0, 0))
    assert ack.type == mavlink.MAV_MISSION_INVALID_SEQUENCE


def test_an_empty_mission_is_a_cleared_one():
    talk = Talk()
    talk.upload(local(0, 1.0, 1.0))
    assert talk.count(0)[0].type == mavlink.MAV_MISSION_ACCEPTED
    assert isinstance(talk.server.orders[-1], Pause)


def test_any_item_can_be_made_the_next_one():
    talk = Talk()
    talk.upload(*(local(seq, float(seq), 0.0) for seq in range(4)))
    (current,) = talk.say(mavlink.MAVLink_mission_set_current_message(*US, 2))
    assert (current.get_type(), current.seq, current.total) == ("MISSION_CURRENT", 2, 4)
    assert [waypoint.seq for waypoint in talk.server.orders[-1].way] == [2, 3]
    talk.say(mavlink.MAVLink_mission_set_current_message(*US, 4))
    assert "no item 4" in talk.server.complaints[0]
    assert len(talk.server.orders) == 2


def test_a_mission_may_wait_for_the_word_to_start():
    talk = Talk(start="command")
    assert talk.upload(local(0, 1.0, 1.0)).type == mavlink.MAV_MISSION_ACCEPTED
    assert talk.server.orders == []
    assert talk.server.start(255, 0)
    assert isinstance(talk.server.orders[0], FollowRoute)


def test_an_item_of_its_own_is_a_goal_and_no_part_of_the_mission():
    talk = Talk()
    talk.count(2)
    goal = local(0, 12.0, -7.0)
    goal.current = 2
    (ack,) = talk.say(goal)
    assert ack.type == mavlink.MAV_MISSION_ACCEPTED
    assert talk.server.orders == [GoTo(255, 12.0, -7.0)]
    goal.command = LAND
    assert talk.say(goal)[0].type == mavlink.MAV_MISSION_UNSUPPORTED
    assert talk.say(local(0, 1.0, 1.0))[0].seq == 1


def test_a_partial_upload_is_refused():
    (ack,) = Talk().say(mavlink.MAVLink_mission_write_partial_list_message(*US, 0, 1, 0))
    assert ack.type == mavlink.MAV_MISSION_UNSUPPORTED
