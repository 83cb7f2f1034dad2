"""The whole boat, sans sockets: how long it takes to stop, and what lets it sail on."""

from dataclasses import replace

import pytest
from tests.harness.boat import SECOND, TICK_S, Boat, Steady

from twinscrew.hil_sim.autopilot.rover import Mode
from twinscrew.runtime.app.health import State
from twinscrew.runtime.errors import PolicyError, TwinscrewError
from twinscrew.runtime.messages import cdr
from twinscrew.runtime.safety.guard import Guard

LIMIT_S = 0.5
"""[s] From losing an input to neutral thrust, at most."""


def under_way(**options: object) -> Boat:
    boat = Boat(**options).sail(4.0)
    assert boat.moves
    assert boat.controller.state is State.ACTIVE
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
    assert boat.controller.state is State.SAFE
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
    assert boat.controller.state is State.SAFE
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
    assert boat.controller.state is State.ACTIVE
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
    assert boat.controller.state is State.SAFE


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
    assert twice.controller.state is State.DEGRADED
    assert set(twice.names) == {"out_of_order", "active -> degraded"}


def test_a_jump_of_the_position_stops_the_boat_for_a_second() -> None:
    boat = under_way()
    jump_s = boat.now_s
    boat.place = (30.0, -30.0)
    boat.sail(0.5)
    assert boat.controller.state is State.SAFE
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
    assert boat.controller.state is State.SAFE
    assert not boat.moves
    boat.sail(1.0)
    assert boat.controller.state is State.ACTIVE
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
    assert boat.controller.state is State.SAFE


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
    assert boat.controller.state is State.SAFE


def test_on_waking_from_a_stop_with_live_sensors_the_boat_sails_on() -> None:
    boat = under_way()
    boat.freeze(3.0, sensors_live_s=3.0)
    boat.sail(3.0)
    assert boat.moves
    assert boat.controller.state is State.ACTIVE


def test_a_pilots_mode_change_wins_and_is_not_undone() -> None:
    boat = under_way()
    taken_s = boat.now_s
    boat.autopilot.rover.set_mode(Mode.HOLD)
    boat.sail(10.0)
    assert boat.stopped_by(taken_s) <= 2 * TICK_S
    assert boat.autopilot.rover.mode is Mode.HOLD
    assert "mode_taken" in boat.names
    assert "override_ignored" not in boat.names
    assert boat.controller.state is State.READY
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
    assert boat.controller.state is State.READY
    assert boat.policy.asked == asked


@pytest.mark.parametrize("cut_s", [1.5, 3.0])
def test_a_silent_autopilot_stops_the_runtime_and_is_found_again(cut_s) -> None:
    boat = under_way()
    lost_s = boat.now_s
    boat.wire = False
    boat.sail(cut_s)
    assert boat.first("autopilot_silent") - lost_s <= 0.6
    assert boat.controller.thrust.tolist() == [0.0, 0.0]
    assert boat.controller.state is State.SAFE
    assert not boat.moves  # its own failsafe
    boat.wire = True
    boat.sail(8.0)
    if boat.autopilot.rover.mode is Mode.HOLD:  # which a pilot may have chosen: it is not left
        assert boat.controller.state is State.READY
        boat.autopilot.rover.set_mode(Mode.MANUAL)
        boat.sail(2.0)
    assert boat.controller.state is State.ACTIVE
    assert boat.moves


def test_overrides_that_are_ignored_are_named_and_thrust_is_withheld() -> None:
    rover = {"parameters": {"SYSID_MYGCS": 255.0}, "receiver": True}
    boat = Boat(rover=rover, accept_parameters=("SYSID_MYGCS",))
    boat.autopilot.rover.arm(force=True)
    boat.sail(6.0)
    assert "override_ignored" in boat.names
    assert not boat.controller.engaged


def test_an_autopilot_that_goes_on_disobeying_is_not_tried_for_ever() -> None:
    boat = Boat(rover={"parameters": {"PILOT_STEER_TYPE": 0.0}}).sail(60.0)
    given_up_s = boat.now_s
    boat.sail(60.0)
    assert not any(thrust.any() for when_s, thrust in boat.thrusts if when_s > given_up_s)
    boat.autopilot.rover.parameters.set("PILOT_STEER_TYPE", 1.0)
    boat.sail(5.0)
    assert boat.moves
    assert boat.controller.state is State.ACTIVE


