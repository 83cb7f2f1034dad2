"""Tries files of faults, several at a time, each on a vessel of its own in real time."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from pathlib import Path

from twinscrew.hil_sim.drivers.processes import punctual
from twinscrew.hil_sim.drivers.voyage import Voyage
from twinscrew.hil_sim.faults.assemble import faulty_crew, verdicts
from twinscrew.hil_sim.faults.plan import FaultPlan
from twinscrew.hil_sim.faults.verdict import Verdict
from twinscrew.hil_sim.faults.waters import lanes
from twinscrew.hil_sim.sensors.marine import (
    OWN_MMSI,
    AisTransponders,
    MarineSensors,
    MarineSettings,
)
from twinscrew.hil_sim.sitl_runtimes import DATUM
from twinscrew.hil_sim.world import make_world
from twinscrew.runtime.link.ardupilot.link import AutopilotSettings
from twinscrew.runtime.perception.sensor import load_sensor
from twinscrew.runtime.recording.settings import RecordingSettings
from twinscrew.runtime.senses.ais import AisSettings
from twinscrew.runtime.senses.table import SensesSettings
from twinscrew.runtime.vessel.config import RuntimeConfig

SENSOR = "vrx32"


def groups(plans: Iterable[FaultPlan], together: int) -> Iterator[list[FaultPlan]]:
    """Say which files are tried at the same time: similar lengths; the machine's faults alone."""
    plans = list(plans)
    for plan in plans:
        if plan.alone:
            yield [plan]
    rest = sorted((plan for plan in plans if not plan.alone), key=lambda plan: plan.end_s)
    for first in range(0, len(rest), together):
        yield rest[first : first + together]


def try_out(
    plans: list[FaultPlan], folder: Path, seed: int = 0, tell: Callable[[str], None] = print
) -> list[Verdict]:
    """Try files of faults at the same time, one a vessel.

    Parameters
    ----------
    folder
        Where the vessels' logs and recordings go.
    seed
        What sea, sensors and messages' fates are drawn from.
    tell
        Takes a word about what happens.
    """
    tell(", ".join(plan.name for plan in plans))
    duration_s = max(plan.end_s + plan.settle_s for plan in plans)
    hears = [any(fault.target == "nmea" for fault in plan.fault) for plan in plans]
    scenario = lanes(len(plans), duration_s, ship=any(hears))
    world = make_world(scenario, sensor=SENSOR, seed=seed)
    folders = [folder / plan.name for plan in plans]
    configs = [
        config_of(scenario.names[i], i + 1, folders[i], plan.autopilot, hears=hears[i])
        for i, plan in enumerate(plans)
    ]
    receivers = MarineSettings(ais=AisTransponders(own_vessels=False, loss=0.0))
    marine = MarineSensors(world, receivers, DATUM) if any(hears) else None
    with punctual(), faulty_crew(world, configs, folders, plans, seed) as crew:
        Voyage(world, crew, scan_s=1.0 / load_sensor(SENSOR).rate_hz, marine=marine).run()
    return list(verdicts(crew, plans, folders).values())


def config_of(
    name: str, system_id: int, folder: Path, kind: str = "ardupilot", *, hears: bool = False
) -> RuntimeConfig:
    """Give the configuration of a vessel whose troubles are watched; `hears`: it has AIS."""
    ais = AisSettings(datum=DATUM, own_mmsi=OWN_MMSI) if hears else None
    return RuntimeConfig(
        name=name,
        sensor=SENSOR,
        autopilot=AutopilotSettings(
            kind=kind, system_id=system_id, arm=True, receiver_fitted=False
        ),
        senses=SensesSettings(ais=ais),
        recording=RecordingSettings(folder=str(folder)),
    )
