import math

import numpy as np
import pytest

from twinscrew.runtime.app.odometry_buffer import (
    HISTORY_S,
    MOST_SAMPLES,
    Arrival,
    OdometryBuffer,
)
from twinscrew.runtime.geometry import euler_from_quaternion, quaternion_from_euler
from twinscrew.runtime.messages.types import Odometry

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
