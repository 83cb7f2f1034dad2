import math

import numpy as np
import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from twinscrew.runtime.link.datum import EARTH_RADIUS_M, Datum
from twinscrew.runtime.link.odometry import PAIR_WITHIN_MS, OdometryFromAutopilot

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
