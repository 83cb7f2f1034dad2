"""None"""

from __future__ import annotations

import math

import numpy as np
import pytest
from tests.harness.boat import cloud
from tests.harness.boat import odometry as at_rest

from twinscrew.runtime.geometry.frames import euler_from_quaternion, quaternion_from_euler
from twinscrew.runtime.messages.types import Odometry
from twinscrew.runtime.vessel.inputs import (
    HISTORY_S,
    MOST_SAMPLES,
    Arrival,
    Freshness,
    OdometryBuffer,
)

SECOND = 1_000_000_000


def sample(time_s: float, north: float = 0.0, yaw: float = 0.0, surge: float = 0.0) -> Odometry:
    return Odometry(
        stamp_ns=round(time_s * SECOND),
        position_N=np.array([north, 0.0, 0.0]),
        q_NB=quaternion_from_euler(0, 0, yaw),
        velocity_B=np.array([surge, 0, 0]),
        rates_B=np.array([0, 0, 0.5]),
    )


def filled(*samples: Odometry) -> OdometryBuffer:
    buffer = OdometryBuffer()
    for odometry in samples:
        buffer.add(odometry)
    return buffer


def test_between_two_messages_everything_is_in_between() -> None:
    buffer = filled(sample(1.0, 10.0, 0.1, 2.0), sample(1.1, 10.2, 0.3, 4.0))
    there = buffer.at(round(1.05 * SECOND))
    assert there is not None
    assert there.position_N[0] == pytest.approx(10.1)
    assert euler_from_quaternion(there.q_NB)[2] == pytest.approx(0.2)
    assert there.velocity_B[0] == pytest.approx(3.0)


def test_a_message_at_the_time_itself_is_given_as_it_is() -> None:
    exact = sample(1.0, 10.0)
    assert filled(sample(0.9), exact, sample(1.1, 10.1)).at(exact.stamp_ns) is exact


def test_a_little_later_the_vessel_goes_on_as_it_went() -> None:
    there = filled(sample(1.0, 10.0, math.pi / 2, 3.0)).at(round(1.1 * SECOND))
    assert there is not None
    np.testing.assert_allclose(there.position_N, [10.0, 0.3, 0.0], atol=1e-9)
    assert euler_from_quaternion(there.q_NB)[2] == pytest.approx(math.pi / 2 + 0.05)


@pytest.mark.parametrize("time_s", [0.5, 1.25])
def test_too_early_or_too_late_is_no_odometry(time_s: float) -> None:
    assert filled(sample(1.0)).at(round(time_s * SECOND)) is None


def test_nothing_is_known_before_the_first_message() -> None:
    assert OdometryBuffer().at(0) is None


@pytest.mark.parametrize(
    ("odometry", "arrival"),
    [
        (sample(1.05, 0.2), Arrival.NEW),
        (sample(1.0), Arrival.OLD),
        (sample(0.9), Arrival.OLD),
        (sample(1.05, 3.0), Arrival.JUMP),
        (sample(-0.5), Arrival.CLOCK_BACK),
    ],
)
def test_a_message_is_told_by_its_stamp_and_place(odometry: Odometry, arrival: Arrival) -> None:
    assert filled(sample(0.95), sample(1.0)).add(odometry) is arrival


def test_after_a_jump_only_the_new_place_counts() -> None:
    buffer = filled(sample(1.0), sample(1.05, 50.0))
    assert buffer.at(round(1.02 * SECOND)) is None
    there = buffer.at(round(1.06 * SECOND))
    assert there is not None
    assert there.position_N[0] == pytest.approx(50.0)


