import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from twinscrew.hil_sim.experiments.summary import (
    bootstrap_mean,
    holm,
    mcnemar,
    pair,
    percentiles,
    wilson,
)

Z95 = 1.959963984540054
"""[-] The 97.5 % quantile of the normal distribution."""


@given(st.integers(1, 300).flatmap(lambda n: st.tuples(st.integers(0, n), st.just(n))))
def test_the_ends_of_wilsons_interval_are_those_rates_that_the_data_just_allow(counts) -> None:
    successes, trials = counts
    for end in wilson(successes, trials):
        if 1e-9 < end < 1.0 - 1e-9:
            deviation = abs(successes / trials - end)
            assert deviation == pytest.approx(Z95 * math.sqrt(end * (1 - end) / trials), rel=1e-6)


def test_wilsons_interval_of_ten_successes_out_of_ten_reaches_down_to_72_percent() -> None:
    low, high = wilson(10, 10)
    assert low == pytest.approx(10 / (10 + Z95**2))  # by hand: n / (n + z^2)
    assert high == pytest.approx(1.0)


def test_without_trials_any_rate_is_possible() -> None:
    assert wilson(0, 0) == (0.0, 1.0)


@pytest.mark.parametrize(
    ("first", "second", "p"),
    [(0, 0, 1.0), (3, 3, 1.0), (1, 5, 14 / 64), (5, 1, 14 / 64), (0, 6, 2 / 64), (0, 10, 2 / 1024)],
)
def test_mcnemars_p_is_twice_the_tail_of_a_fair_coin(first: int, second: int, p: float) -> None:
    assert mcnemar(first, second) == pytest.approx(p)


def test_pairs_are_counted_by_who_succeeded() -> None:
    counts = pair([True, True, False, False, True], [True, False, True, False, False])
    assert (counts.both, counts.only_first, counts.only_second, counts.neither) == (1, 2, 1, 1)
    assert counts.p_value == mcnemar(2, 1)


def test_methods_with_different_numbers_of_episodes_cannot_be_paired() -> None:
    with pytest.raises(ValueError, match="argument"):
        pair([True], [True, False])


def test_holm_multiplies_the_least_p_most_and_never_turns_their_order() -> None:
    assert holm([0.01, 0.04, 0.03]) == pytest.approx([0.03, 0.06, 0.06])
    assert holm([0.9, 0.8]) == [1.0, 1.0]
    assert holm([]) == []


def test_the_mean_weighs_every_vessel_alike_and_the_interval_holds_it() -> None:
    mean, low, high = bootstrap_mean([[10.0, 20.0], [30.0], [20.0, 20.0]])
    assert mean == pytest.approx(20.0)
    assert 15.0 <= low < mean < high <= 30.0


def test_equal_values_leave_no_doubt() -> None:
    assert bootstrap_mean([[7.0, 7.0], [7.0]]) == (7.0, 7.0, 7.0)


def test_the_interval_of_many_independent_values_is_the_normal_one() -> None:
    values = np.random.default_rng(1).normal(20.0, 3.0, 400)
    mean, low, high = bootstrap_mean([[value] for value in values])
    half = Z95 * values.std() / math.sqrt(len(values))
    assert (mean - low, high - mean) == pytest.approx((half, half), rel=0.08)


def test_vessels_of_one_episode_count_as_one_trial() -> None:
    episodes = [[10.0] * 5, [20.0] * 5, [30.0] * 5]
    _, low, high = bootstrap_mean(episodes)
    _, near, far = bootstrap_mean([[value] for group in episodes for value in group])
    assert high - low > 1.5 * (far - near)


def test_episodes_without_a_value_are_left_out() -> None:
    assert bootstrap_mean([[], [4.0], []]) == (4.0, 4.0, 4.0)
    assert all(math.isnan(value) for value in bootstrap_mean([[], []]))


def test_percentiles_of_nothing_are_no_numbers() -> None:
    assert percentiles([0.0, 1.0, 2.0], (50, 100)) == [1.0, 2.0]
    assert all(math.isnan(value) for value in percentiles([], (5, 50)))
