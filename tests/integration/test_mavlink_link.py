"""The runtime's link and the simulated autopilot, joined by bytes, in simulated time."""

import random

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.harness.work import examples

from twinscrew.hil_sim.autopilot.endpoint import RoverAutopilot, RoverAutopilotSettings
from twinscrew.hil_sim.autopilot.rover import Mode, RoverSettings
from twinscrew.runtime.geometry import quaternion_from_euler
from twinscrew.runtime.link.ardupilot.link import AutopilotLink, AutopilotSettings
from twinscrew.runtime.link.ardupilot.parameters import SHIPPED, read_parm
from twinscrew.runtime.mavlink import EPOCH_S, Signing
from twinscrew.runtime.messages.types import Odometry

STEP_S = 0.05
KEY = bytes(range(32))
SERVO_OUTPUT_RAW = 36


class Boat:
    """Both ends and what lies between; `line` may lose or change bytes."""

    def __init__(self, *, rover=None, signing=(None, None), line=lambda data, now_s: data, **link):
        pilot = RoverAutopilotSettings(rover=RoverSettings(**(rover or {})))
        link = {"arm": True, "receiver_fitted": False, **link}
        self.link = AutopilotLink(AutopilotSettings(**link), signing=signing[0])
        self.autopilot = RoverAutopilot(pilot, 1, signing=signing[1])
        self.line, self.now_s, self.thrust = line, 0.0, (0.0, 0.0)
        self.to_autopilot = lambda data, now_s: data
        self.story, self.vehicle, self.bytes_sent = [], None, b""

    def sail(self, seconds, thrust=None):
        self.thrust = self.thrust if thrust is None else thrust
        for _ in range(round(seconds / STEP_S)):
            self.now_s = round(self.now_s + STEP_S, 6)
            sent = self.link.tick(self.now_s) + self.link.command(self.thrust, self.now_s)
            self.bytes_sent += sent
            arrived = self.to_autopilot(self.line(sent, self.now_s), self.now_s)
            self.autopilot.receive(arrived, self.now_s)
            answer = self.autopilot.step(self.now_s, self.vehicle)
            self.link.receive(self.line(answer, self.now_s), self.now_s)
            self.story += [(self.now_s, e.name, e.detail) for e in self.link.events(self.now_s)]
        return self

    @property
    def names(self):
        return [name for _, name, _ in self.story if name != "autopilot_says"]

    def detail(self, wanted):
        return next(detail for _, name, detail in self.story if name == wanted)


def cut(begin_s, end_s):
    return lambda data, now_s: b"" if begin_s <= now_s < end_s else data


def lossy(share, seed):
    generator = random.Random(seed)
    return lambda data, now_s: b"" if generator.random() < share else data


def test_a_boat_told_to_arm_is_driven_within_a_second():
    boat = Boat().sail(1.0, (400.0, -100.0))
    assert boat.link.status.engaged
    assert boat.autopilot.thrust_command_N().tolist() == [400.0, -100.0]
    assert boat.link.status.obeying is True
    assert boat.link.status.parameters_wrong == ()


def test_the_conversation_settles_without_a_warning():
    boat = Boat().sail(10.0, (400.0, -100.0))
    assert boat.names == []
    assert boat.link.parameters_checked


@pytest.mark.parametrize("control", ["rc_override", "manual_control"])
@pytest.mark.parametrize("thrust", [(1000.0, 1000.0), (-500.0, -500.0), (3.0, -2.0)])
def test_thrust_arrives_within_a_paddles_resolution(control, thrust):
    boat = Boat(control=control).sail(1.0, thrust)
    assert boat.autopilot.thrust_command_N() == pytest.approx(thrust, abs=1.0)


def test_an_autopilot_that_takes_20_s_to_boot_is_waited_for():
    boat = Boat(rover={"arming_delay_s": 20.0}).sail(19.0)
    assert "arming_refused" in boat.names
    assert boat.detail("arming_refused").startswith("Arm:")
    boat.sail(3.0)
    assert boat.link.status.engaged


def test_a_runtime_that_starts_late_finds_hold_and_asks_for_manual():
    boat = Boat()
    for k in range(100):
        boat.autopilot.step(k * 0.05)
    assert boat.autopilot.rover.mode is Mode.HOLD
    boat.now_s = 5.0
    assert boat.sail(3.0, (400.0, 400.0)).link.status.engaged


