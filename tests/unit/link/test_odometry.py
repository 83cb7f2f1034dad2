import math

import numpy as np
import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from twinscrew.runtime.datum import EARTH_RADIUS_M, Datum
from twinscrew.runtime.link.ardupilot.odometry import PAIR_WITHIN_MS, OdometryFromAutopilot

BOOT_S = 500.0
"""[s] The caller's time when the autopilot booted."""


def feed(source, boot_ms, *, delay_s=0.0, attitude_ms=None, **values):
    attitude_ms = boot_ms if attitude_ms is None else attitude_ms
    yaw = values.get("yaw", 0.0)
    x, vx, vy = (values.get(name, 0.0) for name in ("x", "vx", "vy"))
    now_s = BOOT_S + boot_ms * 1e-3 + delay_s
    attitude = mavlink.MAVLink_attitude_message(attitude_ms, 0.0, 0.0, yaw, 0.0, 0.0, 0.1)
    source.attitude(attitude, now_s)
    position = mavlink.MAVLink_local_position_ned_message(boot_ms, x, 2.0, 3.0, vx, vy, 0.0)
    source.position(position, now_s)
    return source.newest


def test_velocity_is_turned_into_the_body():
    got = feed(OdometryFromAutopilot(), 1000, x=1.0, yaw=math.pi / 2, vx=0.0, vy=2.0)
    assert got.position_N.tolist() == [1.0, 2.0, 3.0]
    assert got.velocity_B == pytest.approx([2.0, 0.0, 0.0], abs=1e-9)
    assert got.heading == pytest.approx(math.pi / 2)
    assert got.rates_B.tolist() == [0.0, 0.0, 0.1]


def test_the_stamp_is_when_it_was_measured_not_when_it_came():
    source = OdometryFromAutopilot()
    feed(source, 1000, delay_s=0.0)
    got = feed(source, 1050, delay_s=0.2)
    assert got.stamp_ns * 1e-9 == pytest.approx(BOOT_S + 1.05, abs=1e-3)


def test_a_drifting_clock_is_followed():
    source = OdometryFromAutopilot()
    drift = 50e-6
    for k in range(0, 3_600_000, 5000):
        now_s = BOOT_S + k * 1e-3 * (1 + drift)
        source.attitude(mavlink.MAVLink_attitude_message(k, 0, 0, 0, 0, 0, 0), now_s)
        source.position(mavlink.MAVLink_local_position_ned_message(k, 0, 0, 0, 0, 0, 0), now_s)
    assert source.newest.stamp_ns * 1e-9 == pytest.approx(now_s, abs=1e-3)


def test_messages_of_different_moments_are_not_joined():
    assert feed(OdometryFromAutopilot(), 1000, attitude_ms=1000 - PAIR_WITHIN_MS - 1) is None


def test_an_autopilot_that_starts_again_is_aligned_anew():
    source = OdometryFromAutopilot()
    feed(source, 100_000)
    got = feed(source, 1000, delay_s=99.0)
    assert got.stamp_ns * 1e-9 == pytest.approx(BOOT_S + 100.0, abs=1e-3)


@pytest.mark.parametrize("value", [math.nan, math.inf])
def test_what_is_not_finite_is_dropped(value):
    source = OdometryFromAutopilot()
    assert feed(source, 1000, x=value) is None
    assert np.isfinite(feed(source, 1050).position_N).all()


def test_every_result_can_be_taken_once():
    source = OdometryFromAutopilot()
    for boot_ms in (1000, 1050, 1100):
        feed(source, boot_ms, x=boot_ms * 1e-3)
    assert [odometry.position_N[0] for odometry in source.take()] == [1.0, 1.05, 1.1]
    assert source.take() == []
    assert source.newest.position_N[0] == pytest.approx(1.1)


def position_at(boot_ms):
    return mavlink.MAVLink_local_position_ned_message(boot_ms, boot_ms, 0, 0, 0, 0, 0)


def attitude_at(boot_ms, yaw=0.0):
    return mavlink.MAVLink_attitude_message(boot_ms, 0.0, 0.0, yaw, 0.0, 0.0, 0.1)


