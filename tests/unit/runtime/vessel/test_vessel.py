"""A whole vessel without sockets: what it decides on, when it stops, and what lets it go on."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tests.harness.boat import (
    FAR_AHEAD,
    SECOND,
    TICK_S,
    Boat,
    Steady,
    cloud,
    feed,
    make_pipeline,
    odometry,
    stamp,
)

from twinscrew.hil_sim.autopilot.rover import Mode
from twinscrew.runtime.errors import PolicyError, TwinscrewError
from twinscrew.runtime.link.ardupilot.link import AutopilotLink, AutopilotSettings
from twinscrew.runtime.messages import cdr
from twinscrew.runtime.messages.types import Engagement, Goal
from twinscrew.runtime.safety.guard import Guard, ThrustLimits
from twinscrew.runtime.vessel.health import State
from twinscrew.runtime.vessel.outputs import Outputs
from twinscrew.runtime.vessel.vessel import Vessel


class Dock:
    """A vessel at the dock, and short words for what it takes in."""

    def __init__(self, *, engaged: bool = True, waypoints_m=FAR_AHEAD):
        self.policy = Steady()
        pipeline = make_pipeline(self.policy, waypoints_m)
        self.vessel = Vessel(pipeline, AutopilotLink(AutopilotSettings()))
        message = Engagement(stamp_ns=stamp(0), engaged=engaged)
        self.feed("engagement", cdr.encode_engagement(message))

    def feed(self, topic: str, payload: bytes) -> Outputs:
        return feed(self.vessel, topic, payload)

    def last_seen(self, topic: str) -> int | None:
        """[ns] The stamp of the last message that was a sign of life of its sensor."""
        return self.vessel._watchdog._inputs[topic].last_stamp_ns

    def odometry(self, time_s: float, north: float = 0.0) -> Outputs:
        return self.feed("odometry", cdr.encode_odometry(odometry(time_s, north)))

    def scan(self, time_s: float) -> Outputs:
        return self.feed("points", cdr.encode_point_cloud(cloud(time_s)))

    def sail(self, first_s: float, last_s: float, north: float = 0.0) -> list[Outputs]:
        times = np.arange(first_s, last_s + 1e-6, 0.1)
        return [(self.odometry(t, north), self.scan(t))[1] for t in times]


def names(*outcomes: Outputs) -> list[str]:
    return [event.name for outcome in outcomes for event in outcome.events]


def thrusts(outcomes: list[Outputs]) -> list[list[float]]:
    return [outcome.decision.thrust.tolist() for outcome in outcomes]


def test_every_scan_with_odometry_is_a_decision() -> None:
    outcomes = Dock().sail(0.0, 1.0)
    assert [o.decision.stamp_ns for o in outcomes] == [stamp(t / 10) for t in range(11)]
    assert names(*outcomes) == []
    assert thrusts(outcomes)[-1] == [150.0, 150.0]


def test_a_vessel_that_was_not_engaged_gives_no_thrust() -> None:
    assert not np.any(thrusts(Dock(engaged=False).sail(0.0, 2.0)))


def test_a_scan_without_odometry_near_its_time_is_not_used() -> None:
    dock = Dock()
    early = dock.scan(0.0)
    dock.odometry(0.1)
    late = dock.scan(0.35)
    assert names(early, late) == ["odometry_missing"] * 2
    assert early.decision is None
    assert late.decision is None
    assert dock.last_seen("points") is None


@pytest.mark.parametrize("time_s", [1.0, 0.95, 0.2])
def test_a_scan_twice_or_late_is_dropped_and_no_sign_of_life(time_s: float) -> None:
    dock = Dock()
    dock.sail(0.0, 1.0)
    late = dock.scan(time_s)
    assert names(late) == ["out_of_order"]
    assert late.decision is None
    assert dock.last_seen("points") == stamp(1.0)
    assert names(*dock.sail(1.1, 1.2)) == []


def test_odometry_twice_or_late_is_dropped_and_no_sign_of_life() -> None:
    dock = Dock()
    dock.sail(0.0, 1.0)
    twice, late = dock.odometry(1.0), dock.odometry(0.7)
    assert names(twice, late) == ["out_of_order"] * 2
    assert dock.last_seen("odometry") == stamp(1.0)


@pytest.mark.parametrize("first", ["odometry", "scan"])
def test_a_clock_set_back_forgets_everything_and_goes_on_from_there(first: str) -> None:
    dock = Dock()
    dock.sail(100.0, 103.0)
    told = getattr(dock, first)(50.0)
    assert names(told) == (
        ["clock_back"] if first == "odometry" else ["clock_back", "odometry_missing"]
    )
    assert dock.policy.resets == 1
    assert dock.vessel.stamp_ns == stamp(50.0)
    again = dock.sail(50.1, 51.3)
    assert names(*again) == []
    assert not np.any(thrusts(again)[:10])
    assert thrusts(again)[10] == [50.0, 50.0]


def test_one_stamp_from_the_far_future_costs_no_more_than_a_second() -> None:
    dock = Dock()
    dock.sail(0.0, 1.0)
    dock.odometry(1e6)
    dock.scan(1e6)
    assert names(dock.odometry(1.1)) == ["clock_back"]
    assert dock.scan(1.1).decision is not None
    again = dock.sail(1.2, 2.1)
    assert names(*again) == []
    assert np.any(thrusts(again)[-1])


def test_scans_of_which_every_second_is_stamped_ten_seconds_old_keep_the_boat_still() -> None:
    dock = Dock()
    assert np.any(thrusts(dock.sail(0.0, 2.0))[-1])
    for k in range(21, 60):
        dock.odometry(k / 10)
        outcome = dock.scan(k / 10 - (10.0 if k % 2 else 0.0))
        if k % 2:
            assert "clock_back" in names(outcome)
        assert outcome.decision is None or not np.any(outcome.decision.thrust)
        assert dock.vessel.pipeline.is_settling


def test_after_a_jump_the_boat_stands_still_for_a_second() -> None:
    dock = Dock()
    dock.sail(0.0, 2.0)
    assert names(dock.odometry(2.1, north=40.0)) == ["odometry_jump"]
    outcomes = dock.sail(2.2, 3.4, north=40.0)
    moving = [bool(np.any(thrust)) for thrust in thrusts(outcomes)]
    assert moving == [False] * 10 + [True] * 3  # a second after the first scan, at 2.2 s
    assert thrusts(outcomes)[10] == [50.0, 50.0]


def test_a_position_that_jumps_to_and_fro_keeps_the_boat_still() -> None:
    dock = Dock()
    dock.sail(0.0, 1.0)
    for k in range(11, 40):
        dock.odometry(k / 10, north=40.0 * (k % 2))
        assert not np.any(dock.scan(k / 10).decision.thrust)


def test_a_boat_that_moves_as_boats_do_does_not_jump() -> None:
    dock = Dock()
    told = [dock.odometry(k / 20, north=8.0 * k / 20) for k in range(100)]
    assert names(*told) == []


def test_odometry_a_thousand_times_a_second_fits_scans_that_come_late() -> None:
    dock = Dock()
    for k in range(3000):
        dock.odometry(k / 1000)
        if k >= 200 and k % 100 == 0:
            outcome = dock.scan((k - 150) / 1000)
            assert outcome.decision is not None
    assert np.any(outcome.decision.thrust)


def test_a_goal_is_taken_and_told() -> None:
    dock = Dock(waypoints_m=())
    goal = Goal(stamp_ns=stamp(0), position_N=np.array([30.0, -4.0]))
    told = dock.feed("goal", cdr.encode_goal(goal))
    assert names(told) == ["goal_set"]
    assert told.events[0].detail == "north 30.0 m, east -4.0 m"
    assert dock.sail(0.0, 0.0)[0].decision.observation.ego[:2].tolist() == [30.0, -4.0]


@pytest.mark.parametrize("topic", ["points", "odometry", "goal", "engagement"])
@pytest.mark.parametrize("payload", [b"", b"\x00\x01\x00\x00", b"\xff" * 300])
def test_bytes_that_are_no_message_are_an_event(topic: str, payload: bytes) -> None:
    dock = Dock()
    dock.sail(0.0, 1.0)
    told = dock.feed(topic, payload)
    assert names(told) == ["bad_message"]
    assert told.events[0].detail.startswith(f"{topic}: ")
    assert told.events[0].stamp_ns == stamp(1.0)
    assert names(*dock.sail(1.1, 1.2)) == []


def test_a_number_that_is_not_finite_is_no_odometry_and_no_goal() -> None:
    dock = Dock()
    dock.sail(0.0, 1.0)
    lost = Goal(stamp_ns=0, position_N=np.array([np.nan, 0.0]))
    assert names(dock.odometry(1.1, north=np.inf)) == ["bad_message"]
    assert names(dock.feed("goal", cdr.encode_goal(lost))) == ["bad_message"]


def test_a_cloud_of_nothing_but_nan_and_infinities_shows_no_object() -> None:
    dock = Dock()
    dock.odometry(0.0)
    points = np.array([[np.nan, 1, 2], [np.inf, -np.inf, 0], [1, np.nan, np.nan]] * 50)
    told = dock.feed("points", cdr.encode_point_cloud(cloud(0.0, points)))
    assert told.decision is not None
    assert len(told.decision.objects.p_L) == 0
    assert names(told) == []


def test_a_cloud_of_a_million_points_is_worked_on() -> None:
    dock = Dock()
    dock.odometry(0.0)
    points = np.random.default_rng(0).uniform(-30, 30, (1_000_000, 3))
    told = dock.feed("points", cdr.encode_point_cloud(cloud(0.0, points)))
    assert told.decision is not None
    assert dock.vessel.pipeline.perception.report.points == 1_000_000


def test_a_fault_of_the_policys_code_is_an_event_and_a_second_later_it_is_asked_again() -> None:
    dock = Dock()
    dock.sail(0.0, 1.0)
    dock.policy.failure = ZeroDivisionError("of ours")
    (failed,) = dock.sail(1.5, 1.5)
    assert names(failed) == ["internal_error"]
    assert failed.events[0].detail == "points: ZeroDivisionError: of ours"
    assert dock.policy.resets == 1
    dock.policy.failure = None
    assert thrusts(dock.sail(1.6, 2.5)) == [[0.0, 0.0]] * 10
    assert thrusts(dock.sail(2.6, 2.6)) == [[50.0, 50.0]]


def test_what_the_vessel_does_not_use_is_recorded_and_changes_nothing() -> None:
    """As the messages of a sensor that it has no settings for, whatever is in them."""
    out = Dock().feed("radar", b"no message at all")
    assert names(out) == []
    assert [taken.topic for taken in out.messages] == ["radar"]


LIMIT_S = 0.5
"""[s] From losing an input to neutral thrust, at most."""


def under_way(**options: object) -> Boat:
    boat = Boat(**options).sail(4.0)
    assert boat.moves
    assert boat.vessel.state is State.ACTIVE
    boat.events.clear()
    return boat


def silence(*topics: str):
    return lambda topic, payload: () if topic in topics else (payload,)


class Frozen:
    """A driver that repeats the last message of a topic for ever."""

    def __init__(self, topic: str) -> None:
        self.topic, self.last = topic, None

    def __call__(self, topic: str, payload: bytes):
        if topic != self.topic:
            return (payload,)
        self.last = self.last or payload
        return (self.last,)


def test_it_arms_the_boat_asks_the_policy_and_sails() -> None:
    boat = Boat().sail(4.0)
    changes = [name for name in boat.names if "->" in name]
    assert changes == ["standby -> safe", "safe -> active"]  # safe: it looks around first
    assert boat.autopilot.rover.armed
    assert boat.thrust.min() > 100.0


@pytest.mark.parametrize(
    ("topic", "event"), [("points", "lidar_stale"), ("odometry", "odometry_stale")]
)
@pytest.mark.parametrize("how", ["silent", "frozen"])
def test_losing_an_input_stops_the_boat_in_half_a_second(topic, event, how) -> None:
    boat = under_way()
    boat.line = silence(topic) if how == "silent" else Frozen(topic)
    lost_s = boat.now_s if how == "silent" else boat.sail(2 * TICK_S).now_s
    boat.sail(2.0)
    assert boat.stopped_by(lost_s) <= LIMIT_S
    assert boat.first(event) - lost_s <= LIMIT_S
    assert boat.vessel.state is State.SAFE
    assert not boat.moves


def test_scans_that_come_a_second_late_are_no_sign_of_life() -> None:
    boat = under_way()
    late: list[bytes] = []

    def slow(topic, payload):
        if topic != "points":
            return (payload,)
        late.append(payload)
        return (late.pop(0),) if len(late) > 10 else ()

    boat.line = slow
    lost_s = boat.now_s
    boat.sail(4.0)
    assert boat.stopped_by(lost_s) <= LIMIT_S
    assert boat.vessel.state is State.SAFE
    assert not boat.moves
    assert boat.names.count("input_late") > 20


@pytest.mark.parametrize("topic", ["points", "odometry"])
def test_an_input_that_comes_back_lets_the_boat_sail_on_without_a_restart(topic) -> None:
    boat = under_way()
    boat.line = silence(topic)
    boat.sail(3.0)
    boat.line = silence()
    boat.sail(1.5)
    assert "input_recovered" in boat.names
    assert boat.vessel.state is State.ACTIVE
    assert boat.moves


def test_after_a_loss_the_thrust_starts_from_zero() -> None:
    boat = under_way()
    boat.line = silence("points")
    boat.sail(1.0)
    boat.line = silence()
    boat.sail(0.4)
    assert 0.0 < boat.thrust.max() <= 100.0


def test_a_held_thrust_ends_when_scans_come_but_odometry_never_fits_them() -> None:
    boat = under_way()
    lost_s, old = boat.now_s, []

    def a_second_late(topic: str, payload: bytes):
        if topic == "points":
            return (payload,)
        old.append(payload)
        return (old.pop(0),) if len(old) > 20 else ()

    boat.line = a_second_late
    boat.sail(3.0)
    assert boat.stopped_by(lost_s) <= LIMIT_S
    assert "odometry_missing" in boat.names
    assert not boat.moves
    assert boat.vessel.state is State.SAFE


def test_damaged_bytes_are_no_sign_of_life() -> None:
    boat = under_way()
    lost_s = boat.now_s
    boat.line = lambda topic, payload: (payload[:-7],)
    boat.sail(1.0)
    assert boat.stopped_by(lost_s) <= LIMIT_S
    assert {"bad_message", "lidar_stale", "odometry_stale"} <= set(boat.names)


def test_every_message_twice_changes_nothing_but_the_log() -> None:
    once, twice = under_way(), under_way()
    twice.line = lambda topic, payload: (payload, payload)
    once.sail(3.0)
    twice.sail(3.0)
    assert twice.thrust.tolist() == once.thrust.tolist()
    assert twice.vessel.state is State.DEGRADED
    assert set(twice.names) == {"out_of_order", "active -> degraded"}


def test_a_jump_of_the_position_stops_the_boat_for_a_second() -> None:
    boat = under_way()
    jump_s = boat.now_s
    boat.place = (30.0, -30.0)
    boat.sail(0.5)
    assert boat.vessel.state is State.SAFE
    boat.sail(2.0)
    still = [t for t, thrust in boat.thrusts if t > jump_s and not thrust.any()]
    assert boat.stopped_by(jump_s) <= LIMIT_S
    assert still[-1] - still[0] == pytest.approx(1.0, abs=0.15)
    assert "odometry_jump" in boat.names
    assert boat.moves


def test_a_clock_set_back_an_hour_costs_a_second_of_thrust() -> None:
    boat = under_way()
    boat.clock_offset_s = -3600.0
    boat.sail(1.0)
    assert boat.names.count("clock_back") == 1
    assert boat.vessel.state is State.SAFE
    assert not boat.moves
    boat.sail(1.0)
    assert boat.vessel.state is State.ACTIVE
    assert 0.0 < boat.thrust.max() <= 150.0


def test_scans_of_which_every_second_is_ten_seconds_old_keep_the_boat_still_and_safe() -> None:
    boat = under_way()
    begun_s, ticks = boat.now_s, []

    def old(topic: str, payload: bytes):
        ticks.append(topic)
        if topic == "odometry" or ticks.count("points") % 2:
            return (payload,)
        scan = cdr.decode_point_cloud(payload)
        return (cdr.encode_point_cloud(replace(scan, stamp_ns=scan.stamp_ns - 10 * SECOND)),)

    boat.line = old
    boat.sail(5.0)
    assert boat.stopped_by(begun_s) <= LIMIT_S
    assert not any(thrust.any() for t, thrust in boat.thrusts if t > begun_s + LIMIT_S)
    assert boat.names.count("clock_back") > 20
    assert boat.vessel.state is State.SAFE


def test_a_runtime_that_starts_in_an_armed_boat_looks_around_for_a_second_first() -> None:
    boat = Boat()
    boat.autopilot.rover.arm(force=True)
    boat.sail(4.0)
    first_s = next(t for t, thrust in boat.thrusts if thrust.any())
    assert first_s == pytest.approx(1.3, abs=0.25)  # the first scan comes at 0.1 s


def test_on_waking_from_a_stop_in_which_the_sensors_died_nothing_is_driven_or_asked_for() -> None:
    boat = under_way()
    stopped_s = boat.now_s
    boat.freeze(3.0, sensors_live_s=0.2)
    boat.line = silence("points", "odometry")
    boat.sail(6.0)
    assert boat.driven[-1] <= stopped_s
    assert {"lidar_stale", "odometry_stale"} <= set(boat.names)
    assert boat.vessel.state is State.SAFE


def test_on_waking_from_a_stop_with_live_sensors_the_boat_sails_on() -> None:
    boat = under_way()
    boat.freeze(3.0, sensors_live_s=3.0)
    boat.sail(3.0)
    assert boat.moves
    assert boat.vessel.state is State.ACTIVE


def test_a_pilots_mode_change_wins_and_is_not_undone() -> None:
    boat = under_way()
    taken_s = boat.now_s
    boat.autopilot.rover.set_mode(Mode.HOLD)
    boat.sail(10.0)
    assert boat.stopped_by(taken_s) <= 2 * TICK_S
    assert boat.autopilot.rover.mode is Mode.HOLD
    assert "mode_taken" in boat.names
    assert "override_ignored" not in boat.names
    assert boat.vessel.state is State.READY
    boat.autopilot.rover.set_mode(Mode.MANUAL)
    boat.sail(2.0)
    assert boat.moves


def test_a_boat_that_was_disarmed_stays_disarmed() -> None:
    boat = under_way()
    boat.autopilot.rover.disarm()
    boat.sail(2.0)
    asked = boat.policy.asked
    boat.sail(8.0)
    assert not boat.autopilot.rover.armed
    assert "autopilot_disarmed" in boat.names
    assert "override_ignored" not in boat.names
    assert boat.vessel.state is State.READY
    assert boat.policy.asked == asked


@pytest.mark.parametrize("cut_s", [1.5, 3.0])
def test_a_silent_autopilot_stops_the_runtime_and_is_found_again(cut_s) -> None:
    boat = under_way()
    lost_s = boat.now_s
    boat.wire = False
    boat.sail(cut_s)
    assert boat.first("autopilot_silent") - lost_s <= 0.6
    assert boat.vessel.thrust.tolist() == [0.0, 0.0]
    assert boat.vessel.state is State.SAFE
    assert not boat.moves  # its own failsafe
    boat.wire = True
    boat.sail(8.0)
    if boat.autopilot.rover.mode is Mode.HOLD:  # which a pilot may have chosen: it is not left
        assert boat.vessel.state is State.READY
        boat.autopilot.rover.set_mode(Mode.MANUAL)
        boat.sail(2.0)
    assert boat.vessel.state is State.ACTIVE
    assert boat.moves


def test_overrides_that_are_ignored_are_named_and_thrust_is_withheld() -> None:
    rover = {"parameters": {"SYSID_MYGCS": 255.0}, "receiver": True}
    boat = Boat(rover=rover, accept_parameters=("SYSID_MYGCS",))
    boat.autopilot.rover.arm(force=True)
    boat.sail(6.0)
    assert "override_ignored" in boat.names
    assert not boat.vessel.engaged


@pytest.mark.slow
def test_an_autopilot_that_goes_on_disobeying_is_not_tried_for_ever() -> None:
    boat = Boat(rover={"parameters": {"PILOT_STEER_TYPE": 0.0}}).sail(60.0)
    given_up_s = boat.now_s
    boat.sail(60.0)
    assert not any(thrust.any() for when_s, thrust in boat.thrusts if when_s > given_up_s)
    boat.autopilot.rover.parameters.set("PILOT_STEER_TYPE", 1.0)
    boat.sail(5.0)
    assert boat.moves
    assert boat.vessel.state is State.ACTIVE


def test_without_permission_to_arm_it_waits_for_somebody() -> None:
    boat = Boat(arm=False).sail(5.0)
    assert not boat.autopilot.rover.armed
    assert boat.vessel.state is State.READY
    boat.autopilot.rover.arm()
    boat.sail(2.0)
    assert boat.moves


def test_a_policy_that_fails_makes_the_boat_safe_until_it_answers_again() -> None:
    boat = under_way()
    failed_s = boat.now_s
    boat.policy.failure = PolicyError("it answered with NaN")
    boat.sail(2.0)
    assert boat.stopped_by(failed_s) <= boat.policy.period_s + TICK_S
    assert boat.vessel.state is State.SAFE
    boat.policy.failure = None
    boat.sail(0.5)
    assert boat.vessel.state is State.ACTIVE
    assert boat.moves


@pytest.mark.parametrize("failure", [ZeroDivisionError("of ours"), TwinscrewError("unforeseen")])
def test_a_fault_of_our_own_stops_the_boat_and_not_the_loop(failure) -> None:
    boat = under_way()
    boat.policy.failure = failure
    boat.sail(2.0)
    assert not boat.moves
    assert boat.vessel.state is State.SAFE
    assert set(boat.names) == {"internal_error", "active -> safe"}
    detail = next(event.detail for _, event in boat.events if event.name == "internal_error")
    assert str(failure) in detail
    boat.policy.failure = None
    boat.sail(1.5)
    assert boat.moves
    assert boat.vessel.state is State.ACTIVE


def test_arriving_ends_in_ready_with_the_propellers_at_rest() -> None:
    boat = under_way(waypoints_m=((50.0, 0.0),))
    boat.place = (49.0, 0.0)
    boat.sail(2.0)
    assert "goal_reached" in boat.names
    assert boat.vessel.state is State.READY
    assert not boat.moves


def test_a_boat_without_a_goal_is_the_pilots_where_a_receiver_is_fitted() -> None:
    boat = Boat(waypoints_m=(), receiver_fitted=True, rover={"receiver": True}).sail(4.0)
    assert boat.vessel.state is State.READY
    assert boat.vessel.tick(boat.now_s + TICK_S).autopilot == b""


def test_at_rest_the_last_bytes_stop_the_propellers() -> None:
    boat = under_way()
    boat.autopilot.receive(boat.vessel.rest(boat.now_s), boat.now_s)
    boat.autopilot.step(boat.now_s + 0.01)
    assert not boat.moves


def test_the_last_guard_stands_between_any_thrust_and_the_wire(monkeypatch) -> None:
    boat = under_way()
    checked = []
    check = Guard.check
    monkeypatch.setattr(
        Guard, "check", lambda self, thrust, ns: checked.append(thrust) or check(self, thrust, ns)
    )
    boat.vessel.tick(boat.now_s)
    assert [thrust.tolist() for thrust in checked] == [boat.vessel.thrust.tolist()]


def test_a_thrust_that_the_last_guard_refuses_is_zero_and_reported_once_a_decision() -> None:
    boat = Boat(limits=ThrustLimits(min_n=-500.0, max_n=120.0))  # the pipeline allows 1000 N
    tripped_s = boat.sail(5.0).first("guard_tripped")
    assert any(thrust.any() for t, thrust in boat.thrusts if t < tripped_s)
    assert not any(thrust.any() for t, thrust in boat.thrusts if t > tripped_s)
    assert boat.vessel.state is State.SAFE
    decisions = round((boat.now_s - tripped_s) / 0.1)
    assert boat.names.count("guard_tripped") == pytest.approx(decisions, abs=1)


def test_events_of_the_link_bear_the_vessels_time() -> None:
    boat = Boat().sail(4.0)
    stamps = [event.stamp_ns for _, event in boat.events if event.name == "autopilot_says"]
    assert stamps
    assert all(abs(ns - boat.vessel.stamp_ns) < 5e9 for ns in stamps)


def test_two_boats_with_the_same_past_do_the_same() -> None:
    first, second = (Boat(Steady((40.0, 90.0))).sail(6.0) for _ in range(2))
    assert [e for _, e in first.events] == [e for _, e in second.events]
    assert all((a[1] == b[1]).all() for a, b in zip(first.thrusts, second.thrusts, strict=True))


def test_the_boat_says_what_it_does_and_why_and_that_it_is_held() -> None:
    boat = under_way()
    vessel = boat.vessel
    assert vessel.decision is not None
    said = vessel.explain(vessel.decision)
    assert said is not None
    assert said.sentence.startswith("Sailing to the goal")
    boat.line = silence("points")
    boat.sail(2.0)
    said = vessel.explain(vessel.decision)
    assert said is not None
    assert said.sentence.startswith("Not driving, propellers at rest")


def test_words_that_cannot_be_made_are_left_out_and_stop_nothing(monkeypatch) -> None:
    def stumble(*_: object, **__: object) -> None:
        raise ZeroDivisionError("in making a sentence")

    boat = under_way()
    vessel = boat.vessel
    assert vessel.decision is not None
    monkeypatch.setattr("twinscrew.runtime.vessel.vessel.explain", stumble)
    assert vessel.explain(vessel.decision) is None
