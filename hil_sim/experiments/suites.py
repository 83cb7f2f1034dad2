"""Suites: named sets of episodes, what is counted of them, and what is aimed at.

`twinscrew experiment --suite NAME` sails one; its figures are in the JSON answer and in a section
of the report. A new suite is a line in `SUITES`: sets that say how scenarios are drawn (a
scenario's name, or SERIES:CASE), and a function from episodes to figures.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from twinscrew.hil_sim.experiments.plan import SetSettings, Switches
from twinscrew.hil_sim.experiments.results import EpisodeRecord
from twinscrew.hil_sim.experiments.summary import percentiles, wilson
from twinscrew.runtime.errors import ConfigError, one_of

Figures = dict[str, Any]
"""By name: numbers; [low, high] intervals; or tables, dictionaries of numbers by row."""
Count = Callable[[Sequence[EpisodeRecord]], Figures]


@dataclass(frozen=True, slots=True, kw_only=True)
class Aim:
    """What a figure is to be."""

    figure: str
    """Its name in the figures."""
    least: float = -math.inf
    most: float = math.inf
    sets: tuple[str, ...] = ()
    """The sets it is meant for; none: all."""

    @property
    def words(self) -> str:
        """As "arrived_rate at least 0.995"."""
        ends = [(self.least, "at least"), (self.most, "at most")]
        told = [f"{word} {end:g}" for end, word in ends if math.isfinite(end)]
        return f"{self.figure} {' and '.join(told)}"


@dataclass(frozen=True, slots=True, kw_only=True)
class Suite:
    """Episodes that answer one question."""

    about: str
    """The question, as a report's sentence."""
    sets: tuple[SetSettings, ...]
    count: Count
    """From the episodes of one method, set and variant to their figures."""
    aims: tuple[Aim, ...] = ()
    episodes: int = 100
    """[-] A set, unless asked for otherwise."""
    methods: str = "ac_iqn"
    """What sails, unless asked for otherwise."""
    base: Switches = ()
    """Switches that hold throughout, unless asked for otherwise."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Counted:
    """The figures of one method, set and variant."""

    method: str
    set: str
    variant: str
    figures: Figures
    aims: dict[str, bool]
    """By an aim's words: whether it is reached."""

    def record(self) -> dict[str, Any]:
        """Give what `experiment --json` prints of it."""
        return {
            "method": self.method,
            "set": self.set,
            "variant": self.variant,
            **self.figures,
            "aims": self.aims,
        }


def arrivals(records: Sequence[EpisodeRecord]) -> Figures:
    """Count vessels: who arrived, in what time, who touched what; by kind where there are kinds.

    Contacts and fences count vessels: two that touch each other are two.
    """
    vessels = [vessel for record in records for vessel in record.vessels]
    arrived = [vessel for vessel in vessels if vessel.outcome == "goal"]
    times = [vessel.travel_time_s for vessel in arrived]
    half, most = percentiles(times, (50, 95))
    touched = [vessel.touched for vessel in vessels if vessel.outcome == "collision"]
    kinds = dict.fromkeys(record.kind for record in records if record.kind)
    figures: Figures = {
        "episodes": len(records),
        "all_arrived_rate": _rate(sum(record.success for record in records), len(records)),
        "vessels": len(vessels),
        "arrived": len(arrived),
        "arrived_rate": _rate(len(arrived), len(vessels)),
        "arrived_95": [round(end, 4) for end in wilson(len(arrived), len(vessels))],
        "travel_time_s": _rounded(half),
        "travel_time_p95_s": _rounded(most),
        "contacts": len(touched),
        "contacts_with": {
            name: sum(what in kind for what in touched)
            for name, kind in (
                ("vessel", ("vessel", "traffic")),
                ("buoy", ("buoy",)),
                ("quay", ("quay",)),
            )
        },
        "fence_entries": sum(vessel.outcome == "fence" for vessel in vessels),
        "out_of_time": sum(vessel.outcome == "timeout" for vessel in vessels),
        "greatest_current_mps": max((v.greatest_current_mps for v in vessels), default=0.0),
    }
    if len(kinds) > 1:
        figures["by_kind"] = {kind: _of_kind(records, kind) for kind in sorted(kinds)}
    return figures


def _of_kind(records: Sequence[EpisodeRecord], kind: str) -> dict[str, Any]:
    vessels = [v for record in records if record.kind == kind for v in record.vessels]
    arrived = sum(vessel.outcome == "goal" for vessel in vessels)
    return {
        "vessels": len(vessels),
        "arrived_rate": _rate(arrived, len(vessels)),
        "contacts": sum(vessel.outcome == "collision" for vessel in vessels),
        "fence_entries": sum(vessel.outcome == "fence" for vessel in vessels),
        "out_of_time": sum(vessel.outcome == "timeout" for vessel in vessels),
    }


def _rate(part: int, whole: int) -> float:
    return round(part / whole, 4) if whole else math.nan


def _rounded(value: float) -> float | None:
    return None if math.isnan(value) else round(value, 2)


