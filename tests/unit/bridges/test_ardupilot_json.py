"""The bytes between ArduPilot's simulator and its physics."""

import json
import re
import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.harness.ardupilot_peer import Sensors, whole_line

from twinscrew.hil_sim.bridges.ardupilot_json import (
    Motion,
    ServoFrame,
    decode_servos,
    encode_motion,
    encode_servos,
)

MOTION = Motion(
    time_s=12.0125,
    rates_B=(0.01, -0.02, 0.3),
    specific_force_B=(0.5, -0.25, -9.8),
    position_N=(123.456789, -98.7654321, -0.21),
    q_NB=(0.6, 0.0, 0.0, 0.8),
    velocity_N=(1.5, 2.5, -0.5),
)


def test_a_frame_of_16_outputs_is_read_byte_by_byte_as_documented() -> None:
    datagram = struct.pack("<HHI16H", 18458, 1200, 77, *range(1000, 1016))
    assert decode_servos(datagram) == ServoFrame(1200, 77, tuple(range(1000, 1016)))


def test_a_frame_of_32_outputs_has_another_magic_number() -> None:
    datagram = struct.pack("<HHI32H", 29569, 400, 1, *range(1000, 1032))
    assert decode_servos(datagram) == ServoFrame(400, 1, tuple(range(1000, 1032)))


@pytest.mark.parametrize("channels", [16, 32])
def test_what_is_written_is_read_back(channels: int) -> None:
    frame = ServoFrame(50, 2**32 - 1, tuple(range(65_535 - channels, 65_535)))
    assert decode_servos(encode_servos(frame)) == frame


def test_no_other_number_of_outputs_can_be_written() -> None:
    with pytest.raises(ValueError, match="16 or 32 outputs, not 8"):
        encode_servos(ServoFrame(50, 0, (1500,) * 8))


@pytest.mark.parametrize(
    "datagram",
    [
        b"",
        b"\x1a",
        struct.pack("<HHI16H", 18457, 1200, 77, *[1500] * 16),
        struct.pack("<HHI15H", 18458, 1200, 77, *[1500] * 15),
        struct.pack("<HHI17H", 18458, 1200, 77, *[1500] * 17),
        struct.pack("<HHI16H", 29569, 1200, 77, *[1500] * 16),
        struct.pack("<HHI32H", 18458, 1200, 77, *[1500] * 32),
        struct.pack(">HHI16H", 18458, 1200, 77, *[1500] * 16),
    ],
)
def test_what_is_no_frame_is_none(datagram: bytes) -> None:
    assert decode_servos(datagram) is None


@given(st.binary(max_size=120))
def test_no_datagram_raises(datagram: bytes) -> None:
    frame = decode_servos(datagram)
    assert frame is None or encode_servos(frame) == datagram


def test_the_answer_is_json_with_the_keys_of_the_protocol() -> None:
    answer = json.loads(encode_motion(MOTION))
    assert set(answer) == {"timestamp", "imu", "position", "quaternion", "velocity"}
    assert answer["timestamp"] == 12.0125
    assert answer["imu"] == {"gyro": [0.01, -0.02, 0.3], "accel_body": [0.5, -0.25, -9.8]}
    assert answer["position"] == [123.456789, -98.7654321, -0.21]
    assert answer["quaternion"] == [0.6, 0, 0, 0.8]
    assert answer["velocity"] == [1.5, 2.5, -0.5]


def test_the_answer_is_one_line_between_newlines_without_a_space() -> None:
    answer = encode_motion(MOTION)
    assert re.fullmatch(rb"\n[^\n]+\n", answer)
    assert b" " not in answer


def test_ardupilots_text_search_finds_every_number() -> None:
    sensors = Sensors(whole_line(encode_motion(MOTION)))
    assert sensors.time_s == MOTION.time_s
    assert sensors.gyro == pytest.approx(MOTION.rates_B)
    assert sensors.accel == pytest.approx(MOTION.specific_force_B)
    assert sensors.position == pytest.approx(MOTION.position_N)
    assert sensors.quaternion == pytest.approx(MOTION.q_NB)
    assert sensors.velocity == pytest.approx(MOTION.velocity_N)


finite = st.floats(-1e6, 1e6)


@given(st.tuples(*[finite] * 3), st.floats(0, 1e6))
def test_numbers_arrive_within_single_precision(position, time_s) -> None:
    motion = Motion(time_s, (0, 0, 0), (0, 0, -9.8), position, (1, 0, 0, 0), (0, 0, 0))
    sensors = Sensors(whole_line(encode_motion(motion)))
    assert sensors.position == pytest.approx(position, rel=1e-6, abs=1e-30)
    assert sensors.time_s == pytest.approx(time_s, abs=1e-9, rel=1e-12)
