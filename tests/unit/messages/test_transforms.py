import math

import numpy as np
import pytest

from twinscrew.runtime.geometry import quaternion_from_euler
from twinscrew.runtime.messages.topics import type_store
from twinscrew.runtime.messages.types import Odometry
from twinscrew.runtime.messages.visual import (
    TRANSFORMS_TYPE,
    Transform,
    encode_transforms,
    vessel_transform,
)


def read(payload):
    store = type_store()
    message = store.deserialize_cdr(payload, TRANSFORMS_TYPE)
    assert bytes(store.serialize_cdr(message, TRANSFORMS_TYPE)) == payload
    return message.transforms


def test_a_vessel_that_heads_north_stands_in_enu_turned_by_90_degrees():
    odometry = Odometry(
        stamp_ns=2_500_000_000,
        position_N=np.array((10.0, 20.0, -1.0)),
        q_NB=quaternion_from_euler(0.0, 0.0, 0.0),
        velocity_B=np.zeros(3),
        rates_B=np.zeros(3),
    )
    vessel = vessel_transform(odometry, child_frame_id="wamv1/base_link")
    (stamped,) = read(encode_transforms([vessel], stamp_ns=odometry.stamp_ns))
    assert (stamped.header.frame_id, stamped.child_frame_id) == ("world", "wamv1/base_link")
    assert (stamped.header.stamp.sec, stamped.header.stamp.nanosec) == (2, 500_000_000)
    place, turn = stamped.transform.translation, stamped.transform.rotation
    assert (place.x, place.y, place.z) == (20.0, 10.0, 1.0)
    assert 2 * math.atan2(turn.z, turn.w) == pytest.approx(math.pi / 2)


def test_several_frames_go_in_one_message():
    lidar = Transform("base_link", "lidar", (0.43, 0.0, 1.93))
    first, second = read(encode_transforms([lidar, lidar], stamp_ns=0))
    assert first.transform.translation.z == second.transform.translation.z == 1.93
    assert first.transform.rotation.w == 1.0


def test_no_frames_are_a_message_too():
    assert read(encode_transforms([], stamp_ns=0)) == []
