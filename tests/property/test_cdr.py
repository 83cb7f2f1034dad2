"""Whatever comes in, it is a message or a `MessageError`; whatever goes out comes back."""

import struct
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from tests.harness.work import examples

from twinscrew.runtime.errors import MessageError
from twinscrew.runtime.messages import cdr
from twinscrew.runtime.messages.types import (
    Goal,
    HealthEvent,
    Odometry,
    PointCloud,
    Severity,
    Station,
)

GOLDEN = Path(__file__).parents[1] / "data" / "cdr"
DECODERS = {
    "odometry": cdr.decode_odometry,
    "goal": cdr.decode_goal,
    "fix": cdr.decode_fix,
    "imu": cdr.decode_imu,
    "path": cdr.decode_path,
    "point_cloud": cdr.decode_point_cloud,
    "thrust": cdr.decode_thrust,
    "clock": cdr.decode_clock,
    "engagement": cdr.decode_engagement,
    "diagnostics": cdr.decode_diagnostics,
    "decision": cdr.decode_decision,
}
EVERY_TYPE = pytest.mark.parametrize("name", DECODERS)
STAMPS = st.integers(-(2**31) * 10**9 + 10**9, (2**31 - 1) * 10**9)
METRES = st.floats(-1e6, 1e6)
TEXTS = st.text(st.characters(exclude_categories=["Cs"]), max_size=20)


def decode(name, payload):
    """Decode; a refusal is as good as a message, anything else is a failure of the test."""
    try:
        DECODERS[name](payload)
    except MessageError as error:
        assert str(error)  # noqa: PT017


@EVERY_TYPE
@given(noise=st.binary(max_size=400), big=st.booleans())
def test_noise_is_never_more_than_refused(name, noise, big):
    decode(name, (b"\x00\x00\x00\x00" if big else b"\x00\x01\x00\x00") + noise)
    decode(name, noise)


@EVERY_TYPE
@given(data=st.data())
def test_a_message_cut_anywhere_is_refused(name, data):
    payload = (GOLDEN / f"{name}.cdr").read_bytes()
    size = data.draw(st.integers(0, len(payload) - 1))
    with pytest.raises(MessageError):
        DECODERS[name](payload[:size])


@EVERY_TYPE
@given(data=st.data())
def test_a_message_with_a_word_overwritten_is_never_more_than_refused(name, data):
    payload = bytearray((GOLDEN / f"{name}.cdr").read_bytes())
    place = data.draw(st.integers(0, len(payload) - 4))
    word = data.draw(st.one_of(st.integers(0, 2**32 - 1), st.sampled_from([0, 2**31, 2**32 - 1])))
    struct.pack_into("<I", payload, place, word)
    decode(name, bytes(payload))


UNIT = st.tuples(*[st.floats(-1, 1)] * 4).filter(lambda q: np.linalg.norm(q) > 0.1)


@given(stamp_ns=STAMPS, position=st.tuples(*[METRES] * 3), q=UNIT, twist=st.tuples(*[METRES] * 6))
def test_odometry_comes_back(stamp_ns, position, q, twist):
    q_NB = np.array(q) / np.linalg.norm(q)
    made = Odometry(
        stamp_ns=stamp_ns,
        position_N=np.array(position),
        q_NB=q_NB,
        velocity_B=np.array(twist[:3]),
        rates_B=np.array(twist[3:]),
    )
    read = cdr.decode_odometry(cdr.encode_odometry(made))
    assert read.stamp_ns == stamp_ns
    np.testing.assert_array_equal(read.position_N, made.position_N)
    np.testing.assert_array_equal(read.velocity_B, made.velocity_B)
    np.testing.assert_array_equal(read.rates_B, made.rates_B)
    assert abs(np.dot(read.q_NB, q_NB)) == pytest.approx(1.0, abs=1e-12)


@given(STAMPS, METRES, METRES, st.none() | st.floats(-3.14, 3.14))
def test_places_to_hold_come_back(stamp_ns, north, east, heading):
    made = Station(stamp_ns=stamp_ns, position_N=np.array((north, east)), heading=heading)
    read = cdr.decode_station(cdr.encode_station(made))
    assert read.stamp_ns == stamp_ns
    assert read.position_N.tolist() == [north, east]
    assert read.heading == (None if heading is None else pytest.approx(heading, abs=1e-9))


@given(stamp_ns=STAMPS, north=METRES, east=METRES)
def test_goals_come_back(stamp_ns, north, east):
    made = Goal(stamp_ns=stamp_ns, position_N=np.array((north, east)))
    read = cdr.decode_goal(cdr.encode_goal(made))
    assert (read.stamp_ns, *read.position_N) == (stamp_ns, north, east)


@settings(max_examples=examples(50))
@given(
    points_S=hnp.arrays(
        np.float32, st.tuples(st.integers(0, 50), st.just(3)), elements=st.floats(width=32)
    ),
    frame_id=TEXTS.filter(bool),
)
def test_clouds_come_back_with_their_nan_and_infinities(points_S, frame_id):
    made = PointCloud(stamp_ns=7, frame_id=frame_id, points_S=points_S)
    read = cdr.decode_point_cloud(cdr.encode_point_cloud(made))
    assert read.frame_id == frame_id
    np.testing.assert_array_equal(read.points_S, points_S)


@given(
    events=st.lists(
        st.builds(
            HealthEvent,
            stamp_ns=st.just(5),
            name=TEXTS,
            severity=st.sampled_from(Severity),
            detail=TEXTS,
        ),
        max_size=5,
    )
)
def test_events_come_back_in_any_language(events):
    payload = cdr.encode_diagnostics(tuple(events), stamp_ns=5)
    assert cdr.decode_diagnostics(payload) == tuple(events)
