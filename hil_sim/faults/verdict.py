"""What was promised, and what a witness saw."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from twinscrew.hil_sim.faults.crew import Made
from twinscrew.hil_sim.faults.kinds import AT_ONCE
from twinscrew.hil_sim.faults.plan import Promise
from twinscrew.hil_sim.faults.witness import Witness

APART_S = 0.1
"""[s] What happens within this is one thing."""
LAG_S = 0.3
"""[s] A decision is seen at the propellers so much later at the most, or they where it is not."""
PAUSE_S = 1.0
"""[s] A boat that sails on, with nothing in its way, may decide to rest for as long."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Measured:
    """What became of one promise, in words and seconds."""

    what: str
    """As "neutral", "event lidar_stale"."""
    promised: str
    measured: str
    kept: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class Verdict:
    """How one file of faults went."""

    name: str
    fault: str
    reaction: str
    rows: tuple[Measured, ...]

    @property
    def kept(self) -> bool:
        """Whether every promise was kept."""
        return all(row.kept for row in self.rows)

    def as_dict(self) -> dict[str, Any]:
        """Give it for JSON."""
        rows = [
            {"what": r.what, "promised": r.promised, "measured": r.measured, "kept": r.kept}
            for r in self.rows
        ]
        return {"fault": self.fault, "reaction": self.reaction, "kept": self.kept, "rows": rows}


def judge(
    name: str,
    promise: Promise,
    made: list[Made],
    witness: Witness,
    *,
    now_s: float,
    log: str,
    free_way: bool = True,
) -> Verdict:
    """Hold what was seen against what was promised.

    Parameters
    ----------
    made
        The vessel's faults, as they were made.
    now_s
        [s] When the witness stopped looking.
    log
        What the runtime said on standard error: a traceback there breaks every promise.
    free_way
        Whether nothing but the fault can be why the boat decides to rest. Elsewhere it may rest
        as it likes: at a goal, or before what is in its way.
    """
    begin_s = min(fault.begin_s for fault in made)
    first_end_s = min(fault.end_s for fault in made)
    end_s = max(fault.end_s for fault in made)
    acts_s = [m.begin_s for m in made if m.fault.kind in AT_ONCE and m.begin_s > begin_s + APART_S]
    if acts_s:  # the boat waits for somebody
        first_end_s = min(acts_s)
    elif first_end_s - begin_s < APART_S:  # a pilot's act, and nobody takes it back
        first_end_s = now_s
    still_until_s = end_s if promise.neutral_until == "last" else first_end_s
    rows = [
        *_neutral(promise, witness, begin_s, still_until_s),
        *_event(promise, witness, begin_s, first_end_s),
        *_state(promise, witness, begin_s, first_end_s),
        *_moves_again(promise, witness, end_s),
        *_steady(promise, witness, end_s, now_s),
        *_sails_on(promise, witness, begin_s, now_s, free_way=free_way),
        *_rests(promise, witness, end_s, now_s),
        *_bridge(promise, witness),
        _no_traceback(log),
    ]
    return Verdict(name=name, fault=promise.fault, reaction=promise.reaction, rows=tuple(rows))


def _neutral(promise: Promise, witness: Witness, begin_s: float, end_s: float) -> list[Measured]:
    if promise.neutral_s is None:
        return []
    if not witness.turning(begin_s):
        return [Measured(what="neutral", promised="", measured="never turned", kept=False)]
    rests = witness.rests(begin_s, end_s)
    still_s = rests[-1].begin_s if rests and rests[-1].end_s == end_s else None
    return [_within("neutral", still_s, begin_s, promise.neutral_s)]


def _event(promise: Promise, witness: Witness, begin_s: float, end_s: float) -> list[Measured]:
    if promise.event is None:
        return []
    heard_s = witness.heard(promise.event, begin_s, promise.event_says)
    if promise.event_from == "fault":
        return [_within(promise.event, heard_s, begin_s, promise.event_s)]
    until_s = end_s if heard_s is None else min(heard_s, end_s)
    longest_s = max((span.length_s for span in witness.asked(begin_s, until_s)), default=0.0)
    kept = longest_s <= promise.event_s
    late = "no thrust to follow" if kept else "never"
    words = late if heard_s is None else f"{longest_s:.2f} s"
    promised = f"{promise.event_s:g} s of thrust"
    return [Measured(what=promise.event, promised=promised, measured=words, kept=kept)]


def _state(promise: Promise, witness: Witness, begin_s: float, end_s: float) -> list[Measured]:
    if promise.state is None:
        return []
    seen = witness.states(begin_s, end_s)
    words = ", ".join(sorted(seen))
    kept = promise.state in seen
    return [Measured(what="state", promised=promise.state, measured=words, kept=kept)]


def _moves_again(promise: Promise, witness: Witness, end_s: float) -> list[Measured]:
    if promise.moves_again_s is None:
        return []
    return [_within("turns again", witness.sails_from(end_s), end_s, promise.moves_again_s)]


def _steady(promise: Promise, witness: Witness, end_s: float, now_s: float) -> list[Measured]:
    if not promise.steady:
        return []
    from_s = end_s + (promise.moves_again_s or 0.0)
    stops = [span for span in witness.stops(from_s, now_s) if span.length_s > LAG_S]
    words = f"{len(stops)} stops" if stops else "did"
    return [Measured(what="steady", promised="to the end", measured=words, kept=not stops)]


def _sails_on(
    promise: Promise, witness: Witness, begin_s: float, now_s: float, *, free_way: bool
) -> list[Measured]:
    if not promise.sails_on:
        return []
    stops = [span for span in witness.stops(begin_s, now_s) if span.length_s > LAG_S]
    rests = [span for span in witness.rests(begin_s, now_s) if span.length_s > PAUSE_S]
    long = sorted([*stops, *rests] if free_way else stops)
    safe = "safe" in witness.states(begin_s, now_s)
    words = (
        f"stopped after {long[0].begin_s - begin_s:.2f} s" if long else "safe" if safe else "did"
    )
    return [
        Measured(what="sails on", promised="always", measured=words, kept=not long and not safe)
    ]


def _rests(promise: Promise, witness: Witness, end_s: float, now_s: float) -> list[Measured]:
    if not promise.rests:
        return []
    rests = witness.rests(end_s + 1.0, now_s)
    kept = rests == [(end_s + 1.0, now_s)]
    words = "did" if kept else "turned"
    return [Measured(what="rests", promised="to the end", measured=words, kept=kept)]


def _bridge(promise: Promise, witness: Witness) -> list[Measured]:
    bridge, rows = witness.bridge.last, []
    if promise.mode is not None:
        kept = bridge.mode == promise.mode
        rows.append(Measured(what="mode", promised=promise.mode, measured=bridge.mode, kept=kept))
    if promise.armed is not None:
        words = {True: "armed", False: "disarmed"}
        kept = bridge.armed == promise.armed
        promised, measured = words[promise.armed], words[bridge.armed]
        rows.append(Measured(what="arming", promised=promised, measured=measured, kept=kept))
    return rows


def _no_traceback(log: str) -> Measured:
    found = "Traceback" in log or "panicked" in log
    words = "some" if found else "none"
    return Measured(what="unhandled exceptions", promised="none", measured=words, kept=not found)


def _within(what: str, at_s: float | None, since_s: float, limit_s: float) -> Measured:
    took_s = math.inf if at_s is None else at_s - since_s
    words = "never" if at_s is None else f"{took_s:.2f} s"
    return Measured(what=what, promised=f"{limit_s:g} s", measured=words, kept=took_s <= limit_s)
