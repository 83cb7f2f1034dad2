"""What a message may hold is bounded, and looked at before any work is done for it."""

import numpy as np
import pytest
from tests.harness.work import calls_of

from twinscrew.runtime.errors import MessageError
from twinscrew.runtime.messages import cdr
from twinscrew.runtime.messages.navigation import MOST_PLACES, write_header
from twinscrew.runtime.messages.point_cloud import MOST_FIELDS, MOST_POINTS
from twinscrew.runtime.messages.topics import TOPICS
from twinscrew.runtime.messages.types import Fix, Goal, Imu, Odometry, PointCloud
from twinscrew.runtime.messages.wire import LONGEST_NAME, Writer

FLOAT32 = 7
LONG = "w" * 255
WHY_TOO_LONG = "a name of 256 bytes is too long: at most 255 are allowed"


def cloud_of(names, *, width=0, height=1, point_step=12):
    """Give a cloud with float32 fields of these names, three of which may lie over one another."""
    writer = Writer()
    write_header(writer, 1, "lidar")
    writer.values("2I", 4, height, width)
    writer.values("I", 4, len(names))
    for place, name in enumerate(names):
        writer.string(name)
        writer.values("IB3xI", 4, min(4 * place, point_step - 4), FLOAT32, 1)
    size = width * point_step
    writer.values("?3x3I", 4, False, point_step, size, height * size)
    writer.values("?", 1, False)
    payload = writer.payload()
    return payload[:-1] + bytes(height * size) + payload[-1:]


def pair(**names):
    """Give an odometry whose frames have these names."""
    rest = {"position_N": np.zeros(3), "velocity_B": np.zeros(3), "rates_B": np.zeros(3)}
    q_NB = np.array([1.0, 0.0, 0.0, 0.0])
    return cdr.encode_odometry(Odometry(stamp_ns=1, q_NB=q_NB, **rest), **names)


def poses(frames):
    """Give a route whose places each have a frame of its own."""
    writer = Writer()
    write_header(writer, 1, "world")
    writer.values("I", 4, len(frames))
    for east, frame in enumerate(frames):
        write_header(writer, 1, frame)
        writer.values("7d", 8, float(east), 7.0, 0.0, 0.0, 0.0, 0.0, 1.0)
    return writer.payload()


def test_as_many_fields_as_any_sensor_has_are_read_and_more_are_refused_unread():
    names = [*"xyz", *(f"field_{n}" for n in range(MOST_FIELDS - 3))]
    assert cdr.decode_point_cloud(cloud_of(names)).points_S.shape == (0, 3)
    most = calls_of(lambda: cdr.decode_point_cloud(cloud_of(names)))
    payload = cloud_of([*names, *["more"] * 100_000])

    def refused():
        with pytest.raises(MessageError, match=r"100064 fields are too many: at most 64"):
            cdr.decode_point_cloud(payload)

    assert calls_of(refused) < most


def test_more_points_than_any_sensor_has_are_refused_though_they_lie_over_one_another():
    with pytest.raises(MessageError, match=f"points are too many: at most {MOST_POINTS}"):
        cdr.decode_point_cloud(cloud_of("xyz", width=MOST_POINTS + 1, point_step=4))


def test_the_error_of_a_missing_field_is_short_whatever_the_fields_are_called():
    payload = cloud_of([f"{n:02}{LONG[:250]}" for n in range(MOST_FIELDS)])
    with pytest.raises(MessageError, match=r"no field 'x', only '00www.*' and 52 more") as refusal:
        cdr.decode_point_cloud(payload)
    assert len(str(refusal.value)) < 500


