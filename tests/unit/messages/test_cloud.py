import struct
import tracemalloc

import numpy as np
import pytest

from twinscrew.runtime.errors import MessageError
from twinscrew.runtime.messages.point_cloud import decode_point_cloud, encode_point_cloud
from twinscrew.runtime.messages.types import PointCloud


def cloud(count=3, **extras):
    points_S = np.arange(3 * count, dtype=np.float32).reshape(count, 3)
    return PointCloud(stamp_ns=5, frame_id="lidar", points_S=points_S, **extras)


def full(count=3):
    return cloud(
        count,
        intensity=np.linspace(0, 1, count, dtype=np.float32),
        ring=np.arange(count, dtype=np.uint16),
        time_offset_s=np.linspace(0, 0.1, count, dtype=np.float32),
    )


@pytest.mark.parametrize(
    "absent",
    [(), ("intensity",), ("ring",), ("time_offset_s",), ("intensity", "ring", "time_offset_s")],
)
def test_what_a_cloud_has_comes_back_and_nothing_else(absent):
    extras = {
        name: getattr(full(), name)
        for name in ("intensity", "ring", "time_offset_s")
        if name not in absent
    }
    read = decode_point_cloud(encode_point_cloud(cloud(**extras)))
    np.testing.assert_array_equal(read.points_S, full().points_S)
    for name in ("intensity", "ring", "time_offset_s"):
        if name in absent:
            assert getattr(read, name) is None
        else:
            np.testing.assert_array_equal(getattr(read, name), extras[name])


def test_points_are_contiguous_float32():
    points_S = decode_point_cloud(encode_point_cloud(full())).points_S
    assert points_S.flags.c_contiguous
    assert points_S.dtype == np.float32


def test_an_empty_cloud_is_normal_at_sea():
    read = decode_point_cloud(encode_point_cloud(full(0)))
    assert read.points_S.shape == (0, 3)
    assert read.stamp_ns == 5


def test_a_cloud_of_a_million_points_is_read():
    points_S = np.ones((1_000_000, 3), np.float32)
    payload = encode_point_cloud(PointCloud(stamp_ns=0, frame_id="", points_S=points_S))
    assert decode_point_cloud(payload).points_S.shape == (1_000_000, 3)


def test_arrays_of_different_lengths_are_not_written():
    with pytest.raises(MessageError, match="its arrays differ in length"):
        encode_point_cloud(cloud(3, ring=np.zeros(2, np.uint16)))


@pytest.mark.parametrize("size", [0, 4, 20, 30, 90, 150])
def test_a_truncated_cloud_is_refused(size):
    with pytest.raises(MessageError, match="PointCloud2"):
        decode_point_cloud(encode_point_cloud(full())[:size])


@pytest.mark.parametrize("what", ["height", "width", "fields", "point_step", "row_step", "data"])
def test_an_absurd_size_is_refused_without_a_large_allocation(what):
    payload = bytearray(encode_point_cloud(cloud()))
    height = 4 + 8 + 4 + 6 + 2
    steps = payload.index(struct.pack("<2I", 12, 36))
    place = {
        "height": height,
        "width": height + 4,
        "fields": height + 8,
        "point_step": steps,
        "row_step": steps + 4,
        "data": steps + 8,
    }[what]
    struct.pack_into("<I", payload, place, 0xFFFFFFF0)
    tracemalloc.start()
    try:
        with pytest.raises(MessageError, match="PointCloud2"):
            decode_point_cloud(bytes(payload))
        assert tracemalloc.get_traced_memory()[1] < 1_000_000
    finally:
        tracemalloc.stop()


def test_a_string_that_is_not_text_is_refused():
    payload = encode_point_cloud(cloud()).replace(b"lidar", b"li\xffar")
    with pytest.raises(MessageError, match="not UTF-8"):
        decode_point_cloud(payload)


def test_a_bool_that_is_neither_is_refused():
    payload = encode_point_cloud(cloud())[:-1] + b"\x02"
    with pytest.raises(MessageError, match="2 is not a bool"):
        decode_point_cloud(payload)


def test_a_cloud_without_a_coordinate_is_refused():
    payload = encode_point_cloud(cloud()).replace(b"z\x00", b"w\x00")
    with pytest.raises(MessageError, match="no field 'z'"):
        decode_point_cloud(payload)