NO_CONTACT = Aim(figure="contacts", most=0)

MEETING_METHODS = "ac_iqn,mpc,orca,apf"
"""The shipped policy, and what people would use instead."""

SUITES: Mapping[str, Suite] = {
    "imazu": Suite(
        about="Does a vessel pass Imazu's 22 encounters, at 8 lengths of the default vessel to the "
        "point where all would meet, among others that hold course and speed?",
        sets=(SetSettings(name="imazu", cases=tuple(f"imazu:{k}" for k in range(1, 23))),),
        count=arrivals,
        aims=(Aim(figure="arrived_rate", least=1.0), NO_CONTACT),
        episodes=22,
        methods=MEETING_METHODS,
    ),
    "dnv": Suite(
        about="Does a vessel pass the 55 base situations of DNV's trafficgen, scaled so that the "
        "way of 15 minutes there is 8 lengths of the default vessel, among others that hold course "
        "and speed?",
        sets=(SetSettings(name="dnv", cases=tuple(f"dnv:{k}" for k in range(1, 56))),),
        count=arrivals,
        aims=(Aim(figure="arrived_rate", least=1.0), NO_CONTACT),
        episodes=55,
        methods=MEETING_METHODS,
    ),
    "traffic": Suite(
        about="Does a vessel arrive among others that hold course and speed, drawn as `evaluate "
        "--traffic` draws them?",
        sets=tuple(
            SetSettings(name=name, scenario=f"traffic:{name}")
            for name in ("slow", "fast", "large", "anchored")
        ),
        count=arrivals,
        aims=(
            Aim(figure="arrived_rate", least=0.995, sets=("slow",)),
            Aim(figure="arrived_rate", least=0.985, sets=("fast",)),
            Aim(figure="arrived_rate", least=0.99, sets=("large",)),
            Aim(figure="arrived_rate", least=1.0, sets=("anchored",)),
        ),
        methods=MEETING_METHODS,
    ),
    "harbours": Suite(
        about="Do three vessels arrive in harbours drawn afresh, with quays, dead ends, finger "
        "piers, piles and gaps down to 1.6 beams?",
        sets=(SetSettings(name="harbours", scenario="harbour"),),
        count=arrivals,
        aims=(Aim(figure="arrived_rate", least=0.995), NO_CONTACT),
        episodes=500,
    ),
    "channels": Suite(
        about="Do vessels pass each other in channels?",
        sets=(SetSettings(name="channels", scenario="harbour:channel"),),
        count=arrivals,
        aims=(Aim(figure="arrived_rate", least=0.99), NO_CONTACT),
        episodes=500,
    ),
    "gap": Suite(
        about="Does a vessel sail through a gap of 14 m, and how fast?",
        sets=(SetSettings(name="gap of 14 m", scenario="gap"),),
        count=arrivals,
        aims=(
            Aim(figure="arrived_rate", least=1.0),
            Aim(figure="travel_time_p95_s", most=14.0),
            NO_CONTACT,
        ),
        episodes=20,
    ),
    "fences": Suite(
        about="Are fences and keep-out areas kept, which no sensor sees?",
        sets=(SetSettings(name="fences", scenario="fences"),),
        count=arrivals,
        aims=(
            Aim(figure="arrived_rate", least=0.99),
            Aim(figure="fence_entries", most=0),
            NO_CONTACT,
        ),
        episodes=1000,
    ),
    "currents": Suite(
        about="Do three vessels arrive in currents, steady, sheared, turning and tidal?",
        sets=(
            SetSettings(name="0.3 of the top speed", scenario="current:0.3"),
            SetSettings(name="0.5 of the top speed", scenario="current:0.5"),
        ),
        count=arrivals,
        aims=(
            Aim(figure="arrived_rate", least=0.995, sets=("0.3 of the top speed",)),
            Aim(figure="arrived_rate", least=0.98, sets=("0.5 of the top speed",)),
            NO_CONTACT,
        ),
        episodes=100,
    ),
}
"""Every suite by name."""


def find_suite(name: str) -> Suite:
    """Give a suite; a `ConfigError` names those that there are."""
    if name not in SUITES:
        raise ConfigError(one_of(name, tuple(SUITES)), key="--suite")
    return SUITES[name]


def counted(name: str, records: Sequence[EpisodeRecord]) -> Iterator[Counted]:
    """Give a suite's figures for each method, set and variant, as they first appear."""
    suite = find_suite(name)
    groups: dict[tuple[str, str, str], list[EpisodeRecord]] = {}
    for record in records:
        groups.setdefault((record.method, record.set, record.variant), []).append(record)
    for (method, set_name, variant), group in groups.items():
        figures = suite.count(group)
        aims = {
            aim.words: _reached(aim, figures)
            for aim in suite.aims
            if not aim.sets or set_name in aim.sets
        }
        yield Counted(method=method, set=set_name, variant=variant, figures=figures, aims=aims)


def _reached(aim: Aim, figures: Figures) -> bool:
    value = figures.get(aim.figure)
    return value is not None and aim.least <= value <= aim.most
