"""The statistics of the experiments: pure functions, each with its source."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from twinscrew.runtime.messages.types import Float64

Z95 = 1.959963984540054
"""[-] The 97.5 % quantile of the normal distribution."""
RESAMPLES = 10_000
"""[-] Bootstrap samples: the interval's ends are then good to about 1 % of its width."""


def wilson(successes: int, trials: int) -> tuple[float, float]:
    """Give Wilson's score interval of a proportion at 95 % confidence; (0, 1) without trials.

    Source: Wilson (1927), Probable inference, the law of succession, and statistical inference.
    """
    if trials == 0:
        return 0.0, 1.0
    share, z2 = successes / trials, Z95**2
    centre = (share + z2 / (2 * trials)) / (1 + z2 / trials)
    half = Z95 / (1 + z2 / trials) * math.sqrt(share * (1 - share) / trials + z2 / (4 * trials**2))
    return max(0.0, centre - half), min(1.0, centre + half)


def bootstrap_mean(groups: Sequence[Sequence[float]], seed: int = 0) -> tuple[float, float, float]:
    """Give the mean of all values, and the 95 % percentile interval when groups are resampled.

    Vessels of one episode are no independent trials: whole episodes are drawn again.

    Parameters
    ----------
    groups
        One a trial (an episode), with its values (its vessels' travel times).
    seed
        Of the resampling: the same values give the same interval.

    Returns
    -------
    mean, low, high : float
        nan without a value; with one group, its mean thrice.

    Source: Efron and Tibshirani (1993), An introduction to the bootstrap, chapter 13.
    """
    filled = [group for group in groups if len(group)]
    if not filled:
        return math.nan, math.nan, math.nan
    sums = np.array([float(np.sum(group)) for group in filled])
    counts = np.array([len(group) for group in filled])
    drawn = np.random.default_rng(seed).integers(len(filled), size=(RESAMPLES, len(filled)))
    means = sums[drawn].sum(axis=1) / counts[drawn].sum(axis=1)
    low, high = np.percentile(means, [2.5, 97.5])
    return float(sums.sum() / counts.sum()), float(low), float(high)


@dataclass(frozen=True, slots=True)
class Paired:
    """Two methods on the same episodes."""

    only_first: int
    """[-] Episodes in which only the first succeeded."""
    only_second: int
    both: int
    neither: int

    @property
    def p_value(self) -> float:
        """McNemar's exact two-sided p value."""
        return mcnemar(self.only_first, self.only_second)


def pair(first: Sequence[bool], second: Sequence[bool]) -> Paired:
    """Count how two methods fared in the same episodes, in the same order."""
    cells = list(zip(first, second, strict=True))
    return Paired(
        only_first=cells.count((True, False)),
        only_second=cells.count((False, True)),
        both=cells.count((True, True)),
        neither=cells.count((False, False)),
    )


def mcnemar(only_first: int, only_second: int) -> float:
    """Give the exact two-sided p value of McNemar's test.

    Of the episodes in which one method alone succeeded, either is as likely the one if the methods
    are equally good: a binomial test with 1/2. Source: McNemar (1947); Fay (2010), R Journal 2/1.
    """
    discordant = only_first + only_second
    least = min(only_first, only_second)
    tail: float = sum(math.comb(discordant, k) for k in range(least + 1)) / 2**discordant
    return min(1.0, 2.0 * tail)


def holm(p_values: Sequence[float]) -> list[float]:
    """Give p values adjusted for their number, in the given order.

    Source: Holm (1979), A simple sequentially rejective multiple test procedure.
    """
    order = sorted(range(len(p_values)), key=lambda i: p_values[i])
    adjusted, greatest = [0.0] * len(p_values), 0.0
    for rank, i in enumerate(order):
        greatest = max(greatest, min(1.0, (len(p_values) - rank) * p_values[i]))
        adjusted[i] = greatest
    return adjusted


def percentiles(values: Sequence[float] | Float64, shares: Sequence[float]) -> list[float]:
    """Give percentiles, linearly interpolated; nan without values."""
    if len(values) == 0:
        return [math.nan] * len(shares)
    return [float(value) for value in np.percentile(np.asarray(values, dtype=float), shares)]
