"""What a run says of itself: the JSON object, the file and the table."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

from rich.table import Table

from twinscrew.hil_sim.sitl_report import SitlReport

COLOURS = {
    "goal": "green",
    "collision": "red",
    "fence": "red",
    "timeout": "yellow",
    "done": "green",
    "ended": "yellow",
}


def as_dict(report: SitlReport) -> dict[str, Any]:
    """Give the object that `sitl --json` prints; its keys are fixed, others script it.

    With faults there is one more, `faults`: by vessel what was promised and measured.

    The latencies of several vessels are each one's worst: no vessel is slower than they say.
    """
    latencies = [vessel.latency for vessel in report.vessels]
    faults = {name: verdict.as_dict() for name, verdict in report.verdicts}
    return {
        "success": report.success,
        "seed": report.seed,
        "vessels": [
            {
                "name": vessel.name,
                "outcome": vessel.outcome,
                "travel_time_s": round(vessel.travel_time_s, 3),
                "closest_approach_m": _finite(vessel.closest_approach_m),
                "decisions": vessel.decisions,
                "touched": vessel.touched,
                "greatest_current_mps": round(vessel.greatest_current_mps, 3),
            }
            for vessel in report.vessels
        ],
        "latency_ms": {
            key: round(max(getattr(latency, key) for latency in latencies), 3)
            for key in ("p50", "p99", "max")
        },
        "real_time_factor": round(report.real_time_factor, 2),
        "decisions_sha256": report.sha256,
        **({"faults": faults} if faults else {}),
    }


def write_summary(path: Path, report: SitlReport, setup: dict[str, Any]) -> None:
    """Write summary.json: the same object, what was asked for, and more of each vessel."""
    summary = as_dict(report)
    summary["setup"] = setup
    summary["wall_s"] = round(report.wall_s, 2)
    for row, vessel in zip(summary["vessels"], report.vessels, strict=True):
        row["energy_ns"] = round(vessel.energy_ns, 1)
        row["decisions_sha256"] = vessel.sha256
        row["latency_ms"] = {
            key: round(getattr(vessel.latency, key), 3) for key in ("p50", "p99", "max")
        }
    path.write_text(json.dumps(summary, indent=2) + "\n")


def as_table(report: SitlReport) -> Table:
    """Give the table for people."""
    table = Table(
        "vessel",
        "outcome",
        "travel time",
        "closest approach",
        "decisions",
        "latency p50",
        "latency p99",
    )
    for vessel in report.vessels:
        colour = COLOURS[vessel.outcome]
        near, what = vessel.closest_approach_m, vessel.touched
        table.add_row(
            vessel.name,
            f"[{colour}]{vessel.outcome}[/{colour}]" + (f", {what}" if what else ""),
            f"{vessel.travel_time_s:.1f} s",
            f"{near:.2f} m" if math.isfinite(near) else "-",
            str(vessel.decisions),
            f"{vessel.latency.p50:.2f} ms",
            f"{vessel.latency.p99:.2f} ms",
        )
    return table


def _finite(value: float) -> float | None:
    return round(value, 3) if math.isfinite(value) else None
