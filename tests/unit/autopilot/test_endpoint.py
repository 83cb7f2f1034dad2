import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from twinscrew.hil_sim.autopilot.endpoint import RoverAutopilot, RoverAutopilotSettings
from twinscrew.hil_sim.autopilot.rover import RoverSettings
from twinscrew.hil_sim.autopilot.telemetry import TELLERS, Origin
from twinscrew.runtime.errors import ConfigError
from twinscrew.runtime.geometry import quaternion_from_euler
from twinscrew.runtime.mavlink import Wire
from twinscrew.runtime.messages.types import Odometry

SYSTEM = 3


class Talk:
    """A ground station that talks to one simulated autopilot."""

    def __init__(self, *, system=SYSTEM, origin=None, **rover):
        settings = RoverAutopilotSettings(rover=RoverSettings(**rover))
        self.autopilot = RoverAutopilot(settings, SYSTEM, origin)
        self.wire, self.now_s = Wire(system, 191), 0.0
        self.vehicle = odometry()

    def say(self, message):
        self.autopilot.receive(self.wire.encode(message), self.now_s)

    def hear(self, seconds=0.05):
        heard = []
        for _ in range(round(seconds / 0.05)):
            self.now_s += 0.05
            heard += self.wire.decode(self.autopilot.step(self.now_s, self.vehicle))
        return heard

    def command(self, command, *params):
        padded = [*params, *[0.0] * (7 - len(params))]
        self.say(mavlink.MAVLink_command_long_message(SYSTEM, 1, command, 0, *padded))
        acks = [m for m in self.hear() if m.get_type() == "COMMAND_ACK" and m.command == command]
        return [m.result for m in acks]

    def sticks(self, left, right):
        channels = [left, 65535, right] + [65535] * 15
        self.say(mavlink.MAVLink_rc_channels_override_message(SYSTEM, 1, *channels))


def odometry(north=0.0, east=0.0, yaw=0.0, surge=0.0):
    return Odometry(
        stamp_ns=0,
        position_N=np.array([north, east, 0.2]),
        q_NB=quaternion_from_euler(0.05, -0.02, yaw),
        velocity_B=np.array([surge, 0.0, 0.0]),
        rates_B=np.array([0.01, 0.02, 0.03]),
    )


def only(messages, kind):
    return [m for m in messages if m.get_type() == kind]


def test_it_is_an_ardupilot_surface_boat():
    (beat,) = only(Talk().hear(), "HEARTBEAT")
    assert (beat.type, beat.autopilot) == (11, mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA)
    assert (beat.get_srcSystem(), beat.get_srcComponent()) == (SYSTEM, 1)
    assert (beat.custom_mode, beat.base_mode & 128) == (0, 0)


def test_it_sends_ardurovers_streams_once_a_second_unasked_and_nothing_else():
    talk = Talk(receiver=True)
    talk.vehicle = odometry()
    heard = talk.hear(10.0)
    streamed = {"SYS_STATUS", "SYSTEM_TIME", "ATTITUDE", "LOCAL_POSITION_NED", "RC_CHANNELS"}
    streamed |= {"GLOBAL_POSITION_INT", "SERVO_OUTPUT_RAW", "HEARTBEAT"}
    assert {m.get_type() for m in heard} - {"STATUSTEXT"} == streamed
    assert {name: len(only(heard, name)) for name in streamed} == dict.fromkeys(streamed, 10)


def test_a_message_comes_at_the_rate_it_is_asked_for():
    talk = Talk()
    assert talk.command(511, 30, 1e5) == [0]
    assert len(only(talk.hear(5.0), "ATTITUDE")) == pytest.approx(50, abs=1)
    assert talk.command(511, 30, -1) == [0]
    assert only(talk.hear(5.0), "ATTITUDE") == []


def test_a_message_it_does_not_have_is_denied():
    assert Talk().command(511, 12345, 1e5) == [2]


@pytest.mark.parametrize("message_id", sorted(TELLERS))
def test_every_message_can_be_asked_for_once(message_id):
    talk = Talk(parameters={"SIM_DEPTH": 4.0})
    talk.hear(0.1)
    talk.say(mavlink.MAVLink_command_long_message(SYSTEM, 1, 512, 0, message_id, *[0.0] * 6))
    assert message_id in [m.get_msgId() for m in talk.hear()]


def test_a_command_it_does_not_know_is_unsupported():
    assert Talk().command(31000) == [3]


def test_a_command_for_another_vehicle_is_not_answered():
    talk = Talk()
    talk.say(mavlink.MAVLink_command_long_message(SYSTEM + 1, 1, 400, 0, 1, *[0.0] * 6))
    assert only(talk.hear(), "COMMAND_ACK") == []


def test_modes_change_on_command_and_the_heartbeat_tells_at_once():
    talk = Talk()
    talk.hear()
    talk.say(mavlink.MAVLink_command_long_message(SYSTEM, 1, 176, 0, 1, 4, *[0.0] * 5))
    (beat,) = only(talk.hear(), "HEARTBEAT")
    assert beat.custom_mode == 4
    assert talk.command(176, 1, 99) == [4]


