"""Fences of ArduPilot: uploaded to the companion, read from the autopilot, kept by the boat."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from tests.harness.boat import Steady, feed, make_pipeline, odometry, stamp
from tests.harness.work import examples

from twinscrew.hil_sim.autopilot.endpoint import RoverAutopilot, RoverAutopilotSettings
from twinscrew.runtime.charts.static_map import StaticMap
from twinscrew.runtime.datum import Datum, to_degrees
from twinscrew.runtime.ground.fences import FENCE, FenceItem, Misfit, features_of
from twinscrew.runtime.ground.orders import OrderSettings
from twinscrew.runtime.ground.stations import Stations
from twinscrew.runtime.link.ardupilot.fences import READ_EVERY_S
from twinscrew.runtime.link.ardupilot.link import AutopilotLink, AutopilotSettings
from twinscrew.runtime.mavlink import Wire
from twinscrew.runtime.messages import cdr
from twinscrew.runtime.messages.types import Goal
from twinscrew.runtime.vessel.vessel import Vessel

DATUM = Datum(latitude_deg=54.35, longitude_deg=10.13)
COMPANION, AUTOPILOT, STATION = (1, 191), (1, 1), (255, 190)
IN, OUT, ROUND_IN, ROUND_OUT, RETURN = 5001, 5002, 5003, 5004, 5000
BAY = [(-50.0, -50.0), (90.0, -50.0), (20.0, 0.0), (90.0, 90.0), (-50.0, 90.0)]
"""[m] Not convex: between its arms, at (60, 0), is outside."""


def corners(command, places):
    return [(command, float(len(places)), place) for place in places]


def message(target, seq, item, frame=mavlink.MAV_FRAME_GLOBAL_INT):
    command, size, place = item
    latitude, longitude = to_degrees(DATUM, np.array(place))
    where = round(latitude * 1e7), round(longitude * 1e7)
    return mavlink.MAVLink_mission_item_int_message(
        *target, seq, frame, command, 0, 1, size, 0, 0, 0, *where, 0, FENCE
    )


class Fleet:
    """A vessel, its simulated autopilot with a ground station at its second port, and bytes."""

    def __init__(self, datum=DATUM, **link):
        stations = Stations(OrderSettings(), datum, COMPANION)
        self.link = AutopilotLink(AutopilotSettings(datum=datum, **link), stations=stations)
        self.vessel = Vessel(make_pipeline(Steady(), ()), self.link)
        self.pilot = RoverAutopilot(RoverAutopilotSettings(), 1, ports=2)
        self.wire = Wire(*STATION)
        self.now_s, self.events, self.heard = 0.0, [], []

    def sail(self, seconds):
        for _ in range(round(seconds / 0.05)):
            self.now_s = round(self.now_s + 0.05, 6)
            at = odometry(self.now_s)
            outs = [feed(self.vessel, "odometry", cdr.encode_odometry(at), self.now_s)]
            outs.append(self.vessel.receive(self.pilot.step(self.now_s, at), self.now_s))
            outs.append(self.vessel.tick(self.now_s))
            for out in outs:
                self.pilot.receive(out.autopilot, self.now_s)
                self.events += out.events
            self.heard += self.wire.decode(self.pilot.outgoing(1))
        return self

    def say(self, *messages):
        for one in messages:
            self.pilot.receive(self.wire.encode(one), self.now_s, port=1)
        return self.sail(0.2)

    def upload(self, target, items):
        """Upload as a station does; gives the result."""
        self.heard.clear()
        self.say(mavlink.MAVLink_mission_count_message(*target, len(items), FENCE))
        for _ in range(3 * len(items) + 3):
            for one in self.take("MISSION_ACK", target):
                return one.type
            for one in self.take("MISSION_REQUEST_INT", target):
                self.say(message(target, one.seq, items[one.seq]))
            self.sail(0.1)
        raise AssertionError("never answered")

    def take(self, kind, sender):
        found = [
            one
            for one in self.heard
            if one.get_type() == kind
            and (one.get_srcSystem(), one.get_srcComponent()) == sender
            and one.target_system == STATION[0]
            and one.mission_type == FENCE
        ]
        self.heard = [one for one in self.heard if one not in found]
        return found

    def named(self, name):
        return [event.detail for event in self.events if event.name == name]

    def texts(self):
        said = [one.text for one in self.heard if one.get_type() == "STATUSTEXT"]
        return "".join(part if isinstance(part, str) else part.decode() for part in said)

    def goal(self, north, east):
        place = Goal(stamp_ns=stamp(self.now_s), position_N=np.array([north, east]))
        out = feed(self.vessel, "goal", cdr.encode_goal(place, frame_id=""), self.now_s)
        return [event.name for event in out.events]


@pytest.mark.parametrize("target", [COMPANION, AUTOPILOT])
def test_a_fence_that_a_station_uploads_is_kept_wherever_it_lies(target):
    fleet = Fleet().sail(1.0)
    items = [*corners(IN, BAY), (ROUND_OUT, 5.0, (0.0, 40.0)), (RETURN, 0.0, (0.0, 0.0))]
    assert fleet.upload(target, items) == mavlink.MAV_MISSION_ACCEPTED
    fleet.sail(READ_EVERY_S + 2.0)
    assert fleet.vessel.chart.version != 0
    assert fleet.named("chart_changed") == ["2 fence"]
    places = np.array([[0.0, 0.0], [60.0, 0.0], [0.0, 40.0], [0.0, 46.0], [-60.0, 0.0]])
    assert fleet.vessel.chart.forbidden(places).tolist() == [False, True, True, False, True]
    assert fleet.goal(60.0, 0.0) == ["goal_forbidden"]
    assert fleet.goal(0.0, 46.0) == ["goal_set"]


@pytest.mark.parametrize("target", [COMPANION, AUTOPILOT])
def test_fences_come_back_as_they_were_uploaded_and_go_when_they_are_cleared(target):
    fleet = Fleet().sail(1.0)
    items = [*corners(OUT, BAY), (ROUND_IN, 300.0, (0.0, 0.0))]
    fleet.upload(target, items)
    fleet.say(mavlink.MAVLink_mission_request_list_message(*target, FENCE))
    (count,) = fleet.take("MISSION_COUNT", target)
    assert count.count == len(items)
    for seq, item in enumerate(items):
        fleet.say(mavlink.MAVLink_mission_request_int_message(*target, seq, FENCE))
        (told,) = fleet.take("MISSION_ITEM_INT", target)
        sent = message(target, seq, item)
        assert (told.command, told.param1, told.x, told.y) == (
            sent.command, sent.param1, sent.x, sent.y,
        )  # fmt: skip
    fleet.sail(READ_EVERY_S + 2.0)
    assert not fleet.vessel.chart.is_empty
    fleet.say(mavlink.MAVLink_mission_clear_all_message(*target, FENCE))
    fleet.sail(READ_EVERY_S + 2.0)
    assert fleet.vessel.chart.is_empty


def test_a_return_point_means_nothing_wherever_it_lies():
    fleet = Fleet().sail(1.0)
    items = [(RETURN, 0.0, (9000.0, 0.0)), (ROUND_OUT, 5.0, (0.0, 40.0))]
    assert fleet.upload(COMPANION, items) == mavlink.MAV_MISSION_ACCEPTED


TIE = [(0.0, 0.0), (30.0, 30.0), (30.0, 0.0), (0.0, 30.0)]


@pytest.mark.parametrize(
    ("items", "result", "words"),
    [
        (corners(IN, TIE), mavlink.MAV_MISSION_DENIED, "crosses itself"),
        (corners(IN, BAY)[:-1], mavlink.MAV_MISSION_INVALID_PARAM1, "5 corners in a row"),
        ([(IN, 2.0, (0.0, 0.0))], mavlink.MAV_MISSION_INVALID_PARAM1, "at least 3"),
        ([(ROUND_OUT, 0.0, (0.0, 0.0))], mavlink.MAV_MISSION_INVALID_PARAM1, "a radius of 0 m"),
        ([(16, 0.0, (0.0, 0.0))], mavlink.MAV_MISSION_UNSUPPORTED, "MAV_CMD_NAV_FENCE"),
        ([(ROUND_IN, 9.0, (0.0, 0.0)), (ROUND_IN, 9.0, (99.0, 0.0))],
         mavlink.MAV_MISSION_DENIED, "leave no water"),
        ([(ROUND_OUT, 9.0, (9000.0, 0.0))], mavlink.MAV_MISSION_INVALID_PARAM5_X, "farther away"),
    ],
)  # fmt: skip
def test_fences_that_cannot_be_kept_are_refused_by_item_and_those_before_stay(items, result, words):
    fleet = Fleet().sail(1.0)
    fleet.upload(COMPANION, [(ROUND_IN, 200.0, (0.0, 0.0))])
    version = fleet.sail(0.2).vessel.chart.version
    assert fleet.upload(COMPANION, items) == result
    fleet.sail(1.0)
    assert words in fleet.texts()
    assert "fence refused: item" in fleet.texts()
    assert fleet.vessel.chart.version == version != 0


def test_a_fence_that_shuts_the_boat_out_is_named_and_takes_its_goals_back():
    fleet = Fleet().sail(1.0)
    assert fleet.goal(10.0, 0.0) == ["goal_set"]
    assert fleet.upload(COMPANION, [(ROUND_IN, 20.0, (500.0, 0.0))]) == 0
    fleet.sail(1.0)
    (outside,) = fleet.named("place_forbidden")
    assert "outside the fence (fence 1)" in outside
    assert "taken back" in fleet.named("goal_forbidden")[0]
    assert "outside the fence" in fleet.texts()


def test_without_a_datum_fences_are_named_and_not_kept():
    fleet = Fleet(datum=None).sail(1.0)
    assert fleet.upload(COMPANION, [(ROUND_IN, 20.0, (0.0, 0.0))]) == (
        mavlink.MAV_MISSION_UNSUPPORTED_FRAME
    )
    fleet.upload(AUTOPILOT, [(ROUND_IN, 20.0, (0.0, 0.0))])
    fleet.sail(2.0 * READ_EVERY_S + 2.0)
    (words,) = fleet.named("fences_refused")
    assert "autopilot.datum" in words
    assert fleet.vessel.chart.is_empty


def test_a_stranger_may_read_fences_but_not_change_them():
    fleet = Fleet().sail(1.0)
    fleet.upload(COMPANION, [(ROUND_IN, 200.0, (0.0, 0.0))])
    fleet.wire = Wire(42, 190)
    fleet.say(mavlink.MAVLink_mission_clear_all_message(*COMPANION, FENCE))
    fleet.sail(0.5)
    assert not fleet.vessel.chart.is_empty


PLACES = st.tuples(*[st.floats(-500.0, 500.0)] * 2)
ITEMS = st.lists(
    st.builds(
        FenceItem,
        st.sampled_from([IN, OUT, ROUND_IN, ROUND_OUT, RETURN]),
        st.sampled_from([3.0, 4.0, 5.0, 20.0]),
        PLACES.map(np.array),
    ),
    max_size=12,
)


@settings(max_examples=examples(100))
@given(items=ITEMS)
def test_any_items_are_fences_or_a_misfit_with_its_place(items):
    found = features_of(items)
    if isinstance(found, Misfit):
        assert 0 <= found.seq < len(items)
        assert found.fault.words
    else:
        assert StaticMap.of(found) is not None


@settings(max_examples=examples(50))
@given(circles=st.lists(st.tuples(st.booleans(), st.floats(1.0, 90.0), PLACES), max_size=5),
       place=PLACES)  # fmt: skip
def test_circles_forbid_by_their_distance(circles, place):
    items = [FenceItem(ROUND_IN if k else ROUND_OUT, r, np.array(c)) for k, r, c in circles]
    features = features_of(items)
    assert not isinstance(features, Misfit)
    chart = StaticMap.of(features)
    away = [float(np.hypot(*np.subtract(place, c))) / r for _, r, c in circles]
    # A circle's polygon is between 0.995 and 1.005 of its radius.
    if all(abs(share - 1.0) > 0.006 and share > 1e-9 for share in away):
        expected = any((share > 1.0) == k for share, (k, _, _) in zip(away, circles, strict=True))
        assert chart.forbidden(np.array([place]))[0] == expected
