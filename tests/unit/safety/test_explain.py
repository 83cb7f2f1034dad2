"""What the boat says that it is doing and why: against geometry, and against the rules."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from twinscrew.hil_sim.scenario import load_scenario
from twinscrew.hil_sim.sitl import SitlSettings, sail
from twinscrew.runtime.geometry import quaternion_from_euler
from twinscrew.runtime.messages import cdr
from twinscrew.runtime.messages.types import Decision, Objects, Odometry, Tracks
from twinscrew.runtime.recording.recording import find_recordings
from twinscrew.runtime.safety.events import (
    ASSURANCE_INTERVENED,
    ASSURANCE_RELEASED,
    POLICY_ERROR,
)
from twinscrew.runtime.safety.explain import (
    OWN_RADIUS_M,
    assurance_manoeuvre,
    closest_approach,
    explain,
)

S = 1_000_000_000
AHEAD, TO_STARBOARD, TO_PORT = (500.0, 500.0), (800.0, 0.0), (0.0, 800.0)
GOAL = np.array([40.0, 0.0])
METRES = st.floats(-100.0, 100.0)
SPEEDS = st.floats(-5.0, 5.0)


def odometry(surge=2.0, heading=0.0):
    return Odometry(
        stamp_ns=S,
        position_N=np.zeros(3),
        q_NB=quaternion_from_euler(0.0, 0.0, heading),
        velocity_B=np.array([surge, 0.0, 0.0]),
        rates_B=np.zeros(3),
    )


def decision(*seen, thrust=AHEAD, arrived=False, events=()):
    """Decide with tracks (north, east, v_north, v_east) of 1.5 m, numbered from 10."""
    rows = np.array(seen, float).reshape(-1, 4)
    count = len(rows)
    return Decision(
        stamp_ns=S,
        sequence=3,
        acted=True,
        thrust_rate=np.zeros(2),
        thrust=np.array(thrust),
        observation=None,
        objects=Objects(stamp_ns=S, p_L=np.empty((0, 2)), radius=np.empty(0), points=np.empty(0)),
        tracks=Tracks(
            stamp_ns=S,
            id=np.arange(10, 10 + count),
            p_N=rows[:, :2],
            v_N=rows[:, 2:],
            radius=np.full(count, 1.5),
            covariance=np.zeros((count, 4, 4)),
            age_s=np.zeros(count),
        ),
        arrived=arrived,
        events=events,
    )


def said(*seen, surge=2.0, assurance="", engaged=True, goal=GOAL, **more):
    one = decision(*seen, **more)
    return explain(one, odometry(surge), goal, engaged=engaged, assurance=assurance)


FROM_STARBOARD = (8.0, 10.0, 0.0, -2.0)
FROM_PORT = (8.0, -10.0, 0.0, 2.0)
HEAD_ON = (14.0, 0.5, -2.0, 0.0)
BUOY_AHEAD = (14.0, 1.0, 0.0, 0.0)


@given(METRES, METRES, SPEEDS, SPEEDS)
def test_the_closest_approach_is_the_least_of_all_later_distances(north, east, v_north, v_east):
    p, v = np.array([[north, east]]), np.array([[v_north, v_east]])
    near = closest_approach(p, v, np.array([1.5]))
    times = np.linspace(0.0, 2.0 * near.tcpa_s[0] + 10.0, 4001)
    gaps = np.hypot(*(p + v * times[:, None]).T) - 1.5 - OWN_RADIUS_M
    assert near.cpa_m[0] <= gaps.min() + 1e-3
    at_s = near.tcpa_s[0]
    assert near.cpa_m[0] == pytest.approx(np.hypot(*(p + v * at_s)[0]) - 1.5 - OWN_RADIUS_M)
    assert at_s >= 0.0


def test_it_gives_way_to_who_comes_from_starboard_and_says_by_which_rule():
    told = said(FROM_STARBOARD, thrust=TO_STARBOARD)
    assert told.sentence.startswith("Giving way to track 10 on the starboard side (rule 15)")
    assert "turning to starboard" in told.sentence
    assert (told.track, told.rule) == (10, 15)


def test_who_turns_the_wrong_way_is_not_said_to_give_way():
    told = said(FROM_STARBOARD, thrust=TO_PORT)
    assert told.sentence.startswith("Asked to give way to track 10")
    assert "turning to port" in told.sentence


def test_it_stands_on_for_who_comes_from_port():
    told = said(FROM_PORT)
    assert told.sentence.startswith("Standing on for track 10, which has to give way (rule 17)")
    assert told.rule == 17
    assert said(FROM_PORT, thrust=TO_PORT).sentence.startswith("Track 10 has to give way (rule 17)")


def test_a_head_on_meeting_is_one():
    told = said(HEAD_ON, thrust=TO_STARBOARD)
    assert told.sentence.startswith("Meeting track 10 head-on (rule 14), turning to starboard")
    assert told.rule == 14


def test_what_stands_still_has_no_rule():
    told = said(BUOY_AHEAD)
    assert told.sentence.startswith("Keeping clear of track 10 (which stands still)")
    assert told.rule == 0


def test_a_rules_track_comes_before_a_nearer_one_without_a_rule():
    assert said(BUOY_AHEAD, FROM_STARBOARD).track == 11


def test_the_alternatives_are_those_of_geometry():
    told = said((14.0, 0.0, 0.0, 0.0), surge=2.0).sentence
    assert "straight on contact" in told
    to_a_side = 14.0 * np.sin(np.radians(30.0)) - 1.5 - OWN_RADIUS_M
    assert f"30\u00b0 to port {to_a_side:.1f} m" in told
    assert f"30\u00b0 to starboard {to_a_side:.1f} m" in told
    assert f"stopping {14.0 - 1.5 - OWN_RADIUS_M:.1f} m" in told


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_the_side_on_which_a_way_is_free_is_the_right_one(side):
    told = said((14.0, 5.0 * side, 0.0, 0.0)).sentence
    port, starboard = (
        told.split(f"30\u00b0 to {name} ")[1].split(",")[0] for name in ("port", "starboard")
    )
    free, taken = (port, starboard) if side > 0 else (starboard, port)
    assert taken == "contact"
    assert float(free.removesuffix(" m")) > 5.0


def test_with_nothing_near_it_says_where_the_goal_is():
    told = said()
    assert told.sentence.startswith("Sailing to the goal, 40.0 m off, bearing 000\u00b0")
    assert (told.track, told.rule) == (-1, 0)
    assert np.isnan(told.cpa_m)


def test_what_recedes_or_is_far_is_not_spoken_of():
    assert said((-14.0, 0.0, -2.0, 0.0), (90.0, 0.0, 0.0, 0.0)).track == -1


def test_at_rest_it_says_why():
    assert said(arrived=True).sentence.startswith("Arrived: propellers at rest")
    assert said(goal=None).sentence == "Waiting for a goal: propellers at rest."
    assert said(engaged=False).sentence.startswith("Not driving, propellers at rest")
    failed = said(events=(POLICY_ERROR.at(S, "no number"),)).sentence
    assert failed == "Propellers at rest: policy error, no number."


def test_the_assurance_speaks_for_itself_until_it_lets_go():
    begun = decision(events=(ASSURANCE_INTERVENED.at(S, "brake: the command meets track 10"),))
    doing = assurance_manoeuvre(decision(), assurance_manoeuvre(begun, ""))
    assert doing == "brake: the command meets track 10"
    told = said(BUOY_AHEAD, assurance=doing).sentence
    assert told.startswith("The assurance overrides the policy (brake): the command meets track 10")
    assert assurance_manoeuvre(decision(events=(ASSURANCE_RELEASED.at(S),)), doing) == ""


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    folder = tmp_path_factory.mktemp("run")
    scenario = replace(load_scenario("crossing"), time_limit_s=6.0)
    report = sail(scenario, SitlSettings(lockstep=True), folder)
    return folder, report


@pytest.mark.slow
def test_every_decision_is_recorded_with_its_sentence_and_the_same_function_says_it_again(run):
    folder, _ = run
    for recording in find_recordings(folder):
        last = {}
        goal = engaged = None
        assurance, compared = "", 0
        for message in recording.messages():
            match message.topic:
                case "goal":
                    goal = cdr.decode_goal(message.payload).position_N
                case "engagement":
                    engaged = cdr.decode_engagement(message.payload).engaged
                case "explanation":
                    recorded = cdr.decode_explanation(message.payload)
                    one = last["decision"]
                    assurance = assurance_manoeuvre(one, assurance) if engaged else ""
                    again = explain(
                        one, last["odometry"], goal, engaged=bool(engaged), assurance=assurance
                    )
                    assert recorded.sequence == one.sequence
                    assert recorded.sentence == again.sentence
                    compared += 1
                case "odometry":
                    last["odometry"] = cdr.decode_odometry(message.payload)
                case "decision":
                    last["decision"] = cdr.decode_decision(message.payload)
        assert compared > 50
        assert compared == last["decision"].sequence + 1


def test_a_crossing_is_told_by_its_rules(run):
    folder, _ = run
    rules = {
        cdr.decode_explanation(message.payload).rule
        for recording in find_recordings(folder)
        for message in recording.messages(("explanation",))
    }
    assert {15, 17} <= rules
