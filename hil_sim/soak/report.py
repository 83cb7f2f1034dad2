"""A soak's report: a table, a figure of memory, and the same for scripts."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from twinscrew.hil_sim.soak.findings import Finding, lives
from twinscrew.hil_sim.soak.vessel import Judged, VesselSoak


def as_dict(
    vessels: Sequence[VesselSoak], found: Sequence[Finding], minutes: float, seed: int
) -> dict[str, Any]:
    """Give the report for JSON."""
    return {
        "fine": all(finding.fine for finding in found),
        "minutes": round(minutes, 2),
        "seed": seed,
        "findings": [finding._asdict() for finding in found],
        "faults": {vessel.name: [_fault(judged) for judged in vessel.faults] for vessel in vessels},
    }


def _fault(judged: Judged) -> dict[str, Any]:
    told = {"name": judged.verdict.name, "at_s": round(judged.at_s, 2), "excuse": judged.excuse}
    return told | judged.verdict.as_dict()


def write(
    folder: Path, vessels: Sequence[VesselSoak], found: Sequence[Finding], report: dict[str, Any]
) -> None:
    """Write report.md, report.json and memory.png."""
    (folder / "report.json").write_text(json.dumps(report, indent=2) + "\n")
    (folder / "report.md").write_text("\n".join(_markdown(vessels, found, report)) + "\n")
    _draw(folder / "memory.png", vessels)


def _markdown(
    vessels: Sequence[VesselSoak], found: Sequence[Finding], report: dict[str, Any]
) -> list[str]:
    verdict = "passed" if report["fine"] else "FAILED"
    lines = [
        f"# Soak: {verdict}",
        "",
        f"{report['minutes']:g} minutes, {len(vessels)} vessels, seed {report['seed']}.",
        "",
        "| vessel | what | limit | found | |",
        "| --- | --- | --- | --- | --- |",
    ]
    lines += [
        f"| {f.vessel} | {f.what} | {f.limit} | {f.found} | {'fine' if f.fine else 'NOT FINE'} |"
        for f in found
    ]
    lines += ["", "![memory](memory.png)", "", "## Faults", ""]
    lines += [
        "| vessel | at | fault | what | promised | measured | |",
        "| --- | --- | --- | --- | --- | --- | --- |",
    ]
    lines += [
        f"| {vessel.name} | {judged.at_s:.1f} s | {judged.verdict.name} | {row.what} "
        f"| {row.promised} | {row.measured} | {_word(judged, kept=row.kept)} |"
        for vessel in vessels
        for judged in vessel.faults
        for row in judged.verdict.rows
    ]
    return lines


def _word(judged: Judged, *, kept: bool) -> str:
    return judged.excuse or ("kept" if kept else "BROKEN")


def _draw(path: Path, vessels: Sequence[VesselSoak]) -> None:
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(8, 6), layout="constrained")
    FigureCanvasAgg(figure)
    memory, handles = figure.subplots(2, 1, sharex=True)
    for number, vessel in enumerate(vessels):
        for start, life in enumerate(lives(vessel.samples)):
            minutes = [sample.time_s / 60 for sample in life]
            name = None if start else vessel.name
            colour = f"C{number}"
            memory.plot(minutes, [s.rss_mb for s in life], color=colour, label=name)
            handles.plot(minutes, [s.files for s in life], color=colour)
            handles.plot(minutes, [s.threads for s in life], color=colour, linestyle="--")
    memory.set_ylabel("resident memory [MB]")
    memory.legend(loc="lower right")
    handles.set_ylabel("file handles, threads (dashed)")
    handles.set_xlabel("time [min]")
    figure.savefig(path, dpi=120)
