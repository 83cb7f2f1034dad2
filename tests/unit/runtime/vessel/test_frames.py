"""Frames: their names, the transforms that are given, and goals in any of them."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation
from tests.harness.boat import Steady, cloud, make_pipeline, odometry, stamp

from twinscrew.runtime.bus.base import Received
from twinscrew.runtime.errors import ConfigError
from twinscrew.runtime.geometry import quaternion_from_euler
from twinscrew.runtime.link.ardupilot.link import AutopilotLink, AutopilotSettings
from twinscrew.runtime.messages import cdr
from twinscrew.runtime.messages.topics import type_store
from twinscrew.runtime.messages.types import Goal
from twinscrew.runtime.messages.visual import TRANSFORMS_TYPE
from twinscrew.runtime.perception.sensor import load_sensor
from twinscrew.runtime.settings import convert
from twinscrew.runtime.vessel.frames import FrameError, Frames, FrameSettings, StaticTransform
from twinscrew.runtime.vessel.vessel import Vessel

MAP_ODOM = StaticTransform(parent="map", child="odom", x_m=100.0, y_m=-20.0, yaw_rad=math.pi / 2)


class Deck:
    """A vessel that is fed messages, with odometry in a frame of its own."""

    def __init__(self, settings=None, *, frame_id="odom", child_frame_id="wamv/base_link"):
        link = AutopilotLink(AutopilotSettings())
        frames = Frames(settings or FrameSettings(static=(MAP_ODOM,)), "wamv", load_sensor("vrx16"))
        self.vessel = Vessel(make_pipeline(Steady(), ()), link, frames=frames)
        self.names = {"frame_id": frame_id, "child_frame_id": child_frame_id}

    def feed(self, topic, payload):
        return self.vessel.handle(Received(topic, payload, 0), 1.0).events

    def sail(self, time_s, north=10.0, east=5.0, heading=math.pi / 2):
        made = replace(
            odometry(time_s, north, east),
            q_NB=quaternion_from_euler(0.0, 0.0, heading),
            **self.names,
        )
        return self.feed("odometry", cdr.encode_odometry(made))

    def goal(self, y, x, frame_id, time_s=0.0):
        made = Goal(stamp_ns=stamp(time_s), position_N=np.array([y, x]))
        return self.feed("goal", cdr.encode_goal(made, frame_id=frame_id))

    def heads_for(self):
        goal = self.vessel.pipeline.mission.goal
        return None if goal is None else goal.position_N.tolist()


def test_a_goal_in_the_vessels_frame_lies_before_its_bow_and_not_north():
    deck = Deck()
    deck.sail(0.0)  # at north 10 m, east 5 m, heading east
    (told,) = deck.goal(0.0, 40.0, "wamv/base_link")  # x = 40 m: ahead
    assert told.name == "goal_set"
    assert deck.heads_for() == pytest.approx([10.0, 45.0])
    deck.goal(30.0, 0.0, "wamv/base_link")  # y = 30 m: to port, which is north
    assert deck.heads_for() == pytest.approx([40.0, 5.0])


def test_a_goal_in_the_vessels_frame_is_where_the_vessel_was_at_its_stamp():
    deck = Deck()
    for k in range(5):
        deck.sail(k / 10, east=5.0 + k)
    deck.goal(0.0, 40.0, "wamv/base_link", time_s=0.15)
    assert deck.heads_for() == pytest.approx([10.0, 46.5])
    now = Goal(stamp_ns=0, position_N=np.array([0.0, 40.0]))  # ROS: 0 is the newest
    deck.feed("goal", cdr.encode_goal(now, frame_id="wamv/base_link"))
    assert deck.heads_for() == pytest.approx([10.0, 49.0])


def test_a_goal_in_a_static_frame_is_turned_and_moved():
    deck = Deck()
    deck.sail(0.0)
    deck.goal(-17.0, 104.0, "map")  # odom is at (100, -20), its x axis along the map's y
    assert deck.heads_for() == pytest.approx([-4.0, 3.0])  # x 3 m, y -4 m in odom


@pytest.mark.parametrize(
    ("frame_id", "time_s", "words"),
    [
        ("utm", 0.0, "'utm' is in no known place; known are 'odom', 'wamv/base_link', 'map'"),
        ("wamv2/base_link", 0.0, "'wamv2/base_link' is in no known place"),
        ("wamv/base_link", 60.0, "there is no odometry near that time"),
    ],
)
def test_a_goal_that_cannot_be_placed_is_refused_by_name_and_the_old_one_stays(
    frame_id, time_s, words
):
    deck = Deck()
    deck.sail(0.0)
    deck.goal(1.0, 2.0, "odom")
    (told,) = deck.goal(30.0, 40.0, frame_id, time_s)
    assert told.name == "goal_frame"
    assert words in told.detail
    assert deck.heads_for() == [1.0, 2.0]


@pytest.mark.parametrize("frame_id", ["", "odom"])
def test_a_goal_in_the_odometrys_frame_or_in_none_is_taken_as_it_is(frame_id):
    deck = Deck()
    deck.sail(0.0)
    deck.goal(40.0, 30.0, frame_id)
    assert deck.heads_for() == [40.0, 30.0]


def test_a_goal_before_the_first_odometry_is_looked_at_when_its_frame_is_known():
    right, ahead, wrong = Deck(), Deck(), Deck()
    assert [e.name for e in right.goal(40.0, 30.0, "odom")] == ["goal_set"]
    right.sail(0.0)
    assert right.heads_for() == [40.0, 30.0]
    ahead.goal(0.0, 40.0, "wamv/base_link")
    ahead.sail(0.0)
    assert ahead.heads_for() == pytest.approx([10.0, 45.0])
    wrong.goal(40.0, 30.0, "utm")
    assert [event.name for event in wrong.sail(0.0)] == ["goal_set", "goal_frame"]
    assert wrong.heads_for() is None


def test_a_route_is_placed_as_a_whole_and_stopping_is_never_refused():
    deck = Deck()
    deck.sail(0.0)
    places = np.array([[0.0, 10.0], [5.0, 20.0]])
    deck.feed("route", cdr.encode_path(places, stamp_ns=stamp(0.0), frame_id="wamv/base_link"))
    assert deck.heads_for() == pytest.approx([10.0, 15.0])
    (refused,) = deck.feed("route", cdr.encode_path(places, stamp_ns=0, frame_id="utm"))
    assert refused.name == "goal_frame"
    nothing = cdr.encode_path(np.empty((0, 2)), stamp_ns=0, frame_id="utm")
    assert [event.name for event in deck.feed("route", nothing)] == ["goal_set"]
    assert deck.heads_for() is None


def test_a_route_whose_places_name_different_frames_is_refused():
    store = type_store()
    payload = cdr.encode_path(np.zeros((2, 2)), stamp_ns=0, frame_id="odom")
    message = store.deserialize_cdr(payload, "nav_msgs/msg/Path")
    message.poses[1].header.frame_id = "map"
    deck = Deck()
    deck.sail(0.0)
    (told,) = deck.feed("route", bytes(store.serialize_cdr(message, "nav_msgs/msg/Path")))
    assert (told.name, told.detail) == ("goal_frame", "places in several frames: 'odom', 'map'")


def test_odometry_that_comes_in_another_frame_is_a_jump_and_takes_the_goals_back():
    deck = Deck()
    deck.sail(0.0)
    deck.goal(40.0, 30.0, "odom")
    deck.names["frame_id"] = "map"
    events = deck.sail(0.1)
    assert [event.name for event in events] == ["odometry_jump", "goal_set"]
    assert "from frame 'odom' to 'map'" in events[0].detail
    assert deck.heads_for() is None


coordinates = st.floats(-1e3, 1e3)
angles = st.floats(-3.0, 3.0)


@given(
    st.tuples(coordinates, coordinates, coordinates, angles, angles, angles),
    st.tuples(coordinates, coordinates, angles, angles, angles),
    st.tuples(coordinates, coordinates),
)
def test_a_place_goes_through_the_whole_tree_as_rotations_of_scipy_take_it(edge, pose, place):
    x, y, z, roll, pitch, yaw = edge
    mast = StaticTransform(
        parent="b", child="mast", x_m=x, y_m=y, z_m=z, roll_rad=roll, pitch_rad=pitch, yaw_rad=yaw
    )
    frames = Frames(FrameSettings(static=(MAP_ODOM, mast)), "b")
    north, east, *euler = pose
    here = replace(
        odometry(0.0, north, east),
        q_NB=quaternion_from_euler(*euler),
        frame_id="odom",
        child_frame_id="b",
    )
    frames.follow(here)
    found = frames.places_N(("mast",), np.array([[place[1], place[0]]]), 0, lambda _: here)
    in_body = Rotation.from_euler("xyz", (roll, pitch, yaw)).apply((*place, 0.0)) + np.array(
        [x, y, z]
    )
    in_frd = in_body * (1, -1, -1)
    down = Rotation.from_euler("xyz", euler).apply(in_frd) + np.array([north, east, 0.0])
    np.testing.assert_allclose(found[0], down[:2], atol=1e-8)


def read(payload):
    message = type_store().deserialize_cdr(payload, TRANSFORMS_TYPE)
    return [(t.header.frame_id, t.child_frame_id) for t in message.transforms]


def test_names_come_from_the_messages_else_from_the_vessels_name():
    frames = Frames(None, "wamv1", load_sensor("vrx16"))
    assert read(frames.moving(odometry(0.0))) == [("world", "wamv1/base_link")]
    frames.follow(replace(odometry(0.0), frame_id="map", child_frame_id="wamv1/base_link"))
    frames.see("wamv1/wamv1/base_link/lidar")
    assert read(frames.moving(odometry(0.0))) == [("map", "wamv1/base_link")]
    assert read(frames.static(0)) == [("wamv1/base_link", "wamv1/wamv1/base_link/lidar")]
    assert frames.static(999_999_999) is None
    assert frames.static(1_000_000_000) is not None


def test_names_in_the_settings_are_above_those_of_the_messages_and_both_are_understood():
    frames = Frames(FrameSettings(world="map", vessel="boat"), "wamv1")
    here = replace(odometry(0.0, 1.0, 2.0), frame_id="odom", child_frame_id="base_link")
    frames.follow(here)
    assert read(frames.moving(here)) == [("map", "boat")]
    for name in ("boat", "base_link"):
        ahead = frames.places_N((name,), np.array([[0.0, 3.0]]), 0, lambda _: here)
        np.testing.assert_allclose(ahead, [[4.0, 2.0]])
    assert frames.is_world("odom")
    with pytest.raises(FrameError, match="'world' is in no known place"):
        frames.places_N(("world",), np.zeros((1, 2)), 0, lambda _: here)


@pytest.mark.parametrize(
    ("static", "words"),
    [
        ([{"parent": "a", "child": "b"}, {"parent": "c", "child": "b"}], "'b' has two parents"),
        ([{"parent": "a", "child": "a"}], "'a' is its own ancestor"),
        ([{"parent": "a", "child": "b"}, {"parent": "b", "child": "a"}], "its own ancestor"),
        ([{"parent": "", "child": "a"}], "length"),
    ],
)
def test_what_is_no_tree_is_refused(static, words):
    with pytest.raises(ConfigError, match=words):
        convert({"static": static}, FrameSettings)


def test_a_lidar_that_the_settings_place_is_not_placed_twice():
    lidar = StaticTransform(parent="boat", child="lidar", z_m=2.0)
    frames = Frames(FrameSettings(vessel="boat", static=(lidar,)), "", load_sensor("vrx16"))
    frames.see(cloud(0.0).frame_id)
    assert read(frames.static(0)) == [("boat", "lidar")]