def test_arming_is_refused_with_result_4_and_a_reason_while_it_boots():
    talk = Talk(arming_delay_s=20.0)
    talk.sticks(1500, 1500)
    talk.say(mavlink.MAVLink_command_long_message(SYSTEM, 1, 400, 0, 1, *[0.0] * 6))
    heard = talk.hear()
    assert [m.result for m in only(heard, "COMMAND_ACK")] == [4]
    assert only(heard, "STATUSTEXT")[0].text.startswith("Arm:")


def test_armed_paddles_become_thrust():
    talk = Talk()
    talk.sticks(1500, 1500)
    talk.hear()
    assert talk.command(400, 1) == [0]
    talk.sticks(1750, 1250)
    talk.hear()
    assert talk.autopilot.thrust_command_N().tolist() == [500.0, -250.0]


def test_manual_control_is_two_paddles_too():
    talk = Talk()
    talk.sticks(1500, 1500)
    talk.hear()
    talk.command(400, 1)
    talk.say(mavlink.MAVLink_manual_control_message(SYSTEM, 32767, 500, -500, 32767, 0))
    talk.hear()
    assert talk.autopilot.rover.propellers == (1750, 1250)


def test_an_axis_that_is_not_there_gives_its_channel_back():
    talk = Talk(receiver=True)
    talk.autopilot.rover.radio.sticks[2] = 1555
    talk.sticks(1700, 1700)
    talk.hear()
    talk.say(mavlink.MAVLink_manual_control_message(SYSTEM, 0, 500, 32767, 0, 0))
    talk.hear()
    values = talk.autopilot.rover.radio.values
    assert (values[0], values[2]) == (1750, 1555)


@pytest.mark.parametrize("message", ["override", "manual_control"])
def test_another_systems_sticks_are_silently_ignored(message):
    talk = Talk(system=255)
    if message == "override":
        talk.sticks(1700, 1700)
    else:
        talk.say(mavlink.MAVLink_manual_control_message(SYSTEM, 0, 500, 500, 0, 0))
    assert only(talk.hear(), "STATUSTEXT") == []
    assert talk.autopilot.rover.radio.values[0] == 0


def test_do_set_servo_is_refused_on_the_propellers():
    assert Talk().command(183, 1, 1700) == [4]
    assert Talk().command(183, 5, 1700) == [0]


def test_parameters_can_be_listed_read_and_set():
    talk = Talk()
    talk.say(mavlink.MAVLink_param_request_list_message(SYSTEM, 1))
    listed = only(talk.hear(), "PARAM_VALUE")
    assert len(listed) == listed[0].param_count
    assert [m.param_index for m in listed] == list(range(len(listed)))
    talk.say(mavlink.MAVLink_param_set_message(SYSTEM, 1, b"RC1_DZ", 30.0, 9))
    (answer,) = only(talk.hear(), "PARAM_VALUE")
    assert (answer.param_id, answer.param_value) == ("RC1_DZ", 30.0)
    talk.say(mavlink.MAVLink_param_request_read_message(SYSTEM, 1, b"", answer.param_index))
    (again,) = only(talk.hear(), "PARAM_VALUE")
    assert (again.param_id, again.param_value) == ("RC1_DZ", 30.0)


def test_a_parameter_it_does_not_have_is_not_answered():
    talk = Talk()
    talk.say(mavlink.MAVLink_param_request_read_message(SYSTEM, 1, b"NONSENSE", -1))
    talk.say(mavlink.MAVLink_param_request_read_message(SYSTEM, 1, b"", 9999))
    talk.say(mavlink.MAVLink_param_set_message(SYSTEM, 1, b"RC1_DZ", math.nan, 9))
    answers = only(talk.hear(), "PARAM_VALUE")
    assert [(m.param_id, m.param_value) for m in answers] == [("RC1_DZ", 0.0)]


def test_where_it_is_and_how_it_moves_is_told_in_ned():
    talk = Talk(origin=Origin(latitude_deg=60.0, longitude_deg=10.0, altitude_m=0.0))
    talk.vehicle = odometry(north=100.0, east=50.0, yaw=math.pi / 2, surge=2.0)
    for message_id in (30, 32, 33):
        talk.say(mavlink.MAVLink_command_long_message(SYSTEM, 1, 512, 0, message_id, *[0.0] * 6))
    heard = talk.hear(0.05)
    attitude, *_ = only(heard, "ATTITUDE")
    local, *_ = only(heard, "LOCAL_POSITION_NED")
    earth, *_ = only(heard, "GLOBAL_POSITION_INT")
    assert (attitude.roll, attitude.yaw) == pytest.approx((0.05, math.pi / 2), abs=1e-6)
    assert (local.x, local.y) == (100.0, 50.0)
    assert (local.vx, local.vy) == pytest.approx((0.0, 2.0), abs=0.01)
    # one degree is 111.3 km along a meridian; half of that along the 60th parallel
    assert earth.lat / 1e7 - 60.0 == pytest.approx(100.0 / 111_319.5, rel=1e-3)
    assert earth.lon / 1e7 - 10.0 == pytest.approx(50.0 / 55_659.7, rel=1e-3)
    assert earth.hdg == 9000


