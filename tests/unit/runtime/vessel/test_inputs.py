"""Scans and odometry are put in order, and what repeats or comes late is refused."""

import math

import numpy as np
import pytest
from tests.harness.boat import cloud
from tests.harness.boat import odometry as at_rest

from twinscrew.runtime.geometry import euler_from_quaternion, quaternion_from_euler
from twinscrew.runtime.messages.types import Odometry
from twinscrew.runtime.vessel.inputs import HISTORY_S, MOST_SAMPLES, Inputs

SECOND = 1_000_000_000


def sample(time_s: float, north: float = 0.0, yaw: float = 0.0, surge: float = 0.0) -> Odometry:
    return Odometry(
        stamp_ns=round(time_s * SECOND),
        position_N=np.array([north, 0.0, 0.0]),
        q_NB=quaternion_from_euler(0, 0, yaw),
        velocity_B=np.array([surge, 0, 0]),
        rates_B=np.array([0, 0, 0.5]),
    )


def filled(*samples: Odometry) -> Inputs:
    inputs = Inputs()
    for odometry in samples:
        inputs.odometry(odometry)
    return inputs


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
    assert Inputs().at(0) is None


@pytest.mark.parametrize(
    ("odometry", "event"),
    [
        (sample(1.05, 0.2), None),
        (sample(1.0), "out_of_order"),
        (sample(0.9), "out_of_order"),
        (sample(1.05, 3.0), "odometry_jump"),
        (sample(-0.5), "clock_back"),
    ],
)
def test_a_message_is_judged_by_its_stamp_and_place(odometry: Odometry, event: str | None) -> None:
    verdict = filled(sample(0.95), sample(1.0)).odometry(odometry)
    assert [found.name for found in verdict.events] == ([event] if event else [])
    assert verdict.usable is (event != "out_of_order")
    assert verdict.forget is (event in ("odometry_jump", "clock_back"))


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
    flood = Inputs()
    for k in range(MOST_SAMPLES + 10):
        flood.odometry(sample(1.0 + 1e-6 * k))
    assert len(flood._samples) == MOST_SAMPLES


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


def repeats(inputs: Inputs, time_s: float, points, odometry: Odometry) -> bool:
    """Take in a scan and the odometry at its time; tell whether the scan is refused as frozen."""
    inputs.odometry(odometry)
    verdict = inputs.scan(cloud(time_s, points))
    frozen = [event.name for event in verdict.events] == ["input_frozen"]
    assert verdict.usable is not frozen
    return frozen


def test_the_same_points_from_another_place_are_a_repetition() -> None:
    inputs = Inputs()
    assert not repeats(inputs, 0.0, SEEN, under_way(0.0))
    assert repeats(inputs, 0.1, SEEN, under_way(0.1, 0.3))
    assert repeats(inputs, 0.2, SEEN, under_way(0.2, 0.6))
    assert not repeats(inputs, 0.3, [(5.0, 1.0, 0.3)], under_way(0.3, 0.9))


def test_the_same_points_on_another_heading_are_a_repetition() -> None:
    inputs = Inputs()
    repeats(inputs, 0.0, SEEN, under_way(0.0))
    assert repeats(inputs, 0.1, SEEN, under_way(0.1, yaw=0.02))


def test_a_slow_vessel_is_noticed_once_it_has_moved() -> None:
    inputs = Inputs()
    found = [repeats(inputs, 0.1 * k, SEEN, under_way(0.1 * k, 0.02 * k)) for k in range(6)]
    assert found == [False, False, False, True, True, True]


@pytest.mark.parametrize("points", [[], [(np.nan, np.nan, np.nan)] * 3])
def test_seeing_nothing_twice_is_normal(points) -> None:
    inputs = Inputs()
    repeats(inputs, 0.0, points, under_way(0.0))
    assert not repeats(inputs, 0.1, points, under_way(0.1, 1.5))


def test_a_vessel_at_rest_may_see_the_same_twice() -> None:
    inputs = Inputs()
    repeats(inputs, 0.0, SEEN, at_rest(0.0))
    assert not repeats(inputs, 0.1, SEEN, at_rest(0.1))


def test_one_echo_of_many_that_differs_is_news() -> None:
    points = np.random.default_rng(0).normal(size=(1000, 3))
    inputs = Inputs()
    repeats(inputs, 0.0, points, under_way(0.0))
    points[501] += 0.01
    assert not repeats(inputs, 0.1, points, under_way(0.1, 1.0))


def refused(inputs: Inputs, odometry: Odometry) -> list[str]:
    return [event.name for event in inputs.odometry(odometry).events]


def test_odometry_that_moves_and_stays_repeats_itself() -> None:
    inputs = Inputs()
    assert refused(inputs, under_way(0.0)) == []
    assert refused(inputs, under_way(0.05)) == ["input_frozen"]
    assert refused(inputs, under_way(0.1, 0.01)) == []


def test_odometry_at_rest_may_stay_the_same() -> None:
    inputs = Inputs()
    inputs.odometry(under_way(0.0, speed=0.1))
    assert refused(inputs, under_way(0.05, speed=0.1)) == []


def test_the_same_message_twice_is_out_of_order_and_no_repetition() -> None:
    inputs = Inputs()
    inputs.odometry(under_way(0.0))
    assert refused(inputs, under_way(0.0)) == ["out_of_order"]
