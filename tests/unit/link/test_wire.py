import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from tests.harness.work import calls_of

from twinscrew.runtime.link.ardupilot.commands import heartbeat
from twinscrew.runtime.mavlink import MOST_FALSE_STARTS, MOST_MESSAGES, Signing, Wire


def attitude(roll=0.1):
    return mavlink.MAVLink_attitude_message(1000, roll, 0.2, 0.3, 0.0, 0.0, 0.0)


def test_what_one_end_says_the_other_hears():
    (heard,) = Wire(2, 191).decode(Wire(1, 1).encode(attitude()))
    assert heard.get_type() == "ATTITUDE"
    assert (heard.get_srcSystem(), heard.get_srcComponent()) == (1, 1)


def test_frames_are_numbered():
    wire, ear = Wire(1, 1), Wire(2, 1)
    frames = b"".join(wire.encode(heartbeat()) for _ in range(257))
    assert [m.get_seq() for m in ear.decode(frames)] == [*range(256), 0]


def test_a_frame_may_come_byte_by_byte():
    ear = Wire(2, 1)
    heard = [m for byte in Wire(1, 1).encode(attitude()) for m in ear.decode(bytes([byte]))]
    assert len(heard) == 1


def test_turned_bits_in_a_length_do_not_hold_up_the_frames_behind_it():
    wire, ear = Wire(1, 1), Wire(2, 1)
    damaged = bytearray(wire.encode(attitude(0.5)))
    damaged[1] = 255  # it now claims more bytes than the next five frames have
    rolls = [0.125 * n for n in range(5)]
    assert ear.decode(bytes(damaged)) == []
    for roll in rolls:
        assert [m.roll for m in ear.decode(wire.encode(attitude(roll)))] == [roll]


def test_a_long_frame_in_pieces_may_hold_what_looks_like_a_start():
    text = mavlink.MAVLink_statustext_message(6, b"\xfd\x05\x00 wait\xfd\x00\x00", 0, 0)
    wire, ear = Wire(1, 1), Wire(2, 1)
    pieces = [bytes([byte]) for byte in wire.encode(text) + wire.encode(attitude())]
    heard = [m.get_type() for piece in pieces for m in ear.decode(piece)]
    assert heard == ["STATUSTEXT", "ATTITUDE"]


def test_a_false_start_does_not_swallow_the_frames_behind_it():
    wire, ear = Wire(1, 1), Wire(2, 1)
    rolls = [0.125 * n for n in range(6)]
    frames = [wire.encode(attitude(roll)) for roll in rolls]
    false_start = b"\xfd\x40\x00junk"  # claims 64 bytes of payload: two frames fit into it
    heard = ear.decode(frames[0] + false_start + b"".join(frames[1:]))
    assert [m.roll for m in heard] == rolls


def test_a_damaged_frame_is_counted_and_the_next_one_heard():
    wire, ear = Wire(1, 1), Wire(2, 1)
    damaged = bytearray(wire.encode(attitude()))
    damaged[15] ^= 0xFF
    heard = ear.decode(bytes(damaged) + wire.encode(heartbeat()))
    assert [m.get_type() for m in heard] == ["HEARTBEAT"]
    assert ear.bad_frames >= 1


def test_a_message_that_the_dialect_does_not_know_is_left_out():
    unknown = struct.pack("<BBBBBBBHB", 253, 1, 0, 0, 0, 1, 1, 0xFFEE, 0xEF) + b"\x00\x12\x34"
    heard = Wire(2, 1).decode(unknown + Wire(1, 1).encode(heartbeat()))
    assert [m.get_type() for m in heard] == ["HEARTBEAT"]


FALSE_STARTS = {
    "starts and nothing else": b"\xfd",
    "empty ones": b"\xfd\x00\x00",
    "the longest": b"\xfd\xff\x00",
    "signed ones": b"\xfd\x00\x01",
    "heartbeats one within another": b"\xfd\xff\x00\x00\x00",
    "heartbeats one after another": b"\xfd\x09\x00\x00\x00\x01\x01\x00\x00\x00" + bytes(11),
}


@pytest.mark.parametrize("signing", [None, Signing(bytes(32))], ids=["unsigned", "signed"])
@pytest.mark.parametrize("false_start", FALSE_STARTS.values(), ids=FALSE_STARTS)
def test_the_work_for_a_datagram_of_false_beginnings_is_bounded(false_start, signing):
    datagram = (false_start * 65_536)[:65_507]  # the largest that UDP carries
    ear, wire = Wire(2, 1, signing), Wire(1, 1, signing)
    assert calls_of(lambda: ear.decode(datagram)) < 40 * MOST_FALSE_STARTS
    assert calls_of(lambda: ear.decode(64 * datagram)) < 40 * MOST_FALSE_STARTS
    assert ear.bad_frames
    ear.decode(bytes(300))
    assert [m.get_type() for m in ear.decode(wire.encode(heartbeat()))] == ["HEARTBEAT"]


def test_the_messages_of_one_call_are_bounded_and_the_next_call_hears_again():
    wire, ear = Wire(1, 1), Wire(2, 1)
    flood = b"".join(wire.encode(heartbeat()) for _ in range(2 * MOST_MESSAGES))
    assert len(ear.decode(flood)) == MOST_MESSAGES
    assert ear.bad_frames == 1
    assert [m.roll for m in ear.decode(wire.encode(attitude(0.5)))] == [0.5]


@given(st.lists(st.binary(max_size=300), max_size=8))
def test_no_bytes_whatever_raise_or_pile_up(chunks):
    ear = Wire(2, 1)
    for chunk in chunks:
        ear.decode(chunk)
    assert len(ear._buffer) < 300


@given(st.binary(max_size=600))
def test_after_any_noise_the_line_recovers(noise):
    wire, ear = Wire(1, 1), Wire(2, 1)
    ear.decode(noise)
    heard = [m for _ in range(20) for m in ear.decode(wire.encode(attitude(0.5)))]
    assert any(m.get_type() == "ATTITUDE" and m.roll == 0.5 for m in heard)


@given(st.integers(0, 39), st.integers(1, 255))
def test_one_changed_byte_never_passes_as_a_message(position, change):
    frame = bytearray(Wire(1, 1).encode(attitude()))
    frame[position % len(frame)] ^= change
    assert Wire(2, 1).decode(bytes(frame)) == []