def test_time_questions_are_answered():
    talk = Talk()
    talk.hear(1.0)
    talk.say(mavlink.MAVLink_timesync_message(0, 123))
    (answer,) = only(talk.hear(), "TIMESYNC")
    assert (answer.ts1, answer.tc1) == (123, 1_000_000_000)


@given(st.lists(st.binary(max_size=200), max_size=10))
def test_no_bytes_from_the_network_raise(chunks):
    autopilot = RoverAutopilot(RoverAutopilotSettings(), SYSTEM)
    for k, chunk in enumerate(chunks):
        autopilot.receive(chunk, k * 0.05)
        autopilot.step(k * 0.05)


HEARD = (11, 20, 21, 23, 66, 69, 70, 75, 76, 111)


@given(st.lists(st.tuples(st.sampled_from(HEARD), st.binary(max_size=64)), max_size=6))
def test_no_wellformed_message_with_wild_contents_raises(messages):
    autopilot = RoverAutopilot(RoverAutopilotSettings(), SYSTEM)
    for message_id in TELLERS:
        autopilot.streams.every(message_id, 0.05)
    for k, (message_id, payload) in enumerate(messages):
        kind = mavlink.mavlink_map[message_id]
        padded = bytearray(payload[: kind.unpacker.size].ljust(kind.unpacker.size, b"\0"))
        autopilot.receive(addressed(kind, padded), k * 0.05)
        autopilot.step(k * 0.05, odometry())
    assert autopilot.wire.bad_frames == 0


def addressed(kind, payload):
    """Give the frame of a payload, sent to our system by our system's companion."""
    offset = target_offset(kind)
    if offset is not None:
        payload[offset] = SYSTEM
    header = bytes([len(payload), 0, 0, 0, SYSTEM, 191]) + kind.id.to_bytes(3, "little")
    body = header + bytes(payload)
    return b"\xfd" + body + mavlink.x25crc(body + bytes([kind.crc_extra])).crc.to_bytes(2, "little")


def target_offset(kind):
    """Find the byte that holds target_system, by unpacking payloads with a single 1."""
    names = kind.ordered_fieldnames
    for offset in range(kind.unpacker.size):
        probe = bytearray(kind.unpacker.size)
        probe[offset] = 1
        values = kind.unpacker.unpack(bytes(probe))
        for name in ("target_system", "target"):
            if name in names and len(values) == len(names) and values[names.index(name)] == 1:
                return offset
    return None


def test_commands_may_come_as_command_int():
    talk = Talk()
    talk.say(mavlink.MAVLink_command_int_message(SYSTEM, 1, 0, 176, 0, 0, 1, 4, 0, 0, 0, 0, 0))
    assert [m.result for m in only(talk.hear(), "COMMAND_ACK")] == [0]
    assert talk.autopilot.rover.mode == 4


def test_the_old_set_mode_message_works_without_an_answer():
    talk = Talk()
    talk.say(mavlink.MAVLink_set_mode_message(SYSTEM, 1, 4))
    assert only(talk.hear(), "COMMAND_ACK") == []
    assert talk.autopilot.rover.mode == 4


def test_its_heart_beats_at_once_when_its_own_failsafe_changes_the_mode():
    talk = Talk(parameters={"FS_TIMEOUT": 1.2})
    talk.hear(1.6)
    beats = only(talk.hear(0.2), "HEARTBEAT")  # 1.7 s after boot, between two beats
    assert [beat.custom_mode for beat in beats] == [4]


def test_the_old_stream_request_starts_and_stops_everything():
    talk = Talk(receiver=True)
    talk.say(mavlink.MAVLink_request_data_stream_message(SYSTEM, 1, 0, 4, 1))
    heard = talk.hear(5.0)
    assert len(only(heard, "ATTITUDE")) == len(only(heard, "SERVO_OUTPUT_RAW")) == 20
    assert len(only(heard, "HEARTBEAT")) == 5
    talk.say(mavlink.MAVLink_request_data_stream_message(SYSTEM, 1, 0, 4, 0))
    assert {m.get_type() for m in talk.hear(5.0)} == {"HEARTBEAT"}


def test_the_failsafe_shows_in_the_heartbeat():
    talk = Talk()
    beats = only(talk.hear(6.0), "HEARTBEAT")
    assert beats[0].system_status == mavlink.MAV_STATE_ACTIVE
    assert beats[-1].system_status == mavlink.MAV_STATE_CRITICAL
    assert beats[-1].custom_mode == 4


def test_streams_may_be_set_up_by_name():
    settings = RoverAutopilotSettings(streams_hz={"ATTITUDE": 4.0})
    autopilot, wire = RoverAutopilot(settings, SYSTEM), Wire(SYSTEM, 191)
    heard = [m for k in range(100) for m in wire.decode(autopilot.step(k * 0.05, odometry()))]
    assert len(only(heard, "ATTITUDE")) == 20
    with pytest.raises(ConfigError, match="ALTITUDE"):
        RoverAutopilot(RoverAutopilotSettings(streams_hz={"ALTITUDE": 4.0}), SYSTEM)
