"""Who may order what: the messages that stations send to the companion."""

import math

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from twinscrew.runtime.datum import Datum, from_datum_N, to_degrees
from twinscrew.runtime.ground.orders import FollowRoute, GoTo, OrderSettings, Pause, Relative
from twinscrew.runtime.ground.stations import COMPLAIN_S, CURRENT_S, Stations
from twinscrew.runtime.mavlink import Wire

SYDNEY = Datum(latitude_deg=-33.7221, longitude_deg=150.6739)
US = (1, 191)
ACCEPTED, DENIED, UNSUPPORTED, FAILED = 0, 2, 3, 4
REPOSITION, START, SET_CURRENT, PAUSE, REQUEST = 192, 300, 224, 193, 512
POSITION_ONLY = 0b110111111000
VELOCITY_ONLY = 0b110111000111


class Talk:
    """Stations that talk to the companion over real frames."""

    def __init__(self, datum=SYDNEY, **changes):
        self.stations = Stations(OrderSettings(**changes), datum, US)
        self.wire = Wire(*US)
        self.now_s = 0.0

    def say(self, message, sender=(255, 190)):
        """Say something; gives what is answered."""
        for heard in self.wire.decode(Wire(*sender).encode(message)):
            self.stations.take(heard, self.now_s)
        return self.stations.due(self.now_s)

    def command(self, command, *params, to=US, sender=(255, 190)):
        """Send COMMAND_LONG; gives its result, None if it is not answered."""
        padded = [*params, *[0.0] * (7 - len(params))]
        message = mavlink.MAVLink_command_long_message(*to, command, 0, *padded)
        answers = [m for m in self.say(message, sender) if m.get_type() == "COMMAND_ACK"]
        assert all((m.target_system, m.target_component) == sender for m in answers)
        return answers[0].result if answers else None


def local_target(frame, x, y, mask=POSITION_ONLY, to=US):
    return mavlink.MAVLink_set_position_target_local_ned_message(
        0, *to, frame, mask, x, y, 0, 0, 0, 0, 0, 0, 0, 0, 0
    )


def global_target(frame, latitude_deg, longitude_deg):
    x, y = round(latitude_deg * 1e7), round(longitude_deg * 1e7)
    return mavlink.MAVLink_set_position_target_global_int_message(
        0, *US, frame, POSITION_ONLY, x, y, 0, 0, 0, 0, 0, 0, 0, 0, 0
    )


@pytest.mark.parametrize(
    ("frame", "relative"),
    [
        (mavlink.MAV_FRAME_LOCAL_NED, Relative.ORIGIN),
        (mavlink.MAV_FRAME_LOCAL_OFFSET_NED, Relative.VESSEL),
        (mavlink.MAV_FRAME_BODY_NED, Relative.BOW),
        (mavlink.MAV_FRAME_BODY_OFFSET_NED, Relative.BOW),
        (mavlink.MAV_FRAME_BODY_FRD, Relative.BOW),
    ],
)
def test_a_position_target_is_a_goal(frame, relative):
    talk = Talk()
    assert talk.say(local_target(frame, 20.0, -5.0)) == []
    assert talk.stations.orders() == [GoTo(255, 20.0, -5.0, relative)]
    assert talk.stations.orders() == []


@pytest.mark.parametrize("frame", [0, 3, 5, 6, 10, 11])
def test_a_position_target_on_the_earth_is_a_goal(frame):
    talk = Talk()
    talk.say(global_target(frame, -33.7211, 150.6749))
    (goal,) = talk.stations.orders()
    expected = from_datum_N(SYDNEY, -33.7211, 150.6749)
    assert (goal.x_m, goal.y_m) == pytest.approx(tuple(expected[:2]), abs=1e-6)


@pytest.mark.parametrize(
    ("message", "word"),
    [
        (local_target(1, 1.0, 1.0, mask=VELOCITY_ONLY), "velocities"),
        (local_target(21, 1.0, 1.0), "frame"),
        (local_target(1, math.nan, 1.0), "not a place"),
        (local_target(1, 9000.0, 1.0), "farther"),
        (local_target(9, 2000.0, 1.0), "farther"),
        (local_target(9, math.nan, 1.0), "farther"),
        (global_target(0, 0.0, 0.0), "farther"),
        (global_target(1, -33.7211, 150.6749), "frame"),
    ],
)
def test_a_target_that_is_no_goal_is_refused_in_words(message, word):
    talk = Talk()
    talk.say(message)
    assert talk.stations.orders() == []
    assert word in talk.stations.complaints()[0]


def test_to_all_components_is_to_us_too_but_not_to_another_one_or_vessel():
    talk = Talk()
    talk.say(local_target(1, 1.0, 2.0, to=(1, 0)))
    assert len(talk.stations.orders()) == 1
    for to in ((1, 1), (2, 191), (0, 0)):
        talk.say(local_target(1, 1.0, 2.0, to=to))
    assert talk.stations.orders() == []


def test_do_reposition_is_acknowledged_and_a_goal():
    talk = Talk()
    message = mavlink.MAVLink_command_int_message(
        *US, 5, REPOSITION, 0, 0, -1, 0, 0, 0, round(-33.7211e7), round(150.6749e7), 0
    )
    (ack,) = talk.say(message)
    assert (ack.command, ack.result) == (REPOSITION, ACCEPTED)
    (goal,) = talk.stations.orders()
    assert goal.x_m == pytest.approx(from_datum_N(SYDNEY, -33.7211, 150.6749)[0])
    assert talk.command(REPOSITION, -1, 0, 0, 0, -33.7211, 150.6749) == ACCEPTED
    (coarse,) = talk.stations.orders()
    assert coarse.x_m == pytest.approx(goal.x_m, abs=1.0)  # COMMAND_LONG carries 32-bit floats