def test_a_pilots_hold_wins():
    boat = Boat().sail(2.0, (400.0, 400.0))
    boat.autopilot.rover.set_mode(Mode.HOLD)
    boat.sail(60.0)
    assert boat.names == ["mode_taken"]
    assert boat.autopilot.rover.mode is Mode.HOLD
    assert boat.autopilot.thrust_command_N().tolist() == [0.0, 0.0]
    boat.autopilot.rover.set_mode(Mode.MANUAL)
    boat.sail(2.0)
    assert boat.autopilot.thrust_command_N().tolist() == [400.0, 400.0]


def test_a_pilots_disarming_wins():
    boat = Boat().sail(2.0, (400.0, 400.0))
    boat.autopilot.rover.disarm()
    boat.sail(60.0)
    assert boat.names == ["autopilot_disarmed"]
    assert not boat.autopilot.rover.armed


def test_a_pilot_with_a_receiver_steers_by_his_sticks():
    boat = Boat(rover={"receiver": True}, receiver_fitted=True).sail(2.0, (400.0, 400.0))
    boat.autopilot.rover.radio.sticks[0] = 1600
    boat.autopilot.rover.set_mode(Mode.HOLD)
    boat.sail(2.0)
    values = boat.autopilot.rover.radio.values
    assert (values[0], values[2]) == (1600, 1500)


def test_a_cut_line_stops_the_boat_and_a_mended_one_leaves_hold_to_somebody():
    boat = Boat(line=cut(5.0, 9.0)).sail(5.0, (400.0, 400.0))
    boat.sail(0.5)
    assert boat.autopilot.thrust_command_N().tolist() == [400.0, 400.0]
    boat.sail(0.25)
    assert boat.autopilot.thrust_command_N().tolist() == [0.0, 0.0]
    boat.sail(3.25)
    assert boat.autopilot.rover.mode is Mode.HOLD
    assert "autopilot_silent" in boat.names
    boat.sail(20.0)  # meanwhile a pilot may have chosen any mode, and the failsafe HOLD after it
    assert boat.autopilot.rover.mode is Mode.HOLD
    assert "mode_taken" in boat.names
    boat.autopilot.rover.set_mode(Mode.MANUAL)
    boat.sail(1.0)
    assert boat.autopilot.thrust_command_N().tolist() == [400.0, 400.0]


def test_a_cut_that_ends_before_the_failsafe_acts_leaves_the_boat_ours():
    boat = Boat(line=cut(5.0, 6.5)).sail(9.0, (400.0, 400.0))
    assert boat.autopilot.thrust_command_N().tolist() == [400.0, 400.0]


def test_overrides_that_do_not_arrive_bring_the_failsafes_hold_which_is_left_again():
    boat = Boat()
    boat.to_autopilot = cut(5.0, 9.0)
    boat.sail(9.0, (400.0, 400.0))
    assert boat.autopilot.rover.mode is Mode.HOLD
    assert "failsafe_hold" in boat.names
    boat.sail(6.0)
    assert boat.autopilot.thrust_command_N().tolist() == [400.0, 400.0]
    assert "mode_taken" not in boat.names


@pytest.mark.parametrize("after_s", [0.1, 1.0, 5.0, 20.0])
def test_a_pilots_hold_after_a_failsafe_is_not_taken_for_the_failsafes(after_s):
    boat = Boat()
    boat.to_autopilot = cut(5.0, 9.0)
    boat.sail(8.0, (400.0, 400.0))
    boat.autopilot.rover.set_mode(Mode.MANUAL)  # he leaves the failsafe's HOLD
    boat.sail(1.0 + after_s)
    assert boat.story[-1][2] == "Radio Failsafe Cleared" or after_s > 0.1
    boat.autopilot.rover.set_mode(Mode.HOLD)
    boat.sail(30.0)
    assert boat.autopilot.rover.mode is Mode.HOLD
    assert boat.autopilot.thrust_command_N().tolist() == [0.0, 0.0]


@pytest.mark.parametrize("words", ["Radio Failsafe", "Radio Failsafe Cleared", "Throttle armed"])
@pytest.mark.parametrize("before", [True, False])
def test_no_text_makes_a_pilots_hold_another_ones(words, before):
    boat = Boat().sail(5.0, (400.0, 400.0))
    for first in (before, not before):
        if first:
            boat.autopilot.rover.texts.append(words)
        else:
            boat.autopilot.rover.set_mode(Mode.HOLD)
        boat.sail(0.3)
    boat.sail(20.0)
    assert boat.autopilot.rover.mode is Mode.HOLD
    assert boat.link.status.pilot_has_it


