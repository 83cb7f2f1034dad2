"""Sails a soak, and gathers what happened."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from msgspec.structs import replace

from twinscrew.hil_sim.drivers.processes import punctual
from twinscrew.hil_sim.drivers.voyage import Voyage
from twinscrew.hil_sim.faults.assemble import faulty_crew
from twinscrew.hil_sim.faults.crew import FaultyCrew
from twinscrew.hil_sim.faults.plan import FaultPlan, load_plan
from twinscrew.hil_sim.faults.timeline import Span
from twinscrew.hil_sim.faults.trial import SENSOR, config_of
from twinscrew.hil_sim.faults.waters import lanes
from twinscrew.hil_sim.soak.limits import Sample, SoakSettings, Watch, sample
from twinscrew.hil_sim.soak.vessels import (
    Patrol,
    VesselSoak,
    comes_to_an_end,
    draw,
    fits_under_way,
    joined,
    look_back,
    needs_ais,
    spares_the_runtime,
    waits,
)
from twinscrew.hil_sim.world import make_world
from twinscrew.runtime.messages.types import Float64
from twinscrew.runtime.perception.sensor import load_sensor
from twinscrew.runtime.recording.settings import RecordingSettings
from twinscrew.runtime.settings import CONFIG_DIR
from twinscrew.runtime.vessel.config import RuntimeConfig


def soak(
    settings: SoakSettings,
    duration_s: float,
    seed: int,
    folder: Path,
    tell: Callable[[float], None],
) -> tuple[list[VesselSoak], list[Span]]:
    """Sail for a time, with faults drawn from a seed.

    Parameters
    ----------
    folder
        Where the vessels' logs and recordings go.
    tell
        Called with the time [s] since the beginning, at every sample.

    Returns
    -------
    vessels
        What became of each.
    standstills
        When the machine stood still.
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
    patrol = Patrol(world, [waits(schedule) for schedule in schedules])
    plans = [joined(schedule) for schedule in schedules]
    with (
        Watch(folder) as watch,
        punctual(),
        faulty_crew(world, configs, folders, plans, seed) as crew,
    ):
        log = _Log(crew, settings.sample_s, tell)

        def goal_of(vessel: int) -> Float64 | None:
            log.look()
            return patrol.goal_of(vessel)

        voyage = Voyage(world, crew, scan_s=1.0 / load_sensor(SENSOR).rate_hz)
        voyage.patrol(duration_s, goal_of)
    standstills = watch.standstills()
    return [
        look_back(crew, i, schedules[i], standstills, folders[i], log.samples[i], patrol.turns[i])
        for i in range(len(folders))
    ], standstills


def plans_for(vessel: int) -> list[FaultPlan]:
    """Give the shipped faults that may happen to a vessel; only the first one's runtime dies."""
    names = sorted(path.stem for path in (CONFIG_DIR / "faults").glob("*.toml"))
    shipped = [plan for plan in map(load_plan, names) if plan.autopilot == "ardupilot"]
    plans = [
        plan
        for plan in shipped
        if comes_to_an_end(plan) and fits_under_way(plan) and not needs_ais(plan)
    ]
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


def _config(settings: SoakSettings, name: str, system_id: int, folder: Path) -> RuntimeConfig:
    config = config_of(name, system_id, folder)
    kept = {f: getattr(settings.recording, f) for f in settings.recording.__struct_fields__}
    return replace(config, recording=RecordingSettings(folder=str(folder), **kept))
