"""Two judges on the same episodes: what each says, how far they agree, and where they differ.

The judges find their encounters themselves. Two findings are of one encounter if they are about the
same two vessels and overlap in time; they agree if they give the vessel the same role and say alike
whether it did what that role asks. What only one of them finds is a disagreement.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from typing import Any, NamedTuple

import msgspec

from twinscrew.hil_sim.experiments.episode import sail_episode
from twinscrew.hil_sim.experiments.plan import check
from twinscrew.hil_sim.experiments.results import (
    EXPERIMENT_FILE,
    RESULTS_FILE,
    read_folder,
    read_results,
    read_tracks_of,
)
from twinscrew.hil_sim.experiments.runner import task_of
from twinscrew.hil_sim.experiments.summary import wilson
from twinscrew.hil_sim.rules import geometric, temporal
from twinscrew.hil_sim.rules.evidence import (
    RULES,
    TRACKS_FILE,
    Finding,
    Role,
    Tracks,
    boat_tracks,
    read_tracks,
)
from twinscrew.runtime.errors import ConfigError, RecordingError, one_of
from twinscrew.runtime.recording.recording import find_recordings

SOURCES = ("auto", "truth", "boat")
RULE_WORDS = {13: "overtaking", 14: "head-on", 15: "give way", 17: "stand on"}
ROLES: dict[int, Role] = {rule: role for role, rule in RULES.items()}


class Case(NamedTuple):
    """An episode to judge."""

    method: str
    """Who sailed: a method of an experiment; empty for a run."""
    name: str
    """What people find it by: a line of the results, a run's folder, a boat's recording."""
    tracks: Tracks


@dataclass(frozen=True, slots=True)
class Encounter:
    """What both judges say of one vessel's part in a meeting; None from who does not see it."""

    case: Case
    a: Finding | None
    b: Finding | None

    @property
    def one(self) -> Finding:
        """Judge A's finding, or else B's."""
        found = self.a or self.b
        if found is None:
            raise ValueError("an encounter that nobody saw")
        return found

    @property
    def agreed(self) -> bool:
        """Whether the two judges say the same."""
        a, b = self.a, self.b
        return a is not None and b is not None and (a.role, a.kept) == (b.role, b.kept)

    @property
    def difference(self) -> str:
        """Why the judges differ, in words; empty where they agree."""
        a, b = self.a, self.b
        if self.agreed:
            return ""
        if a is None or b is None:
            seen, by = (b, "B") if a is None else (a, "A")
            words = RULE_WORDS[self.one.rule] if seen else ""
            return (
                f"only {by} sees a risk of collision ({words}, closest {self.one.closest_m:.1f} m "
                f"at {self.one.nearest_s:.1f} s)"
            )
        if a.role != b.role:
            return (
                f"A by courses over ground: {RULE_WORDS[a.rule]}, "
                f"B by headings: {RULE_WORDS[b.rule]}"
            )
        return f"A: {a.why or 'kept'}; B: {b.why or 'kept'}"


def gather(path: Path, source: str = "auto") -> Iterator[Case]:
    """Give the episodes of an experiment's folder, of a run's folder, or of recordings.

    Parameters
    ----------
    path
        What `experiment`, `sitl` or a boat left behind.
    source
        `truth`: what the simulator knew; `boat`: what each boat's recording says of itself and its
        tracks; `auto`: the truth where there is one.

    Raises
    ------
    ConfigError
        No such source, or no such folder.
    RecordingError
        Nothing there can be judged, or it is damaged.
    PolicyError
        An episode without tracks cannot be sailed again: its policy has changed.
    """
    if source not in SOURCES:
        raise ConfigError(one_of(source, SOURCES), key="--tracks")
    if not path.exists():
        raise ConfigError("no such file or folder", file=path)
    if (path / EXPERIMENT_FILE).is_file():
        if source == "boat":
            raise ConfigError(
                "an experiment keeps no recordings; sail an episode again with "
                f"`experiment --rerun {path}:LINE --out NEW`, then judge NEW",
                key="--tracks",
            )
        yield from _of_experiment(path)
    elif source != "boat" and (path / TRACKS_FILE).is_file():
        yield Case("", path.name, read_tracks(path / TRACKS_FILE))
    elif source == "truth":
        raise RecordingError(f"{path}: holds no {TRACKS_FILE}: nobody knows the truth of it")
    else:
        for recording in find_recordings(path):
            yield Case("", recording.vessel, boat_tracks(recording))


