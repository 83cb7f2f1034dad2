"""A vessel's view, from its messages."""

import json

import numpy as np
import pytest

from twinscrew.hil_sim.viewer.scene import Ended
from twinscrew.hil_sim.viewer.vessel import (
    FRESH_S,
    MOST_EVENTS,
    NEW_EVENTS,
    ROUTE_S,
    SHOWN,
    Series,
    Vessel,
)
from twinscrew.hil_sim.viewer.wire import SERIES
from twinscrew.runtime.charts.chart import as_message
from twinscrew.runtime.charts.static_map import Area, Disc, StaticMap
from twinscrew.runtime.geometry import quaternion_from_euler
from twinscrew.runtime.messages import cdr
from twinscrew.runtime.messages.topics import TOPICS
from twinscrew.runtime.messages.types import (
    Decision,
    Engagement,
    Explanation,
    Goal,
    HealthEvent,
    Objects,
    Observation,
    Odometry,
    PointCloud,
    Severity,
    Tracks,
)
from twinscrew.runtime.perception.sensor import load_sensor
from twinscrew.runtime.policy.colregs import Situation
from twinscrew.runtime.safety.events import AUTOPILOT_NOW, LIDAR_STALE, STATE, STATE_NOW

NORTH_EAST = np.array([10.0, 20.0])
S = 1_000_000_000


def odometry(heading=np.pi / 2, surge=2.0):
    return cdr.encode_odometry(
        Odometry(
            stamp_ns=S,
            position_N=np.array([*NORTH_EAST, 0.3]),
            q_NB=quaternion_from_euler(0.0, 0.0, heading),
            velocity_B=np.array([surge, 0.0, 0.0]),
            rates_B=np.zeros(3),
        )
    )


def tracks(p_N, v_N):
    count = len(p_N)
    return Tracks(
        stamp_ns=S,
        id=np.arange(count),
        p_N=np.array(p_N, float).reshape(-1, 2),
        v_N=np.array(v_N, float).reshape(-1, 2),
        radius=np.full(count, 1.5),
        covariance=np.zeros((count, 4, 4)),
        age_s=np.zeros(count),
    )


def decision(goal_B=None, objects_B=(), p_N=(), v_N=(), stamp_ns=S, arrived=False):
    observation = None
    if goal_B is not None:
        observation = Observation(
            ego=np.array([*goal_B, 0, 0, 0, 0, 0], np.float32),
            objects=np.zeros((5, 5), np.float32),
            mask=np.zeros(5, np.float32),
        )
    return cdr.encode_decision(
        Decision(
            stamp_ns=stamp_ns,
            sequence=41,
            acted=observation is not None,
            thrust_rate=np.zeros(2),
            thrust=np.zeros(2),
            observation=observation,
            objects=Objects(
                stamp_ns=S,
                p_L=np.array(objects_B, float).reshape(-1, 2),
                radius=np.full(len(objects_B), 0.7),
                points=np.full(len(objects_B), 30),
            ),
            tracks=tracks(p_N, v_N),
            arrived=arrived,
        )
    )


def scan(stamp_ns=S):
    points = np.array([[4.0, 0.0, 0.0], [5.0, 1.0, 0.0]], np.float32)
    return cdr.encode_point_cloud(PointCloud(stamp_ns=stamp_ns, frame_id="l", points_S=points))


@pytest.fixture
def vessel():
    return Vessel("wamv1", load_sensor("vrx32"))


def view(vessel, now_s=0.0):
    return json.loads(vessel.part(now_s).head)


def test_before_anything_came_only_the_name_is_known(vessel):
    assert view(vessel)["name"] == "wamv1"
    assert view(vessel)["pose"] is None
    assert view(vessel)["silent_s"] is None


def test_place_heading_and_velocity_are_in_frame_n(vessel):
    vessel.take("odometry", odometry(heading=np.pi / 2, surge=2.0), 0.0)
    assert view(vessel)["pose"] == pytest.approx([10.0, 20.0, np.pi / 2], abs=1e-3)
    assert view(vessel)["velocity"] == pytest.approx([0.0, 2.0], abs=0.01)