@pytest.mark.parametrize("mode", [Mode.MANUAL, Mode.HOLD])
@pytest.mark.parametrize("off_s", [0.0, 3.0, 30.0])
def test_an_autopilot_that_restarts_after_a_pilot_took_the_mode_is_still_his(mode, off_s):
    boat = Boat().sail(5.0, (400.0, 400.0))
    boat.autopilot.rover.set_mode(Mode.HOLD)
    boat.sail(2.0)
    boat.line = lambda data, now_s: b""
    boat.sail(off_s)
    boat.line = lambda data, now_s: data
    boat.autopilot = RoverAutopilot(RoverAutopilotSettings(), 1, boot_s=boat.now_s)
    boat.autopilot.rover.set_mode(mode)
    for _ in range(2):
        boat.sail(10.0)
        assert boat.autopilot.rover.mode is mode
        assert boat.autopilot.thrust_command_N().tolist() == [0.0, 0.0]
        boat.autopilot.rover.arm(force=True)
    boat.autopilot.rover.set_mode(Mode.HOLD)
    boat.sail(2.0)
    boat.autopilot.rover.set_mode(Mode.MANUAL)
    boat.sail(1.0)
    assert boat.autopilot.thrust_command_N().tolist() == [400.0, 400.0]


@pytest.mark.parametrize("runtime_later_s", [0.0, 1.3, 10.0])
def test_in_whatever_order_the_two_are_switched_on_the_propellers_turn_steadily(runtime_later_s):
    boat = Boat()
    for k in range(round(runtime_later_s / STEP_S)):
        boat.autopilot.step(k * STEP_S)
    boat.now_s = runtime_later_s
    boat.sail(4.0, (400.0, 400.0))
    cuts = 0
    for _ in range(400):
        boat.sail(STEP_S)
        cuts += boat.autopilot.thrust_command_N().tolist() != [400.0, 400.0]
    assert cuts == 0
    assert boat.autopilot.streams.interval_s(SERVO_OUTPUT_RAW) == pytest.approx(0.1)
    assert "autopilot_silent" not in boat.names[1:]


def test_streams_that_somebody_slows_down_are_set_right_again():
    boat = Boat().sail(4.0, (400.0, 400.0))
    for message_id in (SERVO_OUTPUT_RAW, 30, 32):
        boat.autopilot.streams.every(message_id, 1.0)
    boat.sail(2.0)
    assert boat.autopilot.streams.interval_s(SERVO_OUTPUT_RAW) == pytest.approx(0.1)
    assert boat.autopilot.thrust_command_N().tolist() == [400.0, 400.0]


def test_a_rate_that_does_not_come_is_named_and_the_propellers_do_not_pulse():
    boat = Boat()
    boat.autopilot.streams.every = lambda message_id, interval_s: None
    boat.sail(10.0, (400.0, 400.0))
    assert "set SRn_RC_CHAN to 10" in boat.detail("stream_slow")
    for _ in range(200):
        boat.sail(STEP_S)
        assert boat.autopilot.thrust_command_N().tolist() == [400.0, 400.0]


def test_a_cut_line_is_noticed_within_half_a_second():
    boat = Boat(line=cut(5.0, 9.0)).sail(8.0, (400.0, 400.0))
    (silent_s,) = [when for when, name, _ in boat.story if name == "autopilot_silent"]
    assert silent_s - 5.0 <= 0.6


def test_without_permission_the_failsafes_hold_is_for_good():
    boat = Boat(line=cut(5.0, 9.0), ask_manual="at_start").sail(30.0, (400.0, 400.0))
    assert boat.autopilot.rover.mode is Mode.HOLD


@settings(max_examples=examples(10), deadline=None)
@given(st.integers(0, 2**32))
def test_a_line_that_loses_a_third_still_drives(seed):
    boat = Boat(line=lossy(0.33, seed), arm=False).sail(5.0, (400.0, 400.0))
    boat.autopilot.rover.arm(force=True)
    drove = sum(boat.sail(STEP_S).autopilot.thrust_command_N().any() for _ in range(300))
    assert drove > 200  # now and then four heartbeats in a row are lost, and it stops
    assert boat.autopilot.rover.mode is Mode.MANUAL
    assert boat.link.status.obeying is not False