def test_a_position_that_comes_first_waits_for_its_own_attitude():
    source = OdometryFromAutopilot()
    feed(source, 1000, yaw=1.0)
    source.position(position_at(1050), BOOT_S + 1.05)
    assert source.newest.position_N[0] == 0.0
    source.attitude(attitude_at(1050, yaw=2.0), BOOT_S + 1.05)
    assert source.newest.position_N[0] == 1050
    assert source.newest.heading == pytest.approx(2.0)


def test_if_its_attitude_is_lost_an_older_one_is_turned_on_to_the_positions_time():
    source = OdometryFromAutopilot()
    source.attitude(attitude_at(1000, yaw=1.0), BOOT_S + 1.0)
    source.position(position_at(1050), BOOT_S + 1.05)
    source.position(position_at(1100), BOOT_S + 1.1)
    assert source.newest.position_N[0] == 1050
    assert source.newest.heading == pytest.approx(1.0 + 0.1 * 0.05)


DATUM = Datum(latitude_deg=-33.7221, longitude_deg=150.6739)


def origin(latitude_deg, longitude_deg):
    return mavlink.MAVLink_gps_global_origin_message(
        round(latitude_deg * 1e7), round(longitude_deg * 1e7), 0, 0
    )


def test_with_a_datum_nothing_is_given_before_the_origin_is_told():
    source = OdometryFromAutopilot(DATUM)
    assert feed(source, 1000) is None
    source.origin(origin(DATUM.latitude_deg, DATUM.longitude_deg), BOOT_S)
    assert feed(source, 1050, x=7.0).position_N == pytest.approx([7.0, 2.0, 3.0], abs=1e-3)


def test_with_a_datum_positions_are_counted_from_it():
    source = OdometryFromAutopilot(DATUM)
    north_deg = math.degrees(30.0 / EARTH_RADIUS_M)
    east_deg = math.degrees(-20.0 / EARTH_RADIUS_M / math.cos(math.radians(DATUM.latitude_deg)))
    source.origin(origin(DATUM.latitude_deg + north_deg, DATUM.longitude_deg + east_deg), BOOT_S)
    got = feed(source, 1000, x=1.0)
    assert got.position_N == pytest.approx([31.0, -18.0, 3.0], abs=0.02)


def test_an_autopilot_that_starts_again_must_tell_its_new_origin_first():
    source = OdometryFromAutopilot(DATUM)
    source.origin(origin(DATUM.latitude_deg, DATUM.longitude_deg), BOOT_S)
    feed(source, 100_000)
    source.take()
    feed(source, 1000)
    assert source.take() == []


def test_without_a_datum_the_autopilots_origin_does_not_matter():
    source = OdometryFromAutopilot()
    source.origin(origin(1.0, 2.0), BOOT_S)
    assert feed(source, 1000, x=1.0).position_N.tolist() == [1.0, 2.0, 3.0]


@pytest.mark.parametrize("lost", [position_at, attitude_at])
@pytest.mark.parametrize("order", [(attitude_at, position_at), (position_at, attitude_at)])
def test_after_a_loss_positions_are_not_given_late(lost, order):
    source = OdometryFromAutopilot()
    for boot_ms in range(1000, 1400, 50):
        for make in order:
            if (boot_ms, make) != (1100, lost):
                now_s = BOOT_S + boot_ms * 1e-3
                message = make(boot_ms)
                take = source.attitude if make is attitude_at else source.position
                take(message, now_s)
        if boot_ms != 1100:
            assert source.newest.position_N[0] == boot_ms
    assert len(source.take()) == (8 if lost is attitude_at else 7)


def test_a_position_is_given_once_however_many_attitudes_come():
    source = OdometryFromAutopilot()
    feed(source, 1000)
    for boot_ms in (1010, 1020, 1030):
        attitude = mavlink.MAVLink_attitude_message(boot_ms, 0, 0, 0, 0, 0, 0)
        source.attitude(attitude, BOOT_S + boot_ms * 1e-3)
    assert len(source.take()) == 1


