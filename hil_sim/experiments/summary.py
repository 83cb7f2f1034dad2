"""From episodes to the figures of one method, set and variant, with the statistics behind them."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from statistics import fmean, median
from typing import Any

import numpy as np
from scipy.stats import binomtest, bootstrap

from twinscrew.hil_sim.experiments.results import CAUSES, EncounterRecord, EpisodeRecord
from twinscrew.runtime.messages.types import Float64

RESAMPLES = 10_000
"""[-] Bootstrap samples: the interval's ends are then good to about 1 % of its width."""


def wilson(successes: int, trials: int) -> tuple[float, float]:
    """Give Wilson's score interval of a proportion at 95 % confidence; (0, 1) without trials.

    Source: Wilson (1927), Probable inference, the law of succession, and statistical inference.
    """
    if trials == 0:
        return 0.0, 1.0
    interval = binomtest(successes, trials).proportion_ci(0.95, "wilson")
    return float(interval.low), float(interval.high)


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
    mean = float(sums.sum() / counts.sum())
    if len(filled) == 1:
        return mean, mean, mean
    interval = bootstrap(
        (sums, counts),
        lambda sums, counts, axis: sums.sum(axis) / counts.sum(axis),
        paired=True,
        n_resamples=RESAMPLES,
        method="percentile",
        rng=np.random.default_rng(seed),
    ).confidence_interval
    return mean, float(interval.low), float(interval.high)


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
    return float(binomtest(only_first, discordant).pvalue) if discordant else 1.0


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


# -- From episodes to the figures of one method, set and variant.


@dataclass(frozen=True, slots=True, kw_only=True)
class Rule:
    """How a rule of the COLREGs was kept."""

    encounters: int
    acted: int
    """[-] Encounters in which the vessel did as the rule asks."""
    touched: int
    deviated: int
    """[-] The others: encounters - acted."""
    safer: int
    """[-] Deviations that kept farther off than the compliant course would have."""
    gained_m: float
    """[m] Median over the deviations of the distance so gained; nan without one."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Cell:
    """One method's figures in one set and variant."""

    method: str
    set: str
    variant: str
    episodes: int
    successes: int
    wilson95: tuple[float, float]
    travel_time_s: tuple[float, float, float]
    """[s] Mean over the vessels of the successful episodes, and its 95 % bootstrap interval."""
    failures: dict[str, int]
    """[-] Episodes by the cause of their first failure, one of `CAUSES`."""
    closest_approach_m: tuple[float, float, float]
    """[m] 5 %, 25 % and 50 % percentile over all vessels."""
    energy_kns: float
    """[kN s] Mean a vessel in the successful episodes."""
    decision_ms: tuple[float, float]
    """[ms] Median of the episodes' p50, and of their p99 (each the slowest vessel's)."""
    real_time_factor: float
    interventions: int
    """[-] Of the assurance, over all vessels."""
    head_on: Rule
    give_way: Rule

    @property
    def success_rate(self) -> float:
        """[-] Share of the episodes in which all vessels arrived in time and none touched."""
        return self.successes / self.episodes

    def record(self) -> dict[str, Any]:
        """Give what `experiment --json` prints of it; None where there is no value."""
        mean, low, high = self.travel_time_s
        times = None if math.isnan(mean) else [round(mean, 3), round(low, 3), round(high, 3)]
        return {
            "method": self.method,
            "set": self.set,
            "variant": self.variant,
            "episodes": self.episodes,
            "successes": self.successes,
            "success_rate": round(self.success_rate, 4),
            "wilson95": [round(end, 4) for end in self.wilson95],
            "travel_time_s": times[0] if times else None,
            "travel_time_95_s": times[1:] if times else None,
            "failures": self.failures,
        }


def summarise(records: Sequence[EpisodeRecord]) -> list[Cell]:
    """Give a cell for each method, set and variant, in the order in which they first appear."""
    groups: dict[tuple[str, str, str], list[EpisodeRecord]] = {}
    for record in records:
        groups.setdefault((record.method, record.set, record.variant), []).append(record)
    return [cell(group) for group in groups.values()]


def cell(records: Sequence[EpisodeRecord]) -> Cell:
    """Give the figures of episodes of one kind; at least one."""
    first = records[0]
    successes = [record for record in records if record.success]
    near = [v.closest_approach_m for record in records for v in record.vessels]
    five, quarter, half = percentiles([m for m in near if m is not None], (5, 25, 50))
    return Cell(
        method=first.method,
        set=first.set,
        variant=first.variant,
        episodes=len(records),
        successes=len(successes),
        wilson95=wilson(len(successes), len(records)),
        travel_time_s=bootstrap_mean([[v.travel_time_s for v in r.vessels] for r in successes]),
        failures={cause: sum(record.cause == cause for record in records) for cause in CAUSES},
        closest_approach_m=(five, quarter, half),
        energy_kns=_mean(v.energy_ns / 1e3 for record in successes for v in record.vessels),
        decision_ms=(
            median(record.timing.decision_p50_ms for record in records),
            median(record.timing.decision_p99_ms for record in records),
        ),
        interventions=sum(v.interventions for record in records for v in record.vessels),
        real_time_factor=median(r.timing.simulated_s / r.timing.wall_s for r in records),
        head_on=rule(records, lambda encounter: encounter.kind == "head_on"),
        give_way=rule(records, lambda encounter: encounter.kind == "give_way"),
    )


def rule(records: Iterable[EpisodeRecord], chosen: Callable[[EncounterRecord], bool]) -> Rule:
    """Count how a rule was kept in the chosen encounters."""
    encounters = [e for record in records for e in record.encounters if chosen(e)]
    deviations = [e for e in encounters if not e.acted]
    gained = [e.gap_m - e.rule_gap_m for e in deviations]
    return Rule(
        encounters=len(encounters),
        acted=len(encounters) - len(deviations),
        touched=sum(e.touched for e in encounters),
        deviated=len(deviations),
        safer=sum(gain > 0.0 for gain in gained),
        gained_m=median(gained) if gained else math.nan,
    )


def _mean(values: Iterable[float]) -> float:
    several = list(values)
    return fmean(several) if several else math.nan
