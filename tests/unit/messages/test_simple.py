import math
import struct

import pytest

from twinscrew.runtime.errors import MessageError
from twinscrew.runtime.messages.navigation import (
    decode_clock,
    decode_engagement,
    decode_thrust,
    encode_clock,
    encode_engagement,
    encode_thrust,
)
from twinscrew.runtime.messages.types import Engagement


@pytest.mark.parametrize("thrust", [math.nan, math.inf, -math.inf])
def test_a_thrust_that_is_not_finite_is_neither_written_nor_read(thrust):
    with pytest.raises(MessageError, match="cannot be sent"):
        encode_thrust(thrust)
    forged = encode_thrust(1.0)[:4] + struct.pack("<d", thrust)
    with pytest.raises(MessageError, match="Float64: a thrust of"):
        decode_thrust(forged)


@pytest.mark.parametrize("engaged", [True, False])
def test_an_engagement_comes_back(engaged):
    engagement = Engagement(stamp_ns=42, engaged=engaged)
    assert decode_engagement(encode_engagement(engagement)) == engagement


@pytest.mark.parametrize("decode", [decode_clock, decode_engagement, decode_thrust])
def test_an_empty_payload_is_refused(decode):
    with pytest.raises(MessageError, match="0 bytes are too few"):
        decode(b"")


def test_a_clock_is_not_an_engagement():
    with pytest.raises(MessageError, match="Engagement: ends after 12 of at least 13 bytes"):
        decode_engagement(encode_clock(5))
