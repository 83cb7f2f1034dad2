import math

import numpy as np
import pytest

from twinscrew.runtime.messages.topics import type_store
from twinscrew.runtime.messages.types import Objects, Tracks
from twinscrew.runtime.messages.visual import (
    MARKERS_TYPE,
    Shape,
    encode_object_markers,
    encode_shapes,
    encode_track_markers,
)

ADD, DELETE_ALL = 0, 3
ARROW, CYLINDER, LINE_STRIP = 0, 3, 4


def read(payload):
    return type_store().deserialize_cdr(payload, MARKERS_TYPE).markers


def tracks(v_N):
    return Tracks(
        stamp_ns=1_500_000_000,
        id=np.array([2**31 + 5]),
        p_N=np.array([[10.0, 20.0]]),
        v_N=np.array([v_N]),
        radius=np.array([1.5]),
        covariance=np.zeros((1, 4, 4)),
        age_s=np.zeros(1),
    )


def test_what_was_drawn_before_is_deleted_first():
    nothing = Objects(
        stamp_ns=0, p_L=np.zeros((0, 2)), radius=np.zeros(0), points=np.zeros(0, np.int64)
    )
    (marker,) = read(encode_object_markers(nothing))
    assert marker.action == DELETE_ALL


def test_an_object_to_starboard_is_drawn_at_negative_y_as_large_as_it_is():
    objects = Objects(
        stamp_ns=0, p_L=np.array([[4.0, 1.0]]), radius=np.array([1.5]), points=np.array([9])
    )
    _, marker = read(encode_object_markers(objects))
    assert (marker.action, marker.type) == (ADD, CYLINDER)
    assert marker.header.frame_id == "base_link"
    assert (marker.pose.position.x, marker.pose.position.y) == (4.0, -1.0)
    assert (marker.scale.x, marker.scale.y) == (3.0, 3.0)


@pytest.mark.parametrize(
    ("v_N", "yaw"), [((2.0, 0.0), math.pi / 2), ((0.0, 3.0), 0.0), ((-1.0, 0.0), -math.pi / 2)]
)
def test_a_track_is_drawn_in_enu_with_an_arrow_along_its_course(v_N, yaw):
    _, body, arrow = read(encode_track_markers(tracks(v_N)))
    assert (body.type, arrow.type) == (CYLINDER, ARROW)
    assert (body.pose.position.x, body.pose.position.y) == (20.0, 10.0)
    assert arrow.scale.x == pytest.approx(math.hypot(*v_N))
    turned = 2 * math.atan2(arrow.pose.orientation.z, arrow.pose.orientation.w)
    assert turned == pytest.approx(yaw)


def test_a_track_number_beyond_32_bits_is_folded_and_never_refused():
    _, body, _ = read(encode_track_markers(tracks((1.0, 0.0))))
    assert body.id == 5


def test_shapes_are_cylinders_and_closed_lines_in_enu_as_rosbags_reads_them():
    area_N = np.array([[0.0, 1.0], [2.0, 1.0], [2.0, 5.0]])
    shapes = [
        Shape("goals", 3, (0.5, 0.25, 0.0, 1.0), np.array([[40.0, 30.0]]), 1.5),
        Shape("zones", 2**31 - 1, (1.0, 0.0, 0.0, 0.5), area_N),
    ]
    payload = encode_shapes(shapes, stamp_ns=1_500_000_000, frame_id="map")
    first, goal, zone = read(payload)
    assert first.action == DELETE_ALL
    assert (goal.type, goal.ns, goal.id, goal.header.frame_id) == (CYLINDER, "goals", 3, "map")
    assert (goal.pose.position.x, goal.pose.position.y) == (30.0, 40.0)
    assert (goal.scale.x, goal.color.r, goal.color.a, len(goal.points)) == (3.0, 0.5, 1.0, 0)
    assert (zone.type, zone.pose.orientation.w) == (LINE_STRIP, 1.0)
    assert [(p.x, p.y) for p in zone.points] == [(1, 0), (1, 2), (5, 2), (1, 0)]
    again = type_store().deserialize_cdr(payload, MARKERS_TYPE)
    assert bytes(type_store().serialize_cdr(again, MARKERS_TYPE)) == payload
