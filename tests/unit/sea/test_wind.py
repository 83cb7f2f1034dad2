"""Wind: where it blows to, and how its gusts behave."""

import math

import numpy as np
import pytest

from twinscrew.hil_sim.sea.sea import BLOCK, GRID_S, Wind, WindSettings


def wind(seed: int = 0, **settings: float) -> Wind:
    return Wind(WindSettings(**settings), np.random.default_rng(seed))


def gusts(source: Wind, times: np.ndarray) -> np.ndarray:
    """The wind's part along its direction, without the mean; it blows to the south."""
    return np.array([-source.velocity(t)[0] for t in times])


@pytest.mark.parametrize(
    ("from_deg", "velocity"), [(0, (-10, 0)), (90, (0, -10)), (180, (10, 0)), (225, (7.07, 7.07))]
)
def test_wind_blows_away_from_where_it_comes(from_deg, velocity):
    np.testing.assert_allclose(wind(from_deg=from_deg).velocity(3.0), velocity, atol=2e-3)


def test_without_gusts_the_wind_is_steady():
    steady = wind()
    np.testing.assert_array_equal(steady.velocity(0.0), steady.velocity(1234.5))


def test_gusts_do_not_depend_on_how_often_or_in_which_order_they_are_asked():
    times = np.random.default_rng(3).uniform(0, 3 * BLOCK * GRID_S, 200)
    settings = {"gust_mps": 2.0, "mean_mps": 0.0, "from_deg": 0.0}
    in_order = dict(zip(sorted(times), gusts(wind(**settings), sorted(times)), strict=True))
    for t, gust in zip(times, gusts(wind(**settings), times), strict=True):
        assert gust == in_order[t]


def test_gusts_have_the_deviation_and_memory_of_the_settings():
    # 4 time constants apart, samples are nearly independent: 20 000 / 8 of them; 5 sigma is 7 %.
    source = wind(gust_mps=2.0, gust_time_constant_s=2.0, mean_mps=0.0, from_deg=0.0)
    sample = gusts(source, np.arange(0, 20_000, 0.5))
    assert sample.std() == pytest.approx(2.0, rel=0.07)
    assert sample.mean() == pytest.approx(0.0, abs=0.2)
    one_constant = np.corrcoef(sample[:-4], sample[4:])[0, 1]
    assert one_constant == pytest.approx(math.exp(-1), abs=0.07)


def test_other_seeds_give_other_gusts():
    times = np.arange(0, 10, 0.5)
    assert not np.allclose(
        gusts(wind(1, gust_mps=1.0, from_deg=0.0), times),
        gusts(wind(2, gust_mps=1.0, from_deg=0.0), times),
    )


def test_before_the_beginning_the_wind_is_that_of_the_beginning():
    source = wind(gust_mps=1.0)
    np.testing.assert_array_equal(source.velocity(-5.0), source.velocity(0.0))
