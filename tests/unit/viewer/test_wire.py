"""What goes to the page, read back as the page reads it."""

import json
import struct

import numpy as np
import pytest

from twinscrew.hil_sim.viewer.wire import (
    VesselView,
    decode_request,
    encode_frame,
    encode_part,
)


def read(frame):
    (size,) = struct.unpack_from("<I", frame)
    head, at = json.loads(frame[4 : 4 + size]), 4 + size
    assert at % 4 == 0, "int16 arrays in the browser must be aligned"
    clouds = []
    for vessel in head["vessels"]:
        count = vessel["points"]
        clouds.append(np.frombuffer(frame, "<i2", 2 * count, at).reshape(count, 2))
        at += 4 * count
    assert at == len(frame)
    return head, clouds


@pytest.mark.parametrize("name", ["a", "ab", "abc", "abcd", "bärbel"])
def test_a_frame_holds_the_points_of_each_vessel_behind_an_aligned_head(name):
    first = np.array([[1, -2], [300, 32767]], "<i2")
    second = np.array([[5, 6]], "<i2")
    parts = [
        encode_part(VesselView(name=name, points=2), first.tobytes()),
        encode_part(VesselView(name="silent"), b""),
        encode_part(VesselView(name="other", points=1), second.tobytes()),
    ]
    head, clouds = read(encode_frame(1.25, parts, playing=False))
    assert (head["time_s"], head["playing"]) == (1.25, False)
    assert [vessel["name"] for vessel in head["vessels"]] == [name, "silent", "other"]
    np.testing.assert_array_equal(clouds[0], first)
    assert len(clouds[1]) == 0
    np.testing.assert_array_equal(clouds[2], second)


@pytest.mark.parametrize(
    "text",
    [
        *("", "{", "[]", "null", '{"seek_s": "soon"}', '{"arm": true}', '{"playing": 1}', "NaN"),
        pytest.param('{"x": ' + "[" * 100_000, id="deep"),
    ],
)
def test_what_is_no_request_is_none(text):
    assert decode_request(text) is None


def test_a_request_leaves_what_it_does_not_name():
    request = decode_request('{"seek_s": 3.5}')
    assert (request.seek_s, request.playing, request.speed) == (3.5, None, None)
