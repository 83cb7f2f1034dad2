"""What became of one vessel in a soak, and of each fault that was made at it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

from msgspec.structs import replace

from twinscrew.hil_sim.drivers.runtime_process import LOG_FILE
from twinscrew.hil_sim.faults.crew import FaultyCrew
from twinscrew.hil_sim.faults.timeline import Span
from twinscrew.hil_sim.faults.verdict import Verdict, judge
from twinscrew.hil_sim.faults.witness import Witness
from twinscrew.hil_sim.soak.samples import Sample
from twinscrew.hil_sim.soak.schedule import Scheduled
from twinscrew.hil_sim.soak.standstill import within

AFTERMATH_S = 3.0
"""[s] After a fault that a late decision may still be its doing."""
HEARD_S = 0.3
"""[s] So long before a late decision is heard of the machine may have held it up."""
STOOD_STILL_S = 0.05
"""[s] A machine that stood still for longer is no clock to hold promises against."""


class Judged(NamedTuple):
    """One fault that was made."""

    at_s: float
    """[s] Since the goals were given."""
    verdict: Verdict
    excuse: str
    """Why it is not judged; empty if it is."""


class Missed(NamedTuple):
    """Decisions and ticks that were late, by whose doing."""

    own: int
    in_faults: int
    """While one acted on the vessel, or a moment later."""
    in_standstills: int
    """While the machine stood still, and no fault acted."""


@dataclass(frozen=True, slots=True, kw_only=True)
class VesselSoak:
    """What happened to one vessel."""

    name: str
    samples: tuple[Sample, ...]
    """Of its runtime's process, or processes."""
    faults: tuple[Judged, ...]
    """In order."""
    decisions: int
    """While the witness listened."""
    missed: Missed
    log: str
    recording_mb: float
    turns: int
    """How often it came to the end of its lane."""

    @property
    def verdicts(self) -> list[Verdict]:
        """On the faults that are judged."""
        return [judged.verdict for judged in self.faults if not judged.excuse]


def look_back(
    crew: FaultyCrew,
    vessel: int,
    schedule: list[Scheduled],
    standstills: list[Span],
    folder: Path,
    samples: list[Sample],
    turns: int,
) -> VesselSoak:
    """Gather what happened to a vessel, when the soak is over."""
    recorded = sum(path.stat().st_size for path in folder.rglob("*.mcap"))
    return VesselSoak(
        name=folder.name,
        samples=tuple(samples),
        faults=tuple(_judged(crew, vessel, schedule, standstills)),
        decisions=len(crew.witnesses[vessel].decided),
        missed=_missed(crew, vessel, standstills),
        log=(folder / LOG_FILE).read_text(errors="replace"),
        recording_mb=recorded / 1e6,
        turns=turns,
    )


def excuse(verdict: Verdict, witness: Witness, held_up_s: float, begin_s: float) -> str:
    """Say why a verdict says nothing about the boat; empty if it does.

    Parameters
    ----------
    held_up_s
        [s] How long the machine stood still meanwhile.
    begin_s
        [s] When the fault began, by the witness's clock.
    """
    if not witness.under_way(begin_s):
        return "not under way when it began"
    if not verdict.kept and held_up_s > STOOD_STILL_S:
        return f"the machine stood still for {held_up_s:.2f} s"
    return ""


def _missed(crew: FaultyCrew, vessel: int, standstills: list[Span]) -> Missed:
    told = crew.witnesses[vessel].events
    late_s = [t for t, event in told if event.name == "overrun" and t <= crew.ended_s]
    faults = [
        Span(made.begin_s, made.end_s + AFTERMATH_S)
        for made in crew.made
        if made.vessel == vessel or made.fault.target == "machine"
    ]
    others = [t for t in late_s if not any(span.holds(t) for span in faults)]
    own = [t for t in others if within(standstills, t - HEARD_S, t) == 0.0]
    return Missed(len(own), len(late_s) - len(others), len(others) - len(own))


def _judged(
    crew: FaultyCrew, vessel: int, schedule: list[Scheduled], standstills: list[Span]
) -> Iterator[Judged]:
    witness = crew.witnesses[vessel]
    for scheduled in schedule:
        plan = scheduled.plan
        made = [m for m in crew.made if m.vessel == vessel and m.fault in plan.fault]
        if plan.promise is None or len(made) < len(plan.fault):
            continue
        promise = replace(plan.promise, mode=None, armed=None)  # others change them later
        begin_s = min(m.begin_s for m in made)
        until_s = max(m.end_s for m in made) + plan.settle_s
        found = judge(plan.name, promise, made, witness, now_s=until_s, log="", free_way=False)
        held_up_s = within(standstills, begin_s, until_s)
        yield Judged(scheduled.begin_s, found, excuse(found, witness, held_up_s, begin_s))
