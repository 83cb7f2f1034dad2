"""nav_msgs/Path: any number of places, any name of the frame."""

import numpy as np
import pytest

from twinscrew.runtime.errors import MessageError
from twinscrew.runtime.messages import cdr
from twinscrew.runtime.messages.navigation import PATH_TYPE
from twinscrew.runtime.messages.topics import type_store


@pytest.mark.parametrize("frame_id", ["", "w", "world", "a/long/frame", "odom_12"])
@pytest.mark.parametrize("count", [0, 1, 2, 100])
def test_what_goes_out_comes_back_and_is_what_rosbags_reads(count, frame_id):
    p_N = np.arange(2.0 * count).reshape(count, 2)
    payload = cdr.encode_path(p_N, stamp_ns=12_345_678_901, frame_id=frame_id)
    stamp_ns, again_N, frame_ids = cdr.decode_path(payload)
    assert stamp_ns == 12_345_678_901
    np.testing.assert_array_equal(again_N, p_N)
    assert frame_ids == ((frame_id,) if count else ())
    message = type_store().deserialize_cdr(payload, PATH_TYPE)
    found = [(pose.pose.position.y, pose.pose.position.x) for pose in message.poses]
    assert found == [tuple(place) for place in p_N.tolist()]
    assert {pose.header.frame_id for pose in message.poses} <= {frame_id}
    assert bytes(type_store().serialize_cdr(message, PATH_TYPE)) == payload


@pytest.mark.parametrize("number", [np.nan, np.inf, -1e300])
def test_a_place_that_cannot_be_is_refused(number):
    payload = cdr.encode_path(np.array([[0.0, 1.0], [number, 0.0]]), stamp_ns=0)
    with pytest.raises(MessageError, match=r"not finite|cannot be"):
        cdr.decode_path(payload)


def test_more_places_than_can_be_read_in_time_are_refused():
    payload = cdr.encode_path(np.zeros((4097, 2)), stamp_ns=0)
    with pytest.raises(MessageError, match="4097 places are too many: at most 4096"):
        cdr.decode_path(payload)
    assert len(cdr.decode_path(cdr.encode_path(np.zeros((4096, 2)), stamp_ns=0))[1]) == 4096
