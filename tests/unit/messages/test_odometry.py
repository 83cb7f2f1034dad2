import math
import struct

import numpy as np
import pytest

from twinscrew.runtime.errors import MessageError
from twinscrew.runtime.messages.navigation import (
    decode_goal,
    decode_odometry,
    encode_goal,
    encode_odometry,
)
from twinscrew.runtime.messages.types import Goal, Odometry

BODY = 85 * 8


def payload(**changes):
    """Give an odometry payload with some of its 85 numbers changed."""
    odometry = Odometry(
        stamp_ns=1_000,
        position_N=np.array((1.0, 2.0, 3.0)),
        q_NB=np.array((1.0, 0.0, 0.0, 0.0)),
        velocity_B=np.zeros(3),
        rates_B=np.zeros(3),
    )
    data = bytearray(encode_odometry(odometry))
    for place, value in changes.items():
        struct.pack_into("<d", data, len(data) - BODY + 8 * int(place.removeprefix("n")), value)
    return bytes(data)


@pytest.mark.parametrize("place", [0, 1, 2, 3, 6, 43, 48])
@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_a_number_that_is_not_finite_is_refused(place, value):
    with pytest.raises(MessageError, match="Odometry: a number is not finite"):
        decode_odometry(payload(**{f"n{place}": value}))


def test_a_covariance_that_is_not_finite_does_not_matter():
    assert decode_odometry(payload(n7=math.nan, n49=math.inf)).stamp_ns == 1_000


def test_a_zero_quaternion_is_refused():
    with pytest.raises(MessageError, match="an attitude of norm 0 is not a unit quaternion"):
        decode_odometry(payload(n3=0.0, n4=0.0, n5=0.0, n6=0.0))


def test_a_quaternion_of_float32_is_normalised():
    rough = [float(np.float32(c)) for c in (0.1, 0.2, 0.3)]
    w = float(np.float32(math.sqrt(1 - sum(c * c for c in rough))))
    odometry = decode_odometry(payload(n3=rough[0], n4=rough[1], n5=rough[2], n6=w))
    assert np.linalg.norm(odometry.q_NB) == pytest.approx(1.0, abs=1e-15)


def test_a_boat_that_points_east_in_enu_has_heading_90_degrees():
    east = decode_odometry(payload(n3=0.0, n4=0.0, n5=0.0, n6=1.0))
    north = decode_odometry(payload(n3=0.0, n4=0.0, n5=math.sqrt(0.5), n6=math.sqrt(0.5)))
    assert east.heading == pytest.approx(math.pi / 2)
    assert north.heading == pytest.approx(0.0, abs=1e-15)


@pytest.mark.parametrize("size", [0, 3, 4, 11, 30, 100, 700])
def test_a_truncated_odometry_is_refused(size):
    with pytest.raises(MessageError, match="Odometry"):
        decode_odometry(payload()[:size])


def test_bytes_after_the_end_are_refused_but_for_padding():
    assert decode_odometry(payload() + bytes(3)).stamp_ns == 1_000
    with pytest.raises(MessageError, match="4 bytes follow the end"):
        decode_odometry(payload() + bytes(4))


def test_a_parameter_list_encoding_is_refused_by_name():
    with pytest.raises(MessageError, match="CDR header 00 03 is neither 00 01 nor 00 00"):
        decode_odometry(b"\x00\x03" + payload()[2:])


def test_the_option_bytes_of_the_header_do_not_matter():
    assert decode_odometry(b"\x00\x01\xff\xfe" + payload()[4:]).stamp_ns == 1_000


def test_a_stamp_with_too_many_nanoseconds_is_refused():
    data = bytearray(payload())
    struct.pack_into("<I", data, 8, 1_000_000_000)
    with pytest.raises(MessageError, match="1000000000 ns within its second"):
        decode_odometry(bytes(data))


@pytest.mark.parametrize("stamp_ns", [-1, 0, 1_700_000_000_123_456_789, 2**31 * 10**9 - 10**9])
def test_a_stamp_comes_back(stamp_ns):
    goal = Goal(stamp_ns=stamp_ns, position_N=np.zeros(2))
    assert decode_goal(encode_goal(goal)).stamp_ns == stamp_ns


def test_a_stamp_beyond_ros_is_not_written():
    with pytest.raises(MessageError, match="is not a stamp that ROS 2 can write"):
        encode_goal(Goal(stamp_ns=2**31 * 10**9, position_N=np.zeros(2)))


def test_a_goal_that_is_nowhere_is_refused():
    goal = encode_goal(Goal(stamp_ns=0, position_N=np.array((math.nan, 1.0))))
    with pytest.raises(MessageError, match="PoseStamped: a number is not finite"):
        decode_goal(goal)


@pytest.mark.parametrize("absurd", [1.1e8, -1e300])
def test_a_place_that_is_nowhere_on_earth_is_refused_with_its_number(absurd):
    goal = Goal(stamp_ns=0, position_N=np.array([0.0, absurd]))
    with pytest.raises(MessageError, match="cannot be: the greatest number allowed is 1e"):
        decode_goal(encode_goal(goal))