def test_its_chart_is_what_the_topic_says_last(vessel):
    mole = Area(kind="land", outline=np.array([(0.0, 0.0), (9.0, 0.0), (9.0, 5.0)]), name="Mole")
    rock = Disc(kind="hazard", centre=(30.0, 30.0), radius_m=2.0)
    for features in ((mole,), (mole, rock)):
        chart = as_message(StaticMap.of(features), S)
        vessel.take("chart", cdr.encode_chart(chart), 0.0)
        assert len(vessel.chart) == len(features)
    assert {(region.kind, region.name) for region in vessel.chart} == {
        ("land", "Mole"),
        ("hazard", ""),
    }
    assert vessel.charts == 2
    vessel.take("chart", b"no chart", 0.0)
    assert vessel.refused == 1
    assert len(vessel.chart) == 2


def test_its_route_is_shown_while_it_is_fresh(vessel):
    vessel.take("odometry", odometry(), 0.0)
    places = np.array([(10.0, 20.0), (15.0, 25.0), (30.0, 25.0)])
    vessel.take("planned_route", cdr.encode_path(places, stamp_ns=S, frame_id="map"), 0.0)
    assert view(vessel, 1.0)["route"] == places.tolist()
    assert view(vessel, 1.0 + ROUTE_S)["route"] == []


def test_the_goal_is_where_the_topic_says_or_else_where_the_policy_was_told_it_is(vessel):
    vessel.take("odometry", odometry(heading=np.pi / 2), 0.0)
    vessel.take("decision", decision(goal_B=(7.0, 3.0)), 0.0)
    assert view(vessel)["goal"] == pytest.approx([10.0 - 3.0, 20.0 + 7.0], abs=0.02)
    goal = Goal(stamp_ns=S, position_N=np.array([1.0, 2.0]))
    vessel.take("goal", cdr.encode_goal(goal), 0.0)
    assert view(vessel)["goal"] == [1.0, 2.0]


def test_objects_are_turned_from_the_vessels_frame_into_n(vessel):
    vessel.take("odometry", odometry(heading=np.pi / 2), 0.0)
    vessel.take("decision", decision(objects_B=[(5.0, 2.0)]), 0.0)
    assert view(vessel)["objects"] == [pytest.approx([10.0 - 2.0, 20.0 + 5.0, 0.7], abs=0.01)]


def test_a_track_says_what_colregs_ask(vessel):
    vessel.take("odometry", odometry(heading=0.0), 0.0)
    towards = [(20.0, 20.0), (18.0, 28.0), (60.0, 20.0)]
    moving = [(-2.0, 0.0), (0.0, -2.0), (-2.0, 0.0)]
    vessel.take("decision", decision(p_N=towards, v_N=moving), 0.0)
    asked = [track[7] for track in view(vessel)["tracks"]]
    assert asked == [Situation.HEAD_ON, Situation.GIVE_WAY, Situation.NONE]


def test_latency_is_from_a_scan_to_the_decision_on_it(vessel):
    vessel.take("odometry", odometry(), 0.0)
    vessel.take("points", scan(1 * S), 0.0, sent_s=5.0)
    vessel.take("points", scan(2 * S), 0.1, sent_s=5.1)
    vessel.take("decision", decision(stamp_ns=1 * S), 0.1, sent_s=5.0625)
    assert view(vessel)["latency_ms"] == 62.5
    vessel.take("decision", decision(stamp_ns=3 * S), 0.1, sent_s=9.0)
    assert view(vessel)["latency_ms"] == 62.5, "a decision on an unknown scan tells none"


def test_scans_whose_decisions_never_come_are_forgotten(vessel):
    for count in range(1000):
        vessel.take("points", scan(count), 0.0)
    assert len(vessel._sent_s) < 20


def test_what_is_old_is_not_shown_as_present(vessel):
    vessel.take("odometry", odometry(), 0.0)
    vessel.take("points", scan(), 0.0)
    vessel.take("thrust_left", cdr.encode_thrust(100.0), 0.0)
    vessel.take("decision", decision(objects_B=[(5.0, 2.0)], p_N=[(1, 1)], v_N=[(0, 0)]), 0.0)
    fresh = view(vessel, 0.9 * FRESH_S)
    old = view(vessel, 1.1 * FRESH_S)
    assert fresh["points"] == 2
    assert fresh["thrust"] == [100.0, 0.0]
    assert len(fresh["objects"]) == len(fresh["tracks"]) == 1
    assert (old["points"], old["thrust"], old["objects"], old["tracks"]) == (0, None, [], [])
    assert old["silent_s"] == pytest.approx(1.1 * FRESH_S, abs=0.01)
    assert old["pose"] is not None, "where it was last is still worth knowing"


def events(*happened):
    return cdr.encode_diagnostics(happened, stamp_ns=S)


