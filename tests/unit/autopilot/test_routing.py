"""What the simulated autopilot hands on between its ports, by ArduPilot's rules."""

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from twinscrew.hil_sim.autopilot.endpoint import RoverAutopilot, RoverAutopilotSettings
from twinscrew.hil_sim.autopilot.rover import Mode
from twinscrew.runtime.mavlink import Wire

AUTOPILOT, COMPANION, STATION = (1, 1), (1, 191), (255, 190)
SET_POSITION_MASK = 0b110111111000


class Two:
    """An autopilot with a companion on port 0 and a ground station on port 1."""

    def __init__(self):
        self.autopilot = RoverAutopilot(RoverAutopilotSettings(), 1, ports=2)
        self.wires = (Wire(*COMPANION), Wire(*STATION))
        self.now_s = 0.0

    def say(self, port, message):
        self.autopilot.receive(self.wires[port].encode(message), self.now_s, port)

    def hear(self):
        """Let time pass; gives what each port is told."""
        self.now_s += 0.05
        first = self.autopilot.step(self.now_s)
        return self.wires[0].decode(first), self.wires[1].decode(self.autopilot.outgoing(1))

    def greet(self):
        """Let both be known, and their greetings be over."""
        for port in (0, 1):
            self.say(port, mavlink.MAVLink_heartbeat_message(18, 8, 0, 0, 4, 3))
        return self.hear()


@pytest.fixture
def two():
    two = Two()
    two.greet()
    return two


def of(messages, kind, sender=None):
    return [
        m
        for m in messages
        if m.get_type() == kind and sender in (None, (m.get_srcSystem(), m.get_srcComponent()))
    ]


def target(*to):
    return mavlink.MAVLink_set_position_target_local_ned_message(
        0, *to, 1, SET_POSITION_MASK, 1, 2, 0, 0, 0, 0, 0, 0, 0, 0, 0
    )


def test_heartbeats_go_to_the_other_port_and_not_back():
    companion, station = Two().greet()
    assert of(station, "HEARTBEAT", COMPANION)
    assert of(companion, "HEARTBEAT", STATION)
    assert not of(companion, "HEARTBEAT", COMPANION)
    assert of(companion, "HEARTBEAT", AUTOPILOT)
    assert of(station, "HEARTBEAT", AUTOPILOT)


def test_what_is_for_the_companion_goes_to_it_as_it_was(two):
    two.say(1, target(*COMPANION))
    companion, station = two.hear()
    (message,) = of(companion, "SET_POSITION_TARGET_LOCAL_NED", STATION)
    assert (message.x, message.y) == (1.0, 2.0)
    assert not of(station, "SET_POSITION_TARGET_LOCAL_NED")


def test_its_answer_goes_back_to_the_station(two):
    two.say(0, mavlink.MAVLink_mission_ack_message(*STATION, 0))
    companion, station = two.hear()
    assert of(station, "MISSION_ACK", COMPANION)
    assert not of(companion, "MISSION_ACK")


def test_what_is_for_the_autopilot_is_not_handed_on_but_done(two):
    command = mavlink.MAVLink_command_long_message(1, 1, 176, 0, 1, Mode.HOLD, 0, 0, 0, 0, 0)
    two.say(1, command)
    companion, station = two.hear()
    assert two.autopilot.rover.mode is Mode.HOLD
    assert not of(companion, "COMMAND_LONG")
    assert of(station, "COMMAND_ACK")
    assert not of(companion, "COMMAND_ACK")
    (beat,) = of(companion, "HEARTBEAT", AUTOPILOT)  # everybody is told of a new mode at once
    assert beat.custom_mode == Mode.HOLD


def test_what_is_for_everybody_goes_to_everybody(two):
    two.say(0, mavlink.MAVLink_statustext_message(6, b"hello"))
    _, station = two.hear()
    assert [m.text for m in of(station, "STATUSTEXT", COMPANION)] == ["hello"]


def test_what_is_for_a_component_that_was_never_heard_the_autopilot_takes_itself():
    two = Two()
    two.say(1, mavlink.MAVLink_command_long_message(1, 77, 176, 0, 1, Mode.HOLD, 0, 0, 0, 0, 0))
    two.hear()
    assert two.autopilot.rover.mode is Mode.HOLD


def test_what_is_for_another_vehicle_goes_nowhere_until_that_was_heard(two):
    two.say(1, target(9, 191))
    assert not of(two.hear()[0], "SET_POSITION_TARGET_LOCAL_NED")
    other = Wire(9, 1).encode(mavlink.MAVLink_heartbeat_message(11, 3, 0, 0, 4, 3))
    two.autopilot.receive(other, two.now_s, 0)
    two.say(1, target(9, 191))
    assert of(two.hear()[0], "SET_POSITION_TARGET_LOCAL_NED")


def test_each_port_has_streams_of_its_own(two):
    two.say(1, mavlink.MAVLink_command_long_message(1, 1, 511, 0, 36, 50_000, 0, 0, 0, 0, 0))
    heard = [two.hear() for _ in range(20)]
    assert sum(len(of(station, "SERVO_OUTPUT_RAW")) for _, station in heard) >= 19
    assert sum(len(of(companion, "SERVO_OUTPUT_RAW")) for companion, _ in heard) <= 2


def test_a_changed_parameter_is_told_to_everybody(two):
    two.say(1, mavlink.MAVLink_param_set_message(1, 1, b"MOT_SLEWRATE", 30.0, 9))
    companion, station = two.hear()
    for heard in (companion, station):
        assert [m.param_value for m in of(heard, "PARAM_VALUE")] == [30.0]