def test_odometry_is_kept_for_seconds_at_any_rate_and_a_flood_does_not_fill_the_memory() -> None:
    for rate_hz in (20, 1000):
        buffer = filled(*(sample(k / rate_hz) for k in range(5 * rate_hz)))
        last_s = 5.0 - 1.0 / rate_hz
        assert buffer.at(round((last_s - 0.95 * HISTORY_S) * SECOND)) is not None
        assert buffer.at(round((last_s - 1.05 * HISTORY_S) * SECOND)) is None
    flood = OdometryBuffer()
    for k in range(MOST_SAMPLES + 10):
        flood.add(sample(1.0 + 1e-6 * k))
    assert len(flood._samples) == MOST_SAMPLES


# --

SEEN = [(5.0, 1.0, 0.2), (6.0, -2.0, 0.1)]


def under_way(time_s: float, north: float = 0.0, *, speed: float = 3.0, yaw: float = 0.0):
    resting = at_rest(time_s, north)
    return Odometry(
        stamp_ns=resting.stamp_ns,
        position_N=resting.position_N,
        q_NB=quaternion_from_euler(0.0, 0.0, yaw),
        velocity_B=np.array([speed, 0.0, 0.0]),
        rates_B=resting.rates_B,
    )


def test_the_same_points_from_another_place_are_a_repetition() -> None:
    freshness = Freshness()
    assert not freshness.scan_repeats(cloud(0.0, SEEN), under_way(0.0))
    assert freshness.scan_repeats(cloud(0.1, SEEN), under_way(0.1, 0.3))
    assert freshness.scan_repeats(cloud(0.2, SEEN), under_way(0.2, 0.6))
    assert not freshness.scan_repeats(cloud(0.3, [(5.0, 1.0, 0.3)]), under_way(0.3, 0.9))


def test_the_same_points_on_another_heading_are_a_repetition() -> None:
    freshness = Freshness()
    freshness.scan_repeats(cloud(0.0, SEEN), under_way(0.0))
    assert freshness.scan_repeats(cloud(0.1, SEEN), under_way(0.1, yaw=0.02))


def test_a_slow_vessel_is_noticed_once_it_has_moved() -> None:
    freshness = Freshness()
    told = [
        freshness.scan_repeats(cloud(0.1 * k, SEEN), under_way(0.1 * k, 0.02 * k)) for k in range(6)
    ]
    assert told == [False, False, False, True, True, True]


@pytest.mark.parametrize("points", [[], [(np.nan, np.nan, np.nan)] * 3])
def test_seeing_nothing_twice_is_normal(points) -> None:
    freshness = Freshness()
    freshness.scan_repeats(cloud(0.0, points), under_way(0.0))
    assert not freshness.scan_repeats(cloud(0.1, points), under_way(0.1, 5.0))


def test_a_vessel_at_rest_may_see_the_same_twice() -> None:
    freshness = Freshness()
    freshness.scan_repeats(cloud(0.0, SEEN), at_rest(0.0))
    assert not freshness.scan_repeats(cloud(0.1, SEEN), at_rest(0.1))


def test_one_echo_of_many_that_differs_is_news() -> None:
    points = np.random.default_rng(0).normal(size=(1000, 3))
    freshness = Freshness()
    freshness.scan_repeats(cloud(0.0, points), under_way(0.0))
    points[501] += 0.01
    assert not freshness.scan_repeats(cloud(0.1, points), under_way(0.1, 1.0))


def test_odometry_that_moves_and_stays_repeats_itself() -> None:
    freshness = Freshness()
    assert not freshness.odometry_repeats(under_way(0.0))
    assert freshness.odometry_repeats(under_way(0.05))
    assert not freshness.odometry_repeats(under_way(0.1, 0.01))


def test_odometry_at_rest_may_stay_the_same() -> None:
    freshness = Freshness()
    freshness.odometry_repeats(under_way(0.0, speed=0.1))
    assert not freshness.odometry_repeats(under_way(0.05, speed=0.1))


def test_the_same_message_twice_is_out_of_order_and_no_repetition() -> None:
    freshness = Freshness()
    freshness.odometry_repeats(under_way(0.0))
    assert not freshness.odometry_repeats(under_way(0.0))