def test_the_state_is_the_one_that_the_boat_told(vessel):
    vessel.take("odometry", odometry(), 0.0)
    vessel.take("diagnostics", events(STATE.at(S, "ready -> active"), LIDAR_STALE.at(S)), 1.0)
    vessel.take("diagnostics", events(STATE.at(S, "active -> safe")), 2.0)
    shown = view(vessel)
    assert shown["state"] == "safe"
    assert shown["events"][1] == [1.0, "lidar_stale", "error", ""]


def test_a_state_that_is_said_every_second_tells_a_late_viewer_and_fills_no_list(vessel):
    for second in range(5):
        vessel.take("diagnostics", events(STATE_NOW.at(S, "safe")), float(second))
    shown = view(vessel)
    assert shown["state"] == "safe"
    assert shown["events"] == []


def test_a_late_viewer_knows_the_way_before(vessel):
    before_N = np.array([[4.0, 20.0], [6.0, 20.0], [8.0, 20.0], [10.0, 20.0]])
    vessel.take("odometry", odometry(), 7.0)
    vessel.take("path", cdr.encode_path(before_N, stamp_ns=S), 7.1)
    assert [place[1] for place in vessel.trail.places] == [4.0, 6.0, 8.0, 10.0]


def test_a_viewer_that_came_late_knows_that_a_boat_whose_policy_is_asked_is_active(vessel):
    vessel.take("odometry", odometry(), 0.0)
    assert view(vessel)["state"] == "unknown"
    vessel.take("decision", decision(), 0.0)
    assert view(vessel)["state"] == "unknown"
    vessel.take("decision", decision(goal_B=(1.0, 1.0)), 0.0)
    assert view(vessel)["state"] == "active"


def test_only_the_last_events_are_kept(vessel):
    for count in range(MOST_EVENTS + 100):
        event = HealthEvent(stamp_ns=S, name=f"e{count}", severity=Severity.INFO)
        vessel.take("diagnostics", events(event), float(count))
    shown = view(vessel)
    assert len(shown["events"]) == NEW_EVENTS
    assert shown["events"][-1][1] == f"e{MOST_EVENTS + 99}"
    assert shown["event_count"] == MOST_EVENTS + 100
    assert len(vessel.events) == MOST_EVENTS


@pytest.mark.parametrize("topic", SHOWN)
@pytest.mark.parametrize("payload", [b"", b"\0\1\0\0", b"\xff" * 64])
def test_bytes_that_are_no_message_are_counted_and_change_nothing(vessel, topic, payload):
    vessel.take("odometry", odometry(), 0.0)
    before = view(vessel)
    vessel.take(topic, payload, 0.5)
    assert vessel.refused == 1
    assert view(vessel) == before


def test_a_cloud_whose_body_is_damaged_is_refused_when_it_would_be_drawn(vessel):
    vessel.take("odometry", odometry(), 0.0)
    vessel.take("points", scan()[:-10], 0.0)
    assert view(vessel)["points"] == 0
    assert vessel.refused == 1


def test_every_track_has_its_closest_approach(vessel):
    vessel.take("odometry", odometry(heading=0.0, surge=2.0), 0.0)
    vessel.take("decision", decision(p_N=[(20.0, 20.0), (10.0, 12.0)], v_N=[(0, 0), (0, -3)]), 0.0)
    ahead, beside = view(vessel)["tracks"]
    assert ahead[8:] == pytest.approx([10.0 - 1.5 - 2.795, -1.5 - 2.795, 5.0], abs=0.01)
    assert beside[10] == 0.0, "it draws apart already"
    assert beside[8] == pytest.approx(beside[9])


def test_the_sentence_is_the_runtimes_own_or_made_from_the_decision(vessel):
    vessel.take("odometry", odometry(), 0.0)
    vessel.take("engagement", cdr.encode_engagement(Engagement(stamp_ns=S, engaged=True)), 0.0)
    vessel.take("decision", decision(goal_B=(7.0, 3.0)), 0.0)
    assert view(vessel)["why"].startswith("Sailing to the goal, 7.6 m off")
    said = Explanation(stamp_ns=S, sequence=41, sentence="As I said.", track=3, rule=15)
    vessel.take("explanation", cdr.encode_explanation(said), 0.0)
    shown = view(vessel)
    assert (shown["why"], shown["about"], shown["rule"]) == ("As I said.", 3, 15)