@settings(max_examples=examples(10), deadline=None)
@given(st.integers(0, 2**32))
def test_a_line_that_damages_bytes_never_gives_wild_thrust(seed):
    generator = random.Random(seed)

    def damage(data, now_s):
        changed = bytearray(data)
        for _ in range(len(changed) // 40):
            changed[generator.randrange(len(changed))] = generator.randrange(256)
        return bytes(changed)

    boat = Boat(line=damage).sail(5.0, (400.0, 400.0))
    for _ in range(100):
        boat.sail(STEP_S)
        assert boat.autopilot.thrust_command_N().tolist() in ([400.0, 400.0], [0.0, 0.0])
    assert boat.link.wire.bad_frames > 0


def test_overrides_that_are_ignored_are_noticed_and_the_cause_named():
    wrong = {"receiver": True, "parameters": {"SYSID_MYGCS": 255.0}}
    boat = Boat(rover=wrong, accept_parameters=("SYSID_MYGCS",)).sail(5.0, (400.0, 400.0))
    assert set(boat.names) >= {"override_ignored", "parameters_wrong"}
    assert boat.detail("parameters_wrong") == "SYSID_MYGCS is 255, must be 1"
    assert boat.detail("override_ignored") == "SYSID_MYGCS is 255, must be 1"


def test_a_wrong_steering_type_is_named_as_the_cause_and_is_tried_three_times():
    wrong = {"parameters": {"PILOT_STEER_TYPE": 0.0}}
    boat = Boat(rover=wrong).sail(60.0, (400.0, 100.0))
    said = [detail for _, name, detail in boat.story if name == "override_ignored"]
    assert said[0] == "PILOT_STEER_TYPE is 0, must be 1"
    assert said[-1] == "PILOT_STEER_TYPE is 0, must be 1; not tried again until something changes"
    turned = [boat.sail(STEP_S).autopilot.thrust_command_N().any() for _ in range(1000)]
    assert not any(turned)
    boat.autopilot.rover.parameters.set("PILOT_STEER_TYPE", 1.0)
    boat.sail(4.0)
    assert boat.autopilot.thrust_command_N().tolist() == [400.0, 100.0]


@pytest.mark.parametrize("change", ["mode", "arm", "word"])
def test_an_autopilot_that_was_given_up_is_tried_again_when_something_changes(change):
    boat = Boat(rover={"parameters": {"PILOT_STEER_TYPE": 0.0}}).sail(60.0, (400.0, 100.0))
    assert not boat.link.status.engaged
    rover = boat.autopilot.rover
    if change == "mode":
        rover.set_mode(Mode.HOLD)
        boat.sail(2.0)
        rover.set_mode(Mode.MANUAL)
    elif change == "arm":
        rover.disarm()
        boat.sail(2.0)
        rover.arm(force=True)
    else:
        boat.link.ask_again()
    turned = [boat.sail(STEP_S).autopilot.thrust_command_N().any() for _ in range(60)]
    assert any(turned)


SAFETY_WRONG = {"FS_THR_ENABLE": 0.0, "FS_ACTION": 0.0, "RC_OVERRIDE_TIME": -1.0}


@pytest.mark.parametrize("name", SAFETY_WRONG)
def test_a_wrong_parameter_of_safety_forbids_arming_and_driving_until_it_is_right(name):
    wrong = {"parameters": {name: SAFETY_WRONG[name], "MOT_SLEWRATE": 50.0}}
    boat = Boat(rover=wrong).sail(10.0, (400.0, 400.0))
    assert not boat.autopilot.rover.armed
    words = f"{name} is {SAFETY_WRONG[name]:g}, must be"
    assert words in boat.detail("parameters_unsafe")
    assert "MOT_SLEWRATE" not in boat.detail("parameters_unsafe")
    boat.autopilot.rover.arm(force=True)
    boat.sail(10.0)
    assert boat.autopilot.thrust_command_N().tolist() == [0.0, 0.0]
    boat.autopilot.rover.parameters.set(name, read_parm(SHIPPED)[name])
    boat.sail(4.0)
    assert boat.autopilot.thrust_command_N().tolist() == [400.0, 400.0]


@pytest.mark.parametrize("check", [True, False])
@pytest.mark.parametrize("name", SAFETY_WRONG)
def test_a_wrong_parameter_that_is_expressly_accepted_lets_the_boat_sail(name, check):
    wrong = {"parameters": {name: SAFETY_WRONG[name]}}
    boat = Boat(rover=wrong, accept_parameters=(name,), check_parameters=check)
    boat.sail(3.0, (400.0, 400.0))
    assert boat.autopilot.thrust_command_N().tolist() == [400.0, 400.0]


def test_not_checking_parameters_accepts_none_of_those_on_which_safety_rests():
    wrong = {"parameters": {"FS_THR_ENABLE": 0.0}}
    boat = Boat(rover=wrong, check_parameters=False).sail(10.0, (400.0, 400.0))
    assert not boat.autopilot.rover.armed


def test_parameters_of_safety_that_are_not_read_yet_forbid_driving():
    boat = Boat()
    boat.autopilot.rover.arm(force=True)
    answers = boat.autopilot.rover.parameters.answer
    boat.autopilot.rover.parameters.answer = lambda request: ()
    for _ in range(400):
        boat.sail(STEP_S, (400.0, 400.0))
        assert boat.autopilot.thrust_command_N().tolist() == [0.0, 0.0]
    assert boat.link.status.parameters_unsafe
    boat.autopilot.rover.parameters.answer = answers
    boat.sail(4.0)
    assert boat.autopilot.thrust_command_N().tolist() == [400.0, 400.0]


def test_every_wrong_parameter_is_named_however_many_there_are():
    names = read_parm(SHIPPED).keys() - {"FRAME_CLASS", "SYSID_MYGCS"}
    wrong = {name: read_parm(SHIPPED)[name] + 1.0 for name in names}
    boat = Boat(rover={"parameters": wrong}).sail(10.0)
    said = "; ".join(detail for _, name, detail in boat.story if name == "parameters_wrong")
    assert {words.split()[0] for words in said.split("; ")} == names


def test_every_wrong_parameter_is_named_and_those_that_come_later_too():
    wrong = {"MOT_SLEWRATE": 50.0, "FS_TIMEOUT": 5.0, "RC3_DZ": 30.0, "FS_THR_ENABLE": 0.0}
    boat = Boat(rover={"parameters": wrong}).sail(10.0)
    (said,) = [detail for _, name, detail in boat.story if name == "parameters_wrong"]
    assert all(f"{name} is {value:g}, must be" in said for name, value in wrong.items())
    boat.autopilot.rover.parameters.set("RC3_DZ", 0.0)
    boat.sail(3.0)
    latest = [detail for _, name, detail in boat.story if name == "parameters_wrong"][-1]
    assert "RC3_DZ" not in latest
    assert "MOT_SLEWRATE" in latest


def test_swapped_propellers_are_noticed():
    wrong = {"parameters": {"SERVO1_FUNCTION": 74.0, "SERVO3_FUNCTION": 73.0}}
    assert "override_ignored" in Boat(rover=wrong).sail(5.0, (400.0, -100.0)).names


def test_wrong_parameters_are_written_when_wanted():
    wrong = {"parameters": {"RC1_DZ": 30.0, "FS_THR_ENABLE": 0.0}}
    boat = Boat(rover=wrong, write_parameters=True).sail(10.0)
    assert boat.link.status.parameters_wrong == ()
    assert boat.autopilot.rover.parameters["RC1_DZ"] == 0.0
    assert boat.autopilot.rover.parameters["FS_THR_ENABLE"] == 1.0


def test_a_vehicle_that_is_no_boat_is_not_driven():
    boat = Boat(rover={"parameters": {"FRAME_CLASS": 1.0}}).sail(5.0, (400.0, 400.0))
    assert "wrong_vehicle" in boat.names
    assert not boat.autopilot.rover.armed


class WallClock:
    now_s = EPOCH_S + 3.6e8

    def __call__(self):
        WallClock.now_s += 1e-4
        return WallClock.now_s


def test_signed_both_ways_it_sails():
    ends = (Signing(KEY, wall_clock=WallClock()), Signing(KEY, wall_clock=WallClock()))
    boat = Boat(signing=ends).sail(2.0, (400.0, 400.0))
    assert boat.autopilot.thrust_command_N().tolist() == [400.0, 400.0]
    assert boat.link.wire.bad_frames == 0


@pytest.mark.parametrize("theirs", [None, Signing(bytes(32), wall_clock=WallClock())])
def test_an_autopilot_without_our_key_is_not_heard(theirs):
    ours = Signing(KEY, wall_clock=WallClock())
    boat = Boat(signing=(ours, theirs)).sail(5.0, (400.0, 400.0))
    assert not boat.link.status.connected
    assert boat.link.status.bad_frames > 0
    assert not boat.autopilot.rover.armed


@pytest.mark.parametrize("state_message", ["local_position", "odometry"])
def test_odometry_comes_from_the_autopilot_with_the_callers_time(state_message):
    boat = Boat(state_hz=20.0, state_message=state_message)
    boat.vehicle = Odometry(
        stamp_ns=0,
        position_N=np.array([12.0, -7.0, 0.1]),
        q_NB=quaternion_from_euler(0.1, -0.05, 2.0),
        velocity_B=np.array([1.5, -0.2, 0.05]),
        rates_B=np.array([0.01, 0.02, 0.3]),
    )
    boat.sail(3.0)
    got = boat.link.odometry
    assert got is not None
    assert got.position_N == pytest.approx(boat.vehicle.position_N, abs=1e-5)
    assert got.q_NB == pytest.approx(boat.vehicle.q_NB, abs=1e-6)
    assert got.velocity_B == pytest.approx(boat.vehicle.velocity_B, abs=1e-5)
    assert got.rates_B == pytest.approx(boat.vehicle.rates_B, abs=1e-6)
    assert got.stamp_ns * 1e-9 == pytest.approx(boat.now_s, abs=0.002)


def test_two_runs_send_the_same_bytes():
    first, second = (Boat(line=lossy(0.2, 5)).sail(10.0, (123.0, -45.0)) for _ in range(2))
    assert first.bytes_sent == second.bytes_sent
    assert first.story == second.story


@pytest.mark.parametrize("away_s", [0.3, 1.0, 5.0, 60.0])
def test_a_runtime_that_was_killed_and_started_again_sails_on(away_s):
    boat = Boat().sail(3.0, (400.0, 400.0))
    for _ in range(round(away_s / STEP_S)):
        boat.now_s = round(boat.now_s + STEP_S, 6)
        boat.autopilot.step(boat.now_s)
    boat.link = AutopilotLink(boat.link.settings)
    boat.sail(4.0)
    if away_s > 2.5:  # the failsafe's HOLD, or a pilot's: who was not there cannot tell
        assert boat.link.status.pilot_has_it
        boat.autopilot.rover.set_mode(Mode.MANUAL)
        boat.sail(1.0)
    assert boat.link.status.engaged
    assert boat.autopilot.thrust_command_N().tolist() == [400.0, 400.0]


def test_a_runtime_that_starts_while_a_pilot_holds_an_armed_boat_leaves_it_to_him():
    boat = Boat().sail(3.0, (400.0, 400.0))
    boat.autopilot.rover.set_mode(Mode.HOLD)
    boat.sail(1.0)
    boat.link = AutopilotLink(boat.link.settings)
    boat.sail(30.0)
    assert boat.autopilot.rover.mode is Mode.HOLD
    assert boat.link.status.pilot_has_it


def test_an_autopilot_that_starts_again_is_asked_for_its_streams_but_not_armed():
    boat = Boat().sail(3.0, (400.0, 400.0))
    boat.autopilot = RoverAutopilot(RoverAutopilotSettings(), 1, boot_s=boat.now_s)
    boat.sail(5.0)
    assert "autopilot_disarmed" in boat.names
    assert not boat.autopilot.rover.armed
    assert boat.autopilot.streams.interval_s(SERVO_OUTPUT_RAW) == pytest.approx(0.1)
    boat.link.ask_again()
    boat.sail(2.0)
    assert boat.autopilot.thrust_command_N().tolist() == [400.0, 400.0]


@pytest.mark.parametrize("same", [True, False])
def test_both_ends_may_read_their_key_from_a_file(tmp_path, same):
    ours, theirs = tmp_path / "ours", tmp_path / "theirs"
    for path, key in ((ours, KEY), (theirs, KEY if same else bytes(32))):
        path.write_bytes(key)
        path.chmod(0o600)
    boat = Boat(signing_key_file=str(ours))
    pilot = RoverAutopilotSettings(signing_key_file=str(theirs))
    boat.autopilot = RoverAutopilot(pilot, 1)
    assert boat.sail(2.0).link.status.engaged is same
