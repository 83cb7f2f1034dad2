"""Which fault comes when: drawn from the shipped ones, one after the other, for hours."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from msgspec.structs import replace
from numpy.random import Generator

from twinscrew.hil_sim.faults.plan import Fault, FaultPlan
from twinscrew.hil_sim.faults.timeline import Span


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


def comes_to_an_end(plan: FaultPlan) -> bool:
    """Tell whether the boat sails again afterwards: a pilot who keeps it would end the soak."""
    return plan.promise is None or not plan.promise.rests


def fits_under_way(plan: FaultPlan) -> bool:
    """Tell whether it can happen at any time: what is there at once belongs to the beginning."""
    return min(fault.at_s for fault in plan.fault) > 0.0


def _later(fault: Fault, by_s: float) -> Fault:
    return replace(fault, at_s=fault.at_s + by_s)