def test_what_the_boat_says_of_its_autopilot_is_shown(vessel):
    vessel.take("diagnostics", events(AUTOPILOT_NOW.at(S, "MANUAL, armed, 12.6 V 87 %")), 0.0)
    shown = view(vessel)
    assert shown["autopilot"] == "MANUAL, armed, 12.6 V 87 %"
    assert shown["events"] == []
    assert shown["engaged"] is None


def ended(stamp_ns, north, outcome="goal"):
    return Ended(
        name="wamv1",
        outcome=outcome,
        stamp_ns=stamp_ns,
        travel_time_s=17.7,
        closest_approach_m=1.72,
        pose=(north, 20.0, 0.5),
    )


def test_an_arrived_vessel_is_where_it_is_held_at_rest_and_no_alarm(vessel):
    vessel.take("odometry", odometry(surge=3.3), 0.0)
    vessel.take("decision", decision(p_N=[(20.0, 20.0)], v_N=[(0, 0)]), 0.0)
    vessel.ends([ended(S + 50_000_000, 10.2), ended(3 * S, 11.8)])
    assert view(vessel)["ended"] is None, "not yet"
    vessel.take("diagnostics", events(LIDAR_STALE.at(S)), 1.0)
    just = view(vessel, 1.0)
    later = view(vessel, 2.5)
    assert (just["pose"][0], later["pose"][0]) == (10.2, 11.8)
    assert later["velocity"] == [0.0, 0.0]
    assert (later["state"], later["arrived"], later["silent_s"]) == ("goal", True, 0.0)
    assert later["ended"] == {
        "outcome": "goal", "travel_time_s": 17.7, "closest_approach_m": 1.72
    }  # fmt: skip
    assert later["tracks"] == []
    assert [event[1:3] for event in later["events"]] == [["arrived", "info"]]
    assert later["event_count"] == 1
    assert later["why"] == "Arrived after 17.7 s, nothing nearer than 1.7 m."


def test_a_vessel_that_collided_is_said_so(vessel):
    vessel.take("odometry", odometry(), 0.0)
    vessel.ends([ended(S, 10.0, "collision")])
    shown = view(vessel, 1.0)
    assert (shown["state"], shown["arrived"]) == ("collision", False)
    assert shown["events"][-1][1:3] == ["collided", "error"]


def test_a_vessel_that_fell_silent_at_its_goal_has_arrived_and_one_elsewhere_has_not():
    for goal, state in (((10.0, 22.0), "goal"), ((10.0, 29.0), "unknown")):
        vessel = Vessel("wamv1", load_sensor("vrx32"), goal_radius_m=2.0)
        vessel.take("goal", cdr.encode_goal(Goal(stamp_ns=S, position_N=np.array(goal))), 0.0)
        vessel.take("odometry", odometry(), 0.0)
        assert view(vessel, 0.5)["state"] == "unknown"
        assert view(vessel, 2.0)["state"] == state


def test_figures_are_kept_at_even_times_from_the_beginning_and_never_too_many():
    series = Series(step_s=0.2, most=100)
    for count in range(5000):
        if series.is_due(0.05 * count):
            series.add((0.05 * count,))
    times = np.array([row[0] for row in series.rows])
    assert times[0] == 0.0
    assert times[-1] > 240.0
    assert len(times) <= 100
    steps = np.diff(times)
    assert steps.max() < 2.1 * steps.min()


def test_the_figures_of_a_moment_are_what_was_known_then(vessel):
    vessel.take("odometry", odometry(heading=0.0, surge=2.0), 0.0)
    goal = Goal(stamp_ns=S, position_N=np.array([14.0, 23.0]))
    vessel.take("goal", cdr.encode_goal(goal), 0.0)
    vessel.take("decision", decision(p_N=[(20.0, 20.0)], v_N=[(0.0, 0.0)]), 0.0)
    vessel.take("thrust_left", cdr.encode_thrust(100.0), 0.0)
    vessel.note(0.1)
    (row,) = vessel.series.rows
    assert dict(zip(SERIES, row, strict=True)) == {
        "time_s": 0.1,
        "speed": 2.0,
        "to_goal": 5.0,
        "nearest": pytest.approx(10.0 - 1.5 - 2.795, abs=0.01),
        "cpa": pytest.approx(-1.5 - 2.795, abs=0.01),
        "left": 100.0,
        "right": 0.0,
        "latency": None,
    }


def test_every_shown_topic_exists():
    assert set(SHOWN) <= set(TOPICS)
