"""Sails a soak, and gathers what happened."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from msgspec.structs import replace

from twinscrew.hil_sim.drivers.punctual import punctual
from twinscrew.hil_sim.drivers.realtime import LOG_FILE
from twinscrew.hil_sim.drivers.voyage import Voyage
from twinscrew.hil_sim.faults.assemble import faulty_crew
from twinscrew.hil_sim.faults.crew import FaultyCrew
from twinscrew.hil_sim.faults.plan import FaultPlan, load_plan
from twinscrew.hil_sim.faults.trial import SENSOR, config_of
from twinscrew.hil_sim.faults.verdict import Verdict, judge
from twinscrew.hil_sim.faults.waters import lanes
from twinscrew.hil_sim.soak.patrol import Patrol
from twinscrew.hil_sim.soak.samples import Sample, sample
from twinscrew.hil_sim.soak.schedule import (
    Scheduled,
    comes_to_an_end,
    draw,
    fits_under_way,
    joined,
    spares_the_runtime,
)
from twinscrew.hil_sim.soak.settings import SoakSettings
from twinscrew.hil_sim.world import make_world
from twinscrew.runtime.app.config import RuntimeConfig
from twinscrew.runtime.app.recording_settings import RecordingSettings
from twinscrew.runtime.messages.types import Float64
from twinscrew.runtime.perception.sensor import load_sensor
from twinscrew.runtime.settings import CONFIG_DIR

AFTERMATH_S = 3.0
"""[s] After a fault that a late decision may still be its doing."""


@dataclass(frozen=True, slots=True, kw_only=True)
class VesselSoak:
    """What happened to one vessel."""

    name: str
    samples: tuple[Sample, ...]
    """Of its runtime's process, or processes."""
    verdicts: tuple[Verdict, ...]
    """On every fault, in order."""
    decisions: int
    """While the witness listened."""
    missed: int
    """Decisions that were late, and ticks, while no fault acted on it."""
    missed_in_faults: int
    log: str
    recording_mb: float
    turns: int
    """How often it came to the end of its lane."""


def soak(
    settings: SoakSettings,
    duration_s: float,
    seed: int,
    folder: Path,
    tell: Callable[[float], None],
) -> list[VesselSoak]:
    """Sail for a time, with faults drawn from a seed.

    Parameters
    ----------
    folder
        Where the vessels' logs and recordings go.
    tell
        Called with the time [s] since the beginning, at every sample.
    """
    scenario = lanes(settings.vessels, duration_s)
    world = make_world(scenario, sensor=SENSOR, seed=seed)
    streams = [
        np.random.default_rng(s) for s in np.random.SeedSequence(seed).spawn(len(scenario.names))
    ]
    schedules = [
        draw(plans_for(vessel), duration_s, settings.pause_s, rng)
        for vessel, rng in enumerate(streams)
    ]
    folders = [folder / name for name in scenario.names]
    configs = [_config(settings, name, i + 1, folders[i]) for i, name in enumerate(scenario.names)]
    patrol = Patrol(world)
    plans = [joined(schedule) for schedule in schedules]
    with punctual(), faulty_crew(world, configs, folders, plans, seed) as crew:
        crew.count_decisions()
        log = _Log(crew, settings.sample_s, tell)

        def goal_of(vessel: int) -> Float64 | None:
            log.look()
            return patrol.goal_of(vessel)

        voyage = Voyage(world, crew, scan_s=1.0 / load_sensor(SENSOR).rate_hz)
        voyage.patrol(duration_s, goal_of)
    return [
        _vessel(crew, log, vessel, name, schedules[vessel], folders[vessel], patrol.turns[vessel])
        for vessel, name in enumerate(scenario.names)
    ]


def plans_for(vessel: int) -> list[FaultPlan]:
    """Give the shipped faults that may happen to a vessel; only the first one's runtime dies."""
    names = sorted(path.stem for path in (CONFIG_DIR / "faults").glob("*.toml"))
    shipped = map(load_plan, names)
    plans = [plan for plan in shipped if comes_to_an_end(plan) and fits_under_way(plan)]
    return plans if vessel == 0 else [plan for plan in plans if spares_the_runtime(plan)]


class _Log:
    """Samples the runtimes' processes."""

    def __init__(self, crew: FaultyCrew, every_s: float, tell: Callable[[float], None]) -> None:
        self.samples: list[list[Sample]] = [[] for _ in crew.witnesses]
        self._crew, self._every_s, self._tell = crew, every_s, tell
        self._begin_s: float | None = None
        self._due_s = 0.0

    def look(self) -> None:
        """Sample, if it is time to."""
        now_s = time.monotonic()
        if self._begin_s is None:
            self._begin_s = now_s
        since_s = now_s - self._begin_s
        if since_s < self._due_s:
            return
        self._due_s = since_s + self._every_s
        for vessel, pid in enumerate(self._crew.pids):
            taken = sample(since_s, pid)
            if taken is not None:
                self.samples[vessel].append(taken)
        self._tell(since_s)


def _vessel(
    crew: FaultyCrew,
    log: _Log,
    vessel: int,
    name: str,
    schedule: list[Scheduled],
    folder: Path,
    turns: int,
) -> VesselSoak:
    told = crew.witnesses[vessel].events
    late_s = [t for t, event in told if event.name == "overrun" and t <= crew.ended_s]
    spans = [
        (made.begin_s, made.end_s + AFTERMATH_S)
        for made in crew.made
        if made.vessel == vessel or made.fault.target == "machine"
    ]
    excused = sum(any(begin <= t <= end for begin, end in spans) for t in late_s)
    recorded = sum(path.stat().st_size for path in folder.rglob("*.mcap"))
    return VesselSoak(
        name=name,
        samples=tuple(log.samples[vessel]),
        verdicts=tuple(_verdicts(crew, vessel, schedule)),
        decisions=crew.witnesses[vessel].decisions,
        missed=len(late_s) - excused,
        missed_in_faults=excused,
        log=(folder / LOG_FILE).read_text(errors="replace"),
        recording_mb=recorded / 1e6,
        turns=turns,
    )


def _verdicts(crew: FaultyCrew, vessel: int, schedule: list[Scheduled]) -> list[Verdict]:
    found = []
    for scheduled in schedule:
        plan = scheduled.plan
        made = [m for m in crew.made if m.vessel == vessel and m.fault in plan.fault]
        if plan.promise is None or len(made) < len(plan.fault):
            continue
        promise = replace(plan.promise, mode=None, armed=None)  # others change them later
        until_s = max(m.end_s for m in made) + plan.settle_s
        witness = crew.witnesses[vessel]
        if witness.turning(min(m.begin_s for m in made)):
            found.append(judge(plan.name, promise, made, witness, now_s=until_s, log=""))
    return found


def _config(settings: SoakSettings, name: str, system_id: int, folder: Path) -> RuntimeConfig:
    config = config_of(name, system_id, folder)
    kept = {f: getattr(settings.recording, f) for f in settings.recording.__struct_fields__}
    return replace(config, recording=RecordingSettings(folder=str(folder), **kept))