def test_without_permission_to_arm_it_waits_for_somebody() -> None:
    boat = Boat(arm=False).sail(5.0)
    assert not boat.autopilot.rover.armed
    assert boat.controller.state is State.READY
    boat.autopilot.rover.arm()
    boat.sail(2.0)
    assert boat.moves


def test_a_policy_that_fails_makes_the_boat_safe_until_it_answers_again() -> None:
    boat = under_way()
    failed_s = boat.now_s
    boat.policy.failure = PolicyError("it answered with NaN")
    boat.sail(2.0)
    assert boat.stopped_by(failed_s) <= boat.policy.period_s + TICK_S
    assert boat.controller.state is State.SAFE
    boat.policy.failure = None
    boat.sail(0.5)
    assert boat.controller.state is State.ACTIVE
    assert boat.moves


@pytest.mark.parametrize("failure", [ZeroDivisionError("of ours"), TwinscrewError("unforeseen")])
def test_a_fault_of_our_own_stops_the_boat_and_not_the_loop(failure) -> None:
    boat = under_way()
    boat.policy.failure = failure
    boat.sail(2.0)
    assert not boat.moves
    assert boat.controller.state is State.SAFE
    assert set(boat.names) == {"internal_error", "active -> safe"}
    detail = next(event.detail for _, event in boat.events if event.name == "internal_error")
    assert str(failure) in detail
    boat.policy.failure = None
    boat.sail(1.5)
    assert boat.moves
    assert boat.controller.state is State.ACTIVE


def test_arriving_ends_in_ready_with_the_propellers_at_rest() -> None:
    boat = under_way(waypoints_m=((50.0, 0.0),))
    boat.place = (49.0, 0.0)
    boat.sail(2.0)
    assert "goal_reached" in boat.names
    assert boat.controller.state is State.READY
    assert not boat.moves


def test_a_boat_without_a_goal_is_the_pilots_where_a_receiver_is_fitted() -> None:
    boat = Boat(waypoints_m=(), receiver_fitted=True, rover={"receiver": True}).sail(4.0)
    assert boat.controller.state is State.READY
    assert boat.controller.command(boat.now_s + TICK_S) == b""


def test_at_rest_the_last_bytes_stop_the_propellers() -> None:
    boat = under_way()
    boat.autopilot.receive(boat.controller.rest(boat.now_s), boat.now_s)
    boat.autopilot.step(boat.now_s + 0.01)
    assert not boat.moves


def test_the_last_guard_stands_between_any_thrust_and_the_wire(monkeypatch) -> None:
    boat = under_way()
    checked = []
    check = Guard.check
    monkeypatch.setattr(
        Guard, "check", lambda self, thrust, ns: checked.append(thrust) or check(self, thrust, ns)
    )
    boat.controller.command(boat.now_s)
    assert [thrust.tolist() for thrust in checked] == [boat.controller.thrust.tolist()]


def test_events_of_the_link_bear_the_cores_time() -> None:
    boat = Boat().sail(4.0)
    stamps = [event.stamp_ns for _, event in boat.events if event.name == "autopilot_says"]
    assert stamps
    assert all(abs(ns - boat.controller.stamp_ns) < 5e9 for ns in stamps)


def test_two_boats_with_the_same_past_do_the_same() -> None:
    first, second = (Boat(Steady((40.0, 90.0))).sail(6.0) for _ in range(2))
    assert [e for _, e in first.events] == [e for _, e in second.events]
    assert all((a[1] == b[1]).all() for a, b in zip(first.thrusts, second.thrusts, strict=True))


def test_the_boat_says_what_it_does_and_why_and_that_it_is_held() -> None:
    boat = under_way()
    controller = boat.controller
    assert controller.decision is not None
    said = controller.explain(controller.decision)
    assert said is not None
    assert said.sentence.startswith("Sailing to the goal")
    boat.line = silence("points")
    boat.sail(2.0)
    said = controller.explain(controller.decision)
    assert said is not None
    assert said.sentence.startswith("Not driving, propellers at rest")


def test_words_that_cannot_be_made_are_left_out_and_stop_nothing(monkeypatch) -> None:
    def stumble(*_: object, **__: object) -> None:
        raise ZeroDivisionError("in making a sentence")

    boat = under_way()
    controller = boat.controller
    assert controller.decision is not None
    monkeypatch.setattr("twinscrew.runtime.app.controller.explain", stumble)
    assert controller.explain(controller.decision) is None