@pytest.mark.parametrize(
    "params", [(3.0, 0, 0, 0, -33.72, 150.67), (-1, 0, 0, 0, math.nan, 0), (-1, 0, 0, 0, 95, 0)]
)
def test_do_reposition_is_denied_with_a_reason(params):
    talk = Talk()
    assert talk.command(REPOSITION, *params) == DENIED
    assert talk.stations.orders() == []
    assert "goal refused" in talk.stations.complaints()[0]


def test_orders_of_a_stranger_are_refused_and_he_is_named_once_in_a_while():
    talk = Talk(permitted=(255, 7))
    for _ in range(3):
        assert talk.command(REPOSITION, -1, 0, 0, 0, -33.72, 150.67, sender=(42, 190)) == DENIED
        talk.say(local_target(1, 1.0, 1.0), (42, 190))
    assert talk.stations.orders() == []
    (words,) = talk.stations.complaints()
    assert "system 42" in words
    talk.now_s += COMPLAIN_S
    talk.say(local_target(1, 1.0, 1.0), (42, 190))
    assert len(talk.stations.complaints()) == 1
    talk.say(local_target(1, 1.0, 1.0), (7, 190))
    assert len(talk.stations.orders()) == 1


def test_with_nobody_permitted_nothing_is_taken():
    talk = Talk(permitted=())
    talk.say(local_target(1, 1.0, 1.0))
    assert talk.stations.orders() == []


def upload(talk, *places):
    talk.say(mavlink.MAVLink_mission_count_message(*US, len(places)))
    for seq, (north, east) in enumerate(places):
        talk.say(
            mavlink.MAVLink_mission_item_int_message(
                *US, seq, 1, 16, 0, 1, 0, 0, 0, 0, round(north * 1e4), round(east * 1e4), 0
            )
        )
    talk.stations.orders()


def test_a_mission_is_started_paused_and_resumed_by_commands():
    talk = Talk(start="command")
    assert talk.command(START) == FAILED
    upload(talk, (1.0, 0.0), (2.0, 0.0), (3.0, 0.0))
    assert talk.command(START) == ACCEPTED
    assert talk.command(PAUSE, 0) == ACCEPTED
    assert talk.command(SET_CURRENT, 1) == ACCEPTED
    assert talk.command(PAUSE, 0) == ACCEPTED
    assert talk.command(PAUSE, 1) == ACCEPTED
    assert talk.command(PAUSE, 2) == DENIED
    assert talk.command(SET_CURRENT, 9) == FAILED
    whole, _, rest, _, resumed = talk.stations.orders()
    assert [waypoint.seq for waypoint in whole.way] == [0, 1, 2]
    assert [waypoint.seq for waypoint in rest.way] == [1, 2]
    assert [waypoint.seq for waypoint in resumed.way] == [1, 2]
    assert isinstance(resumed, FollowRoute)
    assert not isinstance(resumed, Pause)


def test_the_present_item_is_told_while_there_is_a_mission():
    talk = Talk()
    assert talk.stations.due(0.0) == []
    upload(talk, (1.0, 0.0))
    told = [m for k in range(41) for m in talk.stations.due(10.0 + k * 0.1) if m.id == 42]
    assert len(told) == 1 + round(4.0 / CURRENT_S)
    assert told[0].total == 1


def test_we_tell_what_we_can_do_and_nothing_else_on_request():
    talk = Talk()
    message = mavlink.MAVLink_command_long_message(*US, REQUEST, 0, 148, 0, 0, 0, 0, 0, 0)
    version, ack = talk.say(message)
    assert ack.result == ACCEPTED
    assert version.capabilities & mavlink.MAV_PROTOCOL_CAPABILITY_MISSION_INT
    assert talk.command(REQUEST, 30) == FAILED


def test_what_we_do_not_know_is_answered_only_if_it_is_to_us_alone():
    talk = Talk()
    assert talk.command(400, 1) == UNSUPPORTED
    assert talk.command(400, 1, to=(1, 0)) is None
    assert talk.command(REPOSITION, -1, 0, 0, 0, -33.72, 150.67, to=(1, 0)) == ACCEPTED


def test_a_mission_for_everybody_is_the_autopilots():
    talk = Talk()
    assert talk.say(mavlink.MAVLink_mission_count_message(1, 0, 2)) == []


def test_our_own_words_that_come_back_are_no_orders():
    talk = Talk(permitted=(1, 255))
    talk.say(local_target(1, 1.0, 1.0), US)
    assert talk.stations.orders() == []


def test_a_flood_does_not_fill_the_memory():
    talk = Talk()
    for _ in range(3000):
        for heard in talk.wire.decode(Wire(255, 190).encode(local_target(1, 1.0, 1.0))):
            talk.stations.take(heard, 0.0)
    assert 1 <= len(talk.stations.orders()) <= 300


def test_degrees_and_metres_are_each_others_inverse():
    for north, east in ((0.0, 0.0), (1234.5, -987.6), (-4000.0, 4000.0)):
        there = to_degrees(SYDNEY, (north, east))
        back = from_datum_N(SYDNEY, *there)
        assert tuple(back[:2]) == pytest.approx((north, east), abs=1e-6)
    dateline = Datum(latitude_deg=0.0, longitude_deg=179.9999)
    assert to_degrees(dateline, (0.0, 100.0))[1] < -179.0