@pytest.mark.parametrize(
    ("decode", "payload"),
    [
        (cdr.decode_point_cloud, lambda name: cloud_of(["x", "y", "z", name])),
        (
            cdr.decode_point_cloud,
            lambda name: cdr.encode_point_cloud(
                PointCloud(stamp_ns=1, frame_id=name, points_S=np.zeros((0, 3), np.float32))
            ),
        ),
        (cdr.decode_odometry, lambda name: pair(frame_id=name)),
        (cdr.decode_odometry, lambda name: pair(child_frame_id=name)),
        (
            cdr.decode_goal,
            lambda name: cdr.encode_goal(
                Goal(stamp_ns=1, position_N=np.array([0.0, 0.0])), frame_id=name
            ),
        ),
        (
            cdr.decode_path,
            lambda name: cdr.encode_path(np.zeros((9, 2)), stamp_ns=1, frame_id=name),
        ),
        (cdr.decode_path, lambda name: poses(["a", name, "b"])),
        (
            cdr.decode_imu,
            lambda name: cdr.encode_imu(
                Imu(
                    stamp_ns=1,
                    rates_I=np.zeros(3),
                    force_I=np.zeros(3),
                    q_NI=None,
                    attitude_variance=None,
                    rates_variance=None,
                    force_variance=None,
                ),
                frame_id=name,
            ),
        ),
        (
            cdr.decode_fix,
            lambda name: cdr.encode_fix(
                Fix(
                    stamp_ns=1,
                    valid=True,
                    latitude_deg=0.0,
                    longitude_deg=0.0,
                    altitude_m=0.0,
                    covariance_N=None,
                ),
                frame_id=name,
            ),
        ),
    ],
)
def test_a_name_is_as_long_as_dds_allows_and_no_longer(decode, payload):
    assert len(LONG) == LONGEST_NAME
    decode(payload(LONG))
    for longer in (LONG + "w", "w" * 1_000_000):
        with pytest.raises(MessageError, match=f"a name of {len(longer)} bytes is too long"):
            decode(payload(longer))


@pytest.mark.parametrize("frames", [["odom"] * 50, ["odom"] * 49 + ["map"], [""] * 50, list("ab")])
@pytest.mark.parametrize("order", ["<", ">"])
def test_a_route_is_the_same_whether_its_places_are_read_at_once_or_one_by_one(frames, order):
    payload = poses(frames)
    if order == ">":
        from twinscrew.runtime.messages.navigation import PATH_TYPE
        from twinscrew.runtime.messages.topics import type_store

        message = type_store().deserialize_cdr(payload, PATH_TYPE)
        payload = bytes(type_store().serialize_cdr(message, PATH_TYPE, little_endian=False))
    stamp_ns, places_N, _ = cdr.decode_path(payload)
    assert stamp_ns == 1
    np.testing.assert_array_equal(places_N, [(7.0, float(east)) for east in range(len(frames))])


def test_the_longest_route_in_one_frame_takes_no_more_calls_than_a_short_one():
    routes = [cdr.encode_path(np.ones((count, 2)), stamp_ns=1) for count in (10, MOST_PLACES)]
    cdr.decode_path(routes[0])  # layouts are kept after their first use
    short, long = (calls_of(lambda route=route: cdr.decode_path(route)) for route in routes)
    assert long == short


@pytest.mark.parametrize(
    ("at", "word", "why"),
    [(-68, 10**9, "a stamp has 1000000000 ns"), (-64, 2**31, "too long"), (-60, 255, "not UTF-8")],
)
def test_what_is_wrong_with_one_place_of_a_thousand_is_named(at, word, why):
    payload = bytearray(cdr.encode_path(np.ones((1000, 2)), stamp_ns=1, frame_id="odo"))
    payload[at : at + 4] = word.to_bytes(4, "little")
    with pytest.raises(MessageError, match=why):
        cdr.decode_path(bytes(payload))


def test_what_fits_a_messages_own_limits_fits_its_topics():
    assert len(pair(frame_id=LONG, child_frame_id=LONG)) < TOPICS["odometry"].largest_b / 10
    route = cdr.encode_path(np.ones((MOST_PLACES, 2)), stamp_ns=1, frame_id=LONG)
    assert len(route) < TOPICS["route"].largest_b
