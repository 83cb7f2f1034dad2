"""Puts a crew with faults together, and judges it when the voyage is over."""

from __future__ import annotations

from functools import partial
from pathlib import Path

from msgspec.structs import replace

from twinscrew.hil_sim.drivers.processes import LOG_FILE
from twinscrew.hil_sim.drivers.realtime import RealtimeCrew
from twinscrew.hil_sim.faults.crew import FaultyCrew
from twinscrew.hil_sim.faults.plan import EVERY_VESSEL, Fault, FaultPlan
from twinscrew.hil_sim.faults.rig import Rig, fleet_of
from twinscrew.hil_sim.faults.verdict import Verdict, judge
from twinscrew.hil_sim.world import World
from twinscrew.runtime.vessel.config import RuntimeConfig


def faulty_crew(
    world: World,
    configs: list[RuntimeConfig],
    folders: list[Path],
    plans: list[FaultPlan],
    seed: int,
) -> FaultyCrew:
    """Make the crew of a world in real time, one plan a vessel.

    Parameters
    ----------
    configs, folders
        As `RealtimeCrew` takes them.
    seed
        What messages' fates are drawn from.
    """
    rigs = [
        Rig(
            vessel,
            config.autopilot.system_id,
            lambda: world.time_s,
            partial(world.push, vessel),
            by_topic=config.autopilot.kind == "thrust",
        )
        for vessel, config in enumerate(configs)
    ]

    def reroute(vessel: int, port: int) -> int:
        cut = any(fault.kind == "cut" for fault in plans[vessel].fault)
        return rigs[vessel].reroute(port) if cut else port

    crew = RealtimeCrew(configs, folders, fleet_of(rigs), reroute=reroute)
    return FaultyCrew(crew, rigs, plans, seed)


def verdicts(crew: FaultyCrew, plans: list[FaultPlan], folders: list[Path]) -> dict[str, Verdict]:
    """Judge, by the names of their folders, the vessels that faults were made at and promised."""
    found = {}
    for vessel, (plan, folder) in enumerate(zip(plans, folders, strict=True)):
        made = [made for made in crew.made if made.vessel == vessel]
        if plan.promise is None or not made:
            continue
        log = (folder / LOG_FILE).read_text(errors="replace")
        witness = crew.witnesses[vessel]
        found[folder.name] = judge(
            plan.name, plan.promise, made, witness, now_s=crew.ended_s, log=log
        )
    return found


def plans_by_vessel(plan: FaultPlan, names: tuple[str, ...]) -> list[FaultPlan]:
    """Give each vessel the faults that are for it; the machine's are the first vessel's."""

    def is_for(fault: Fault, name: str) -> bool:
        if fault.target == "machine":
            return name == names[0]
        return fault.vessel in (name, EVERY_VESSEL)

    return [
        replace(plan, fault=tuple(fault for fault in plan.fault if is_for(fault, name)))
        for name in names
    ]
