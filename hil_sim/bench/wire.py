"""From the Zenoh put of a cloud to the MAVLink bytes on the socket, in real time."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any

import psutil

from twinscrew.hil_sim.drivers.processes import punctual
from twinscrew.hil_sim.drivers.realtime import RealtimeCrew
from twinscrew.hil_sim.drivers.voyage import Voyage
from twinscrew.hil_sim.scenario import load_scenario
from twinscrew.hil_sim.world import make_world
from twinscrew.runtime.link.ardupilot.link import AutopilotSettings
from twinscrew.runtime.perception.sensor import load_sensor
from twinscrew.runtime.recording.settings import RecordingSettings
from twinscrew.runtime.vessel.config import RuntimeConfig
from twinscrew.runtime.vessel.summary import RunSummary, read_summary

FLEETS = (1, 5)
SENSOR = "vrx32"
BYTES_PER_MB = 1e6


def run(seconds: float = 20.0) -> dict[str, Any]:
    """Measure: {"wire": {vessels: {"p50_ms", ..., "missed", "cpu_percent", "rss_mb"}}}.

    Each vessel's runtime is a process that records; the figures are the worst vessel's, CPU and
    memory a runtime's process. Missed are scans that were not answered before the next one came;
    ticks, commands that were not re-sent 20 times a second.
    """
    with punctual():
        return {"wire": {str(vessels): _measure(vessels, seconds) for vessels in FLEETS}}


def _measure(vessels: int, seconds: float) -> dict[str, float]:
    scenario = load_scenario("random", vessels=vessels, seed=1)
    world = make_world(scenario, sensor=SENSOR, seed=1)
    scan_s = 1.0 / load_sensor(SENSOR).rate_hz
    with tempfile.TemporaryDirectory() as folder:
        folders = [Path(folder) / name for name in scenario.names]
        configs = [_config(name, i, folders[i]) for i, name in enumerate(scenario.names)]
        with RealtimeCrew(configs, folders) as crew:
            processes = [psutil.Process(pid) for pid in crew.pids]
            for process in processes:
                process.cpu_percent()
            Voyage(world, crew, scan_s=scan_s).linger(seconds)
            cpu = max(process.cpu_percent() for process in processes)
            rss = max(process.memory_info().rss for process in processes) / BYTES_PER_MB
            late_ms = crew.late_s * 1e3
        summaries = [read_summary(f) for f in folders]
    return {
        **_worst(summaries),
        "decisions": sum(summary.decisions for summary in summaries),
        "missed": sum(_missed(summary) for summary in summaries),
        "missed_ticks": sum(summary.missed_ticks for summary in summaries),
        "priority_refused": sum(bool(summary.priority_refused) for summary in summaries),
        "cpu_percent": round(cpu, 1),
        "rss_mb": round(rss, 1),
        "simulator_late_ms": round(late_ms, 2),
    }


def _config(name: str, index: int, folder: Path) -> RuntimeConfig:
    return RuntimeConfig(
        name=name,
        sensor=SENSOR,
        autopilot=AutopilotSettings(system_id=index + 1, arm=True, receiver_fitted=False),
        recording=RecordingSettings(folder=str(folder)),
    )


def _worst(summaries: list[RunSummary]) -> dict[str, float]:
    return {
        f"{key}_ms": round(max(summary.wire_latency_ms[key] for summary in summaries), 3)
        for key in ("p50", "p99", "p999", "max")
    }


def _missed(summary: RunSummary) -> int:
    """Count the scans that were not answered before the next one came."""
    return summary.overruns + summary.passed_over.get("points", 0)
