import pytest

from twinscrew.hil_sim.autopilot.radio import IGNORE
from twinscrew.hil_sim.autopilot.rover import Mode, Rover, RoverSettings
from twinscrew.runtime.errors import ConfigError

SYSTEM = 1


def rover(**settings):
    return Rover(RoverSettings(**settings), SYSTEM)


def sticks(left=1500, right=1500):
    return [left, IGNORE, right] + [IGNORE] * 13


def sail(
    boat, *, until_s, since_s=0.0, left=1500, right=1500, overrides_until_s=None, sender=SYSTEM
):
    """Stream overrides at 20 Hz and step at 50 Hz."""
    for k in range(round(since_s * 100), round(until_s * 100) + 1):
        now_s = k / 100
        streams = overrides_until_s is None or now_s <= overrides_until_s
        if streams and k % 5 == 0:
            boat.override(sticks(left, right), sender, now_s)
        if k % 2 == 0:
            boat.step(now_s)


def underway(**settings):
    boat = rover(**settings)
    sail(boat, until_s=0.2)
    assert boat.arm()
    return boat


@pytest.mark.parametrize("pulse", [1000, 1001, 1250, 1499, 1500, 1501, 1777, 2000])
def test_outputs_follow_overrides_one_to_one(pulse):
    boat = underway()
    sail(boat, since_s=0.2, until_s=0.5, left=pulse, right=3000 - pulse)
    outputs = boat.servo_outputs()
    assert (outputs[0], outputs[2]) == (pulse, 3000 - pulse)
    assert boat.propellers == (pulse, 3000 - pulse)


def test_overrides_of_another_system_are_silently_ignored():
    boat = underway()
    sail(boat, since_s=0.2, until_s=0.5, left=1700, right=1700, sender=255)
    assert boat.propellers == (1500, 1500)
    assert boat.texts == ["Throttle armed"]


def test_disarmed_outputs_are_neutral():
    boat = rover()
    sail(boat, until_s=0.5, left=1700, right=1700)
    assert boat.propellers == (1500, 1500)


def test_arming_is_refused_for_a_while_after_boot():
    boat = rover(arming_delay_s=20.0)
    sail(boat, until_s=19.9)
    assert not boat.arm()
    assert boat.texts[-1].startswith("Arm:")
    sail(boat, since_s=19.9, until_s=20.1)
    assert boat.arm()


def test_arming_without_a_receiver_needs_overrides_that_stream():
    boat = rover()
    boat.step(1.0)
    assert not boat.arm()
    assert boat.texts == ["Arm: Radio failsafe on"]
    assert rover(receiver=True).arm()


def test_arming_with_a_paddle_off_neutral_is_refused_unless_forced():
    boat = rover()
    sail(boat, until_s=0.2, right=1700)
    assert not boat.arm()
    assert boat.arm(force=True)


def test_without_a_receiver_thrust_is_neutral_within_0_66_s_and_hold_comes_at_2_s():
    boat = underway()
    sail(boat, since_s=0.2, until_s=1.0, left=1700, right=1700)
    story = []
    for k in range(100, 400):
        boat.step(k / 100)
        story.append((k / 100 - 1.0, boat.propellers, boat.mode))
    neutral_s = next(t for t, outputs, _ in story if outputs == (1500, 1500))
    hold_s = next(t for t, _, mode in story if mode is Mode.HOLD)
    assert 0.55 <= neutral_s <= 0.66
    assert hold_s == pytest.approx(2.0, abs=0.02)
    assert boat.texts[-1] == "Radio Failsafe"
    assert boat.radio.values[0] == 1700  # RC_CHANNELS shows it on


def test_fs_timeout_moves_hold():
    boat = underway(parameters={"FS_TIMEOUT": 5.0})
    sail(boat, since_s=0.2, until_s=5.0, overrides_until_s=0.2)
    assert boat.mode is Mode.MANUAL
    sail(boat, since_s=5.0, until_s=6.0, overrides_until_s=0.2)
    assert boat.mode is Mode.HOLD


def test_without_the_throttle_failsafe_the_propellers_run_on_for_ever():
    boat = underway(parameters={"FS_THR_ENABLE": 0.0})
    sail(boat, since_s=0.2, until_s=120.0, left=1700, right=1700, overrides_until_s=1.0)
    assert boat.propellers == (1700, 1700)
    assert boat.mode is Mode.MANUAL


def test_with_a_receiver_thrust_is_held_for_3_s_and_then_the_sticks_rule():
    boat = underway(receiver=True)
    boat.radio.sticks[0] = boat.radio.sticks[2] = 1600
    sail(boat, since_s=0.2, until_s=3.9, left=1700, right=1700, overrides_until_s=1.0)
    assert boat.propellers == (1700, 1700)
    sail(boat, since_s=3.9, until_s=4.1, overrides_until_s=1.0)
    assert boat.propellers == (1600, 1600)
    assert boat.mode is Mode.MANUAL


def test_a_channel_given_back_is_the_receivers_at_once():
    boat = underway(receiver=True)
    boat.radio.sticks[0] = 1550
    sail(boat, since_s=0.2, until_s=0.5, left=1700, right=1700)
    boat.override(sticks(0, 0), SYSTEM, 0.5)
    boat.step(0.52)
    assert boat.propellers == (1550, 1500)