def _of_experiment(path: Path) -> Iterator[Case]:
    experiment = read_folder(path).experiment
    kept = read_tracks_of(path)
    for line, record in enumerate(read_results(path / RESULTS_FILE), start=1):
        tracks = kept.get(record.key)
        if tracks is None:
            task = task_of(experiment, record)
            check(task.method)
            tracks = sail_episode(task).tracks
        name = f"{record.method}, {record.set}, {record.variant}, {record.episode} (line {line})"
        yield Case(record.method, name, tracks)


def compare(cases: Iterable[Case]) -> list[Encounter]:
    """Let both judges look at every episode; a `ConfigError` if the second is not installed."""
    return [
        encounter
        for case in cases
        for encounter in matched(case, geometric.judge(case.tracks), temporal.judge(case.tracks))
    ]


def matched(case: Case, first: Sequence[Finding], second: Sequence[Finding]) -> list[Encounter]:
    """Put findings of the same meeting together, in the order of their beginnings."""
    left = list(second)
    found = []
    for a in first:
        there = [
            b
            for b in left
            if (a.ego, a.other) == (b.ego, b.other)
            and a.begin_s <= b.end_s
            and b.begin_s <= a.end_s
        ]
        b = there[0] if there else None
        if b is not None:
            left.remove(b)
        found.append(Encounter(case, a, b))
    found += [Encounter(case, None, b) for b in left]
    return sorted(found, key=lambda one: (one.one.begin_s, one.one.ego, one.one.other))


# -- What is printed.


def answer(encounters: Sequence[Encounter], episodes: int) -> dict[str, Any]:
    """Give what `twinscrew judge --json` prints; its keys are fixed, others script it."""
    methods = list(dict.fromkeys(one.case.method for one in encounters))
    by_rule = {
        str(rule): _share([one.agreed for one in encounters if one.one.rule == rule])
        for rule in RULE_WORDS
    }
    eights = [
        one.a.readable == one.b.readable
        for one in encounters
        if one.a and one.b and None not in (one.a.readable, one.b.readable)
    ]
    return {
        "episodes": episodes,
        "encounters": len(encounters),
        "agreement": {
            "overall": _share([one.agreed for one in encounters]),
            "by_rule": {"8": _share(eights), **by_rule},
        },
        "verdicts": [row for name in methods for row in verdicts(name, encounters)],
        "differences": [
            {"episode": one.case.name, **_who(one), "reason": one.difference}
            for one in encounters
            if not one.agreed
        ],
        "findings": [
            {
                "episode": one.case.name,
                **_who(one),
                "a": msgspec.to_builtins(one.a),
                "b": msgspec.to_builtins(one.b),
                "agreed": one.agreed,
            }
            for one in encounters
        ],
    }


def verdicts(method: str, encounters: Sequence[Encounter]) -> Iterator[dict[str, Any]]:
    """Give a row a rule: how a method's vessels kept it, by either judge."""
    own = [one for one in encounters if one.case.method == method]
    for rule, words in RULE_WORDS.items():
        a = [one.a for one in own if one.a and one.a.rule == rule]
        b = [one.b for one in own if one.b and one.b.rule == rule]
        if not a and not b:
            continue
        before = [one.altered_before_s for one in a if one.altered_before_s is not None]
        turns = [abs(one.altered_deg) for one in a if one.altered_deg]
        yield {
            "method": method,
            "rule": rule,
            "words": words,
            "a": _share([one.kept for one in a]),
            "a_where_possible": _share([one.kept for one in a if one.possible]),
            "b": _share([one.kept for one in b]),
            "contacts": sum(one.contact for one in a),
            "rule_8": _share([one.readable for one in a if one.readable is not None]),
            "first_alteration_deg": round(median(turns), 1) if turns else None,
            "first_alteration_before_s": round(median(before), 2) if before else None,
            "closest_m": round(median(one.closest_m for one in a), 2) if a else None,
        }


def _share(flags: Sequence[bool]) -> dict[str, Any]:
    """Give a share with its count and Wilson's 95 % interval."""
    low, high = wilson(sum(flags), len(flags))
    return {
        "count": sum(flags),
        "of": len(flags),
        "rate": round(sum(flags) / len(flags), 4) if flags else None,
        "wilson95": [round(low, 4), round(high, 4)],
    }


def _who(one: Encounter) -> dict[str, Any]:
    names = [body.name for body in one.case.tracks.bodies]
    return {
        "vessel": names[one.one.ego],
        "other": names[one.one.other],
        "rule": one.one.rule,
        "begin_s": one.one.begin_s,
    }
