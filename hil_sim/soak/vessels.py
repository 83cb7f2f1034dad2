"""One vessel of a soak: its patrol, the faults that come at random, and their verdicts."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np
from msgspec.structs import replace
from numpy.random import Generator

from twinscrew.hil_sim.drivers.processes import LOG_FILE
from twinscrew.hil_sim.faults.crew import FaultyCrew
from twinscrew.hil_sim.faults.plan import Fault, FaultPlan
from twinscrew.hil_sim.faults.timeline import Span
from twinscrew.hil_sim.faults.verdict import Verdict, judge
from twinscrew.hil_sim.faults.witness import Witness
from twinscrew.hil_sim.soak.limits import Sample, within
from twinscrew.hil_sim.world import World
from twinscrew.runtime.messages.types import Float64


@dataclass(frozen=True, slots=True, kw_only=True)
class Scheduled:
    """One shipped fault, at its time."""

    plan: FaultPlan
    """Its times count from the soak's beginning."""

    @property
    def begin_s(self) -> float:
        """[s] When its first fault begins."""
        return min(fault.at_s for fault in self.plan.fault)


def draw(
    plans: Sequence[FaultPlan], duration_s: float, pause_s: tuple[float, float], rng: Generator
) -> list[Scheduled]:
    """Draw faults for one vessel until the time is over.

    Parameters
    ----------
    plans
        What to draw from.
    duration_s
        [s] The soak; the last fault has settled by then.
    pause_s
        [s] Between one that has settled and the next, at least and at most.
    """
    drawn: list[Scheduled] = []
    at_s = rng.uniform(*pause_s)
    while True:
        plan = plans[int(rng.integers(len(plans)))]
        first_s = min(fault.at_s for fault in plan.fault)
        shifted = tuple(_later(fault, at_s - first_s) for fault in plan.fault)
        scheduled = Scheduled(plan=replace(plan, fault=shifted))
        at_s = scheduled.plan.end_s + plan.settle_s
        if at_s > duration_s:
            return drawn
        drawn.append(scheduled)
        at_s += rng.uniform(*pause_s)


def joined(scheduled: Sequence[Scheduled]) -> FaultPlan:
    """Give all of them as one plan."""
    faults = tuple(fault for one in scheduled for fault in one.plan.fault)
    return FaultPlan(fault=faults, name="soak")


def waits(scheduled: Sequence[Scheduled]) -> list[Span]:
    """Give when a vessel waits for a goal that one of its faults gives itself, as an operator."""
    return [
        Span(one.begin_s, max(fault.at_s for fault in goals))
        for one in scheduled
        if (goals := [fault for fault in one.plan.fault if fault.kind == "goal"])
    ]


def spares_the_runtime(plan: FaultPlan) -> bool:
    """Tell whether a plan lets the runtime's process live."""
    return not any(f.kind == "kill" and f.target == "runtime" for f in plan.fault)


def needs_ais(plan: FaultPlan) -> bool:
    """Tell whether a plan is about AIS, which the soak's vessels do not have."""
    return any(fault.target == "nmea" for fault in plan.fault)


def comes_to_an_end(plan: FaultPlan) -> bool:
    """Tell whether the boat sails again afterwards: a pilot who keeps it would end the soak."""
    return plan.promise is None or not plan.promise.rests


def fits_under_way(plan: FaultPlan) -> bool:
    """Tell whether it can happen at any time: what is there at once belongs to the beginning."""
    return min(fault.at_s for fault in plan.fault) > 0.0


def _later(fault: Fault, by_s: float) -> Fault:
    return replace(fault, at_s=fault.at_s + by_s)


# -- Where a soak sails: to and fro in a lane of its own, as long as it takes.

TURN_M = 12.0
"""[m] So near the end of its lane a vessel is sent back: before it has arrived, and stopped."""
AGAIN_S = 15.0
"""[s] A goal is given again after this: a fault may have swallowed it, and the boat would rest."""


class Patrol:
    """Sends every vessel to the other end of its lane when it comes near one, and says so again."""

    def __init__(self, world: World, waits: Sequence[Sequence[Span]] = ()) -> None:
        """Begin.

        Parameters
        ----------
        waits
            When each vessel is given no goal, [s] since somebody first asked for one: another
            gives it then, and the boat is to wait for him.
        """
        self._world = world
        self._waits = waits or [()] * world.scenario.vessels
        self._begin_s: float | None = None
        self.turns = [0] * world.scenario.vessels
        """[-] How often each vessel was sent back."""
        self._said_s = [world.time_s] * world.scenario.vessels

    def goal_of(self, vessel: int) -> Float64 | None:
        """Give a goal that a vessel is to be sent to now, (2,) [m] [N]; None if it is none."""
        if self._is_to_wait(vessel):
            return None
        if np.hypot(*(self._world.state.position_N[vessel, :2] - self._goal(vessel))) <= TURN_M:
            self.turns[vessel] += 1
        elif self._world.time_s - self._said_s[vessel] < AGAIN_S:
            return None
        self._said_s[vessel] = self._world.time_s
        return self._goal(vessel)

    def _is_to_wait(self, vessel: int) -> bool:
        if self._begin_s is None:
            self._begin_s = self._world.time_s
        since_s = self._world.time_s - self._begin_s
        return any(span.holds(since_s) for span in self._waits[vessel])

    def _goal(self, vessel: int) -> Float64:
        goal_N: Float64 = self.ends(vessel)[(self.turns[vessel] + 1) % 2]
        return goal_N

    def ends(self, vessel: int) -> Float64:
        """Give both ends of a lane, (2, 2) [m] [N]: where it starts, and where it goes first."""
        scenario = self._world.scenario
        return np.array([scenario.starts[vessel, :2], scenario.goals[vessel]])


# -- What became of one vessel in a soak, and of each fault that was made at it.

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