def test_hold_latches():
    boat = underway()
    sail(boat, since_s=0.2, until_s=3.0, overrides_until_s=0.5)
    assert boat.mode is Mode.HOLD
    sail(boat, since_s=3.0, until_s=10.0, left=1700, right=1700)
    assert boat.mode is Mode.HOLD
    assert boat.propellers == (1500, 1500)
    assert boat.texts[-1] == "Radio Failsafe Cleared"
    assert boat.set_mode(Mode.MANUAL)
    assert boat.propellers == (1700, 1700)


def test_a_boat_that_boots_alone_is_in_hold_after_2_s():
    boat = rover()
    for k in range(250):
        boat.step(k / 100)
    assert boat.mode is Mode.HOLD


def test_channels_8_and_above_ignore_0():
    boat = underway()
    values = [IGNORE] * 16
    values[9] = 1800
    boat.override(values, SYSTEM, 0.2)
    boat.step(0.2)
    values[9] = 0
    boat.override(values, SYSTEM, 0.21)
    boat.step(0.22)
    assert boat.radio.values[9] == 1800


def test_do_set_servo_is_refused_on_a_propeller_and_works_elsewhere_even_disarmed():
    boat = rover()
    assert not boat.set_servo(1, 1700)
    assert not boat.set_servo(3, 1700)
    assert not boat.set_servo(17, 1700)
    assert boat.set_servo(5, 1700)
    assert boat.servo_outputs()[4] == 1700


def test_a_mode_that_is_not_there_is_refused():
    boat = rover()
    assert not boat.set_mode(99)
    assert boat.mode is Mode.MANUAL


def test_a_dead_zone_swallows_small_paddles():
    boat = underway(parameters={"RC1_DZ": 30.0})
    sail(boat, since_s=0.2, until_s=0.4, left=1525, right=1525)
    assert boat.propellers == (1500, 1525)


def test_with_one_stick_for_steering_the_paddles_are_mixed():
    boat = underway(parameters={"PILOT_STEER_TYPE": 0.0})
    sail(boat, since_s=0.2, until_s=0.4, left=1600, right=1700)
    assert boat.propellers == (1800, 1600)


def test_swapped_outputs_are_swapped():
    boat = underway(parameters={"SERVO1_FUNCTION": 74.0, "SERVO3_FUNCTION": 73.0})
    sail(boat, since_s=0.2, until_s=0.4, left=1600, right=1400)
    assert boat.servo_outputs()[:3] == [1400, 0, 1600]


def test_a_parameter_that_does_not_exist_is_refused_by_name():
    with pytest.raises(ConfigError, match="RC1_DEADZONE"):
        rover(parameters={"RC1_DEADZONE": 0.0})


def test_channels_given_back_are_no_sign_of_a_pilot():
    """Without a receiver, the failsafe's time runs from the last real override."""
    boat = underway()
    sail(boat, since_s=0.2, until_s=1.0, left=1700, right=1700)
    for k in range(100, 180, 2):
        boat.override([0, IGNORE, 0] + [IGNORE] * 13, SYSTEM, k / 100)
        boat.step(k / 100)
    assert boat.propellers == (1500, 1500)


def test_a_simulated_receiver_can_be_switched_on():
    boat = underway()
    boat.parameters.set("SIM_RC_FAIL", 0.0)
    sail(boat, since_s=0.2, until_s=1.0, left=1700, right=1700)
    sail(boat, since_s=1.0, until_s=3.5, overrides_until_s=0.9)
    assert boat.propellers == (1700, 1700)  # held for RC_OVERRIDE_TIME
    sail(boat, since_s=3.5, until_s=4.2, overrides_until_s=0.9)
    assert boat.propellers == (1500, 1500)
    assert boat.mode is Mode.MANUAL


def test_uncalibrated_accelerometers_forbid_arming_until_they_are_calibrated() -> None:
    rover = Rover(RoverSettings(calibrated=False, receiver=True), 1)
    rover.step(30.0)
    assert not rover.arm()
    assert rover.texts[-1] == "Arm: 3D Accel calibration needed"
    assert rover.calibrate()
    assert rover.arm()
    assert not rover.calibrate()


def test_while_it_initialises_it_takes_no_mode_and_does_not_arm() -> None:
    rover = Rover(RoverSettings(initialising_s=2.0, receiver=True), 1)
    rover.step(1.0)
    assert rover.mode is Mode.INITIALISING
    assert not rover.set_mode(Mode.MANUAL)
    assert rover.texts[-1] == "Flight mode change failed"
    assert not rover.arm()
    rover.step(2.0)
    assert rover.mode is Mode.MANUAL
    assert rover.arm()


def test_in_acro_a_boat_with_way_on_is_neutral_and_then_goes_astern_by_its_own_hand() -> None:
    rover = Rover(RoverSettings(receiver=True), 1)
    rover.step(0.0)
    rover.arm()
    rover.surge_mps = 2.0
    rover.set_mode(Mode.ACRO)
    rover.step(1.2)
    assert rover.propellers == (1500, 1500)
    rover.step(1.4)
    assert max(rover.propellers) < 1300
    rover.disarm()
    assert rover.propellers == (1500, 1500)
