import numpy as np
import pytest
from tests.harness.boat import cloud
from tests.harness.boat import odometry as at_rest

from twinscrew.runtime.app.freshness import Freshness
from twinscrew.runtime.geometry import quaternion_from_euler
from twinscrew.runtime.messages.types import Odometry

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