def whole(boot_ms=1000, **changes):
    """ODOMETRY of a boat that heads east with 2 m/s."""
    values = {
        "time_usec": boot_ms * 1000,
        "frame_id": mavlink.MAV_FRAME_LOCAL_NED,
        "child_frame_id": mavlink.MAV_FRAME_BODY_FRD,
        "x": 1.0,
        "y": 2.0,
        "z": 3.0,
        "q": [math.sqrt(0.5), 0.0, 0.0, math.sqrt(0.5)],
        "vx": 2.0,
        "vy": 0.1,
        "vz": 0.0,
        "rollspeed": 0.01,
        "pitchspeed": 0.02,
        "yawspeed": 0.3,
        "pose_covariance": [math.nan] * 21,
        "velocity_covariance": [math.nan] * 21,
        "quality": 0,
    }
    return mavlink.MAVLink_odometry_message(**(values | changes))


def test_one_message_may_tell_everything():
    source = OdometryFromAutopilot()
    source.whole(whole(), BOOT_S + 1.0)
    (got,) = source.take()
    assert got.position_N.tolist() == [1.0, 2.0, 3.0]
    assert got.heading == pytest.approx(math.pi / 2)
    assert got.velocity_B == pytest.approx([2.0, 0.1, 0.0])
    assert got.rates_B == pytest.approx([0.01, 0.02, 0.3])
    assert got.stamp_ns * 1e-9 == pytest.approx(BOOT_S + 1.0, abs=1e-6)


def test_a_velocity_in_the_local_frame_is_turned_into_the_body():
    source = OdometryFromAutopilot()
    message = whole(child_frame_id=mavlink.MAV_FRAME_LOCAL_NED, vx=0.0, vy=2.0)
    source.whole(message, BOOT_S + 1.0)
    assert source.newest.velocity_B == pytest.approx([2.0, 0.0, 0.0], abs=1e-6)


@pytest.mark.parametrize(
    "changes",
    [
        {"frame_id": mavlink.MAV_FRAME_LOCAL_FRD},
        {"child_frame_id": mavlink.MAV_FRAME_LOCAL_FLU},
        {"vx": math.nan},
        {"q": [0.0] * 4},
        {"q": [math.nan] * 4},
        {"quality": -1},
    ],
    ids=str,
)
def test_a_message_that_cannot_be_used_is_dropped(changes):
    source = OdometryFromAutopilot()
    source.whole(whole(**changes), BOOT_S + 1.0)
    assert source.take() == []


def test_its_time_is_aligned_by_timesync_as_that_of_the_others():
    source = OdometryFromAutopilot()
    source.whole(whole(1000), BOOT_S + 1.3)  # late from the first: one way alone cannot tell
    (question,) = source.clock.ask(BOOT_S + 2.0)
    answer = mavlink.MAVLink_timesync_message(2_010_000_000, question.ts1)
    source.clock.answered(answer, BOOT_S + 2.02)
    source.whole(whole(2500), BOOT_S + 2.8)
    assert source.newest.stamp_ns * 1e-9 == pytest.approx(BOOT_S + 2.5, abs=1e-3)


def test_a_sender_that_counts_from_1970_has_a_clock_of_its_own():
    source = OdometryFromAutopilot()
    unix_us = 1_800_000_000_000_000
    for k, delay_s in enumerate((0.2, 0.01, 0.2)):
        source.whole(whole(time_usec=unix_us + 50_000 * k), BOOT_S + 0.05 * k + delay_s)
    assert source.newest.stamp_ns * 1e-9 == pytest.approx(BOOT_S + 0.11, abs=1e-3)
    feed(source, 1000)  # its boot clock is not disturbed
    assert source.newest.stamp_ns * 1e-9 == pytest.approx(BOOT_S + 1.0, abs=1e-3)


def test_it_too_is_counted_from_the_datum():
    source = OdometryFromAutopilot(Datum(latitude_deg=-33.0, longitude_deg=151.0))
    source.whole(whole(), BOOT_S + 1.0)
    assert source.take() == []
    north_deg = math.degrees(100.0 / EARTH_RADIUS_M)
    source.origin(
        mavlink.MAVLink_gps_global_origin_message(round((-33.0 + north_deg) * 1e7), 1510000000, 0),
        BOOT_S,
    )
    source.whole(whole(1050), BOOT_S + 1.05)
    assert source.newest.position_N == pytest.approx([101.0, 2.0, 3.0], abs=0.02)
