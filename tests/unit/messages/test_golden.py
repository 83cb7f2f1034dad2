"""Our bytes against those of another implementation (tests/data/cdr/make_golden.py)."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from twinscrew.runtime.geometry import quaternion_from_euler
from twinscrew.runtime.messages import cdr
from twinscrew.runtime.messages.types import (
    Decision,
    Engagement,
    Fix,
    Goal,
    HealthEvent,
    Imu,
    Objects,
    Observation,
    Odometry,
    PointCloud,
    Severity,
    Tracks,
)

GOLDEN = Path(__file__).parents[2] / "data" / "cdr"
STAMP_NS = 12_345_678_901
BYTE_ORDERS = pytest.mark.parametrize("suffix", [".cdr", ".be.cdr"], ids=["little", "big"])

ODOMETRY = Odometry(
    stamp_ns=STAMP_NS,
    position_N=np.array((20.0, 10.0, -0.5)),
    q_NB=quaternion_from_euler(0.0, 0.0, np.pi / 4),
    velocity_B=np.array((2.0, -0.1, -0.2)),
    rates_B=np.array((0.01, -0.02, -0.3)),
)
CLOUD = PointCloud(
    stamp_ns=STAMP_NS,
    frame_id="lidar",
    points_S=np.array([[1.0, -2.0, -3.0], [-1.0, np.nan, -np.inf]], np.float32),
    intensity=np.array([0.5, 1.0], np.float32),
    ring=np.array([7, 31], np.uint16),
)
EVENTS = (
    HealthEvent(
        stamp_ns=STAMP_NS,
        name="lidar_stale",
        severity=Severity.WARNING,
        detail="0.6 s, limit 0.4 s",
    ),
    HealthEvent(stamp_ns=STAMP_NS, name="ready", severity=Severity.INFO),
)
OBJECTS = Objects(
    stamp_ns=STAMP_NS,
    p_L=np.array([[4.0, 1.0], [5.0, -2.0]]),
    radius=np.array((1.5, 0.75)),
    points=np.array((21, 300)),
)
DECISION = Decision(
    stamp_ns=STAMP_NS,
    sequence=7,
    acted=True,
    thrust_rate=np.array((1000.0, -500.0)),
    thrust=np.array((250.0, 0.1)),
    observation=Observation(
        ego=np.arange(7, dtype=np.float32),
        objects=0.5 * np.arange(25, dtype=np.float32).reshape(5, 5),
        mask=np.array((1, 0, 0, 0, 0), np.float32),
    ),
    objects=OBJECTS,
    tracks=Tracks(
        stamp_ns=STAMP_NS,
        id=np.array([3]),
        p_N=np.array([[1.0, 2.0]]),
        v_N=np.array([[0.1, 0.2]]),
        radius=np.array([1.5]),
        covariance=np.arange(16.0).reshape(1, 4, 4),
        age_s=np.zeros(1),
    ),
    events=(
        HealthEvent(
            stamp_ns=STAMP_NS, name="policy_error", severity=Severity.ERROR, detail="NaN ✗"
        ),
    ),
)


def golden(name: str, suffix: str = ".cdr") -> bytes:
    return (GOLDEN / (name + suffix)).read_bytes()


@pytest.mark.parametrize(
    ("name", "payload"),
    [
        ("goal", cdr.encode_goal(Goal(stamp_ns=STAMP_NS, position_N=np.array((40.0, 30.0))))),
        ("thrust", cdr.encode_thrust(-123.456)),
        ("clock", cdr.encode_clock(STAMP_NS)),
        ("engagement", cdr.encode_engagement(Engagement(stamp_ns=STAMP_NS, engaged=True))),
        ("diagnostics", cdr.encode_diagnostics(EVENTS, stamp_ns=STAMP_NS, hardware_id="wamv1")),
        ("decision", cdr.encode_decision(DECISION)),
    ],
)
def test_what_we_write_is_what_another_implementation_writes(name, payload):
    assert payload == golden(name)


PLACES_N = np.array([[40.0, 30.0], [41.5, 31.0]])
FIX = Fix(
    stamp_ns=STAMP_NS,
    valid=True,
    latitude_deg=-33.7221,
    longitude_deg=150.6739,
    altitude_m=1.15,
    covariance_N=np.array([[0.36, 0.01, 0.0], [0.01, 0.25, 0.0], [0.0, 0.0, 1.0]]),
)
IMU = Imu(
    stamp_ns=STAMP_NS,
    rates_I=np.array((0.01, 0.02, -0.3)),
    force_I=np.array((0.5, 0.25, -9.81)),
    q_NI=quaternion_from_euler(0.0, 0.0, np.pi / 4),
    attitude_variance=np.array((1e-4, 1e-4, 4e-4)),
    rates_variance=np.full(3, 8e-5),
    force_variance=np.full(3, 4e-4),
)
TRACKS = Tracks(
    stamp_ns=STAMP_NS,
    id=np.array([3]),
    p_N=np.array([[1.0, 2.0]]),
    v_N=np.array([[0.0, 1.5]]),
    radius=np.array([1.5]),
    covariance=np.zeros((1, 4, 4)),
    age_s=np.zeros(1),
)


def same_but_for_rounding(ours: bytes, theirs: bytes, start: int, end: int | None = None) -> None:
    assert ours[:start] == theirs[:start]
    np.testing.assert_allclose(
        np.frombuffer(ours[start:end]), np.frombuffer(theirs[start:end]), rtol=0, atol=1e-15
    )
    assert len(ours) == len(theirs)


def test_a_written_fix_is_that_of_the_other_implementation():
    assert cdr.encode_fix(FIX) == golden("fix")


def test_a_written_path_is_that_of_the_other_implementation():
    assert cdr.encode_path(PLACES_N, stamp_ns=STAMP_NS) == golden("path")


def test_a_written_imu_message_differs_from_the_other_implementation_by_rounding_only():
    theirs = golden("imu")
    same_but_for_rounding(cdr.encode_imu(IMU), theirs, len(theirs) - 37 * 8)


def test_written_tracks_are_those_of_the_other_implementation():
    assert cdr.encode_track_markers(TRACKS) == golden("track_markers")


@BYTE_ORDERS
def test_a_fix_is_read_with_its_covariance_turned_from_enu_to_ned(suffix):
    fix = cdr.decode_fix(golden("fix", suffix))
    np.testing.assert_array_equal(fix.covariance_N, FIX.covariance_N)
    assert replace(fix, covariance_N=None) == replace(FIX, covariance_N=None)


@BYTE_ORDERS
def test_an_imu_message_is_turned_from_enu_and_flu_to_ned_and_frd(suffix):
    imu = cdr.decode_imu(golden("imu", suffix))
    assert imu.stamp_ns == STAMP_NS
    np.testing.assert_allclose(imu.q_NI, IMU.q_NI, atol=1e-15)
    for name in ("rates_I", "force_I", "attitude_variance", "rates_variance", "force_variance"):
        np.testing.assert_array_equal(getattr(imu, name), getattr(IMU, name))


@BYTE_ORDERS
def test_a_path_is_turned_from_enu_to_ned(suffix):
    stamp_ns, places_N, _ = cdr.decode_path(golden("path", suffix))
    assert stamp_ns == STAMP_NS
    np.testing.assert_array_equal(places_N, PLACES_N)


def test_written_odometry_differs_from_the_other_implementation_by_rounding_only():
    ours, theirs = cdr.encode_odometry(ODOMETRY), golden("odometry")
    start = len(theirs) - 85 * 8
    assert ours[:start] == theirs[:start]
    np.testing.assert_allclose(
        np.frombuffer(ours[start:]), np.frombuffer(theirs[start:]), rtol=0, atol=1e-15
    )


def test_written_markers_are_those_of_the_other_implementation():
    first = Objects(
        stamp_ns=STAMP_NS,
        p_L=OBJECTS.p_L[:1],
        radius=OBJECTS.radius[:1],
        points=OBJECTS.points[:1],
    )
    assert cdr.encode_object_markers(first) == golden("object_markers")


def test_written_cloud_is_that_of_the_other_implementation_but_for_the_sign_of_a_nan():
    ours, theirs = bytearray(cdr.encode_point_cloud(CLOUD)), golden("point_cloud")
    nan = theirs.index(bytes.fromhex("0000c07f"))
    ours[nan + 3] &= 0x7F
    assert bytes(ours) == theirs


@BYTE_ORDERS
def test_odometry_is_turned_from_enu_and_flu_to_ned_and_frd(suffix):
    odometry = cdr.decode_odometry(golden("odometry", suffix))
    assert odometry.stamp_ns == STAMP_NS
    np.testing.assert_array_equal(odometry.position_N, ODOMETRY.position_N)
    np.testing.assert_allclose(odometry.q_NB, ODOMETRY.q_NB, atol=1e-15)
    np.testing.assert_array_equal(odometry.velocity_B, ODOMETRY.velocity_B)
    np.testing.assert_array_equal(odometry.rates_B, ODOMETRY.rates_B)


@BYTE_ORDERS
def test_goal_is_turned_from_enu_to_ned(suffix):
    goal = cdr.decode_goal(golden("goal", suffix))
    assert goal.stamp_ns == STAMP_NS
    np.testing.assert_array_equal(goal.position_N, (40.0, 30.0))


def test_cloud_is_turned_from_flu_to_frd():
    cloud = cdr.decode_point_cloud(golden("point_cloud"))
    assert (cloud.stamp_ns, cloud.frame_id) == (STAMP_NS, "lidar")
    np.testing.assert_array_equal(cloud.points_S, CLOUD.points_S)
    np.testing.assert_array_equal(cloud.intensity, CLOUD.intensity)
    np.testing.assert_array_equal(cloud.ring, CLOUD.ring)


def test_points_keep_the_byte_order_that_their_message_names_in_a_big_endian_payload():
    # is_bigendian is False in this message: the points are little endian, the rest is not.
    cloud = cdr.decode_point_cloud(golden("point_cloud", ".be.cdr"))
    np.testing.assert_array_equal(cloud.points_S, CLOUD.points_S)


@BYTE_ORDERS
def test_small_messages_are_read(suffix):
    assert cdr.decode_thrust(golden("thrust", suffix)) == -123.456
    assert cdr.decode_clock(golden("clock", suffix)) == STAMP_NS
    expected = Engagement(stamp_ns=STAMP_NS, engaged=True)
    assert cdr.decode_engagement(golden("engagement", suffix)) == expected


@BYTE_ORDERS
def test_diagnostics_are_read(suffix):
    assert cdr.decode_diagnostics(golden("diagnostics", suffix)) == EVENTS


@BYTE_ORDERS
def test_a_decision_is_read_bit_for_bit(suffix):
    decision = cdr.decode_decision(golden("decision", suffix))
    assert decision.events == DECISION.events
    assert cdr.encode_decision(decision) == golden("decision")
