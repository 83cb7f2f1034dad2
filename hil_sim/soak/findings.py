"""The findings of a soak against its limits, and the report: a table, a figure, and JSON."""

from __future__ import annotations

import json
from collections.abc import Sequence
from itertools import groupby
from pathlib import Path
from typing import Any, NamedTuple

from twinscrew.hil_sim.faults.timeline import Span
from twinscrew.hil_sim.soak.limits import Growth, Limits, Sample, SoakSettings, growth
from twinscrew.hil_sim.soak.vessels import Judged, VesselSoak

EXCEPTIONS = ("Traceback", "panicked", "Segmentation fault", "never awaited")
"""What an unhandled exception leaves on standard error, in Python and in Rust."""
LEFT_OUT_S = 10.0
"""[s] At the beginning of a process's life: it starts."""


MACHINE = "machine"
"""Whose finding it is that tells what the others are worth."""


class Finding(NamedTuple):
    """One thing that was looked at."""

    vessel: str
    """Or `MACHINE`."""
    what: str
    limit: str
    found: str
    fine: bool


def findings(
    vessels: Sequence[VesselSoak],
    standstills: Sequence[Span],
    duration_s: float,
    settings: SoakSettings,
) -> list[Finding]:
    """Look at everything.

    Parameters
    ----------
    standstills
        When the machine stood still.
    duration_s
        [s] How long was sailed.
    """
    found = [finding for vessel in vessels for finding in _of(vessel, settings)]
    return [*found, _machine(standstills, duration_s, settings.limits)]


def lives(samples: Sequence[Sample]) -> list[list[Sample]]:
    """Give the samples of each process, one after the other."""
    return [list(life) for _, life in groupby(samples, key=lambda sample: sample.pid)]


def warm(life: Sequence[Sample], share: float) -> list[Sample]:
    """Leave out the time in which a process fills its caches."""
    begin_s = life[0].time_s + max(LEFT_OUT_S, share * (life[-1].time_s - life[0].time_s))
    return [sample for sample in life if sample.time_s >= begin_s]


def longest(vessel: VesselSoak, share: float) -> Growth:
    """Give the growth of the vessel's longest-lived process."""
    life = max(lives(vessel.samples), key=len, default=[])
    return growth(warm(life, share)) if life else Growth(0.0, 0.0, 0, 0)


def _of(vessel: VesselSoak, settings: SoakSettings) -> list[Finding]:
    limits, grown = settings.limits, longest(vessel, settings.warm_share)
    leak = grown.memory_mb > limits.memory_slack_mb and (
        grown.memory_mb_per_h > limits.memory_mb_per_h
    )
    missed_limit = limits.missed_share * max(1, vessel.decisions)
    judged = vessel.verdicts
    broken = [verdict.name for verdict in judged if not verdict.kept]
    words = next((word for word in EXCEPTIONS if word in vessel.log), "none")
    kept = f"{len(judged) - len(broken)} of {len(judged)}"
    made = len(vessel.faults)
    missed = vessel.missed
    quota_mb = settings.recording.quota_mb + 2.0 * settings.recording.rotate_mb
    rows = [
        (
            "memory",
            f"{limits.memory_mb_per_h:g} MB/h",
            f"{grown.memory_mb_per_h:+.1f} MB/h",
            not leak,
        ),
        ("file handles", f"+{limits.files:g}", f"{grown.files:+d}", grown.files <= limits.files),
        ("threads", f"+{limits.threads:g}", f"{grown.threads:+d}", grown.threads <= limits.threads),
        (
            "missed deadlines",
            f"{missed_limit:.1f} of {vessel.decisions}",
            f"{missed.own} (and {missed.in_faults} in faults, "
            f"{missed.in_standstills} in standstills)",
            missed.own <= missed_limit,
        ),
        ("unhandled exceptions", "none", words, words == "none"),
        (
            "faults judged",
            f"{limits.judged_share:.0%}",
            f"{len(judged)} of {made}",
            len(judged) >= limits.judged_share * made,
        ),
        ("promises kept", "all", " ".join([kept, *broken]), not broken),
        (
            "recordings",
            f"{quota_mb:g} MB a start",
            f"{vessel.recording_mb:.0f} MB",
            vessel.recording_mb <= quota_mb * len(lives(vessel.samples)),
        ),
    ]
    return [Finding(vessel.name, *row) for row in rows]


def _machine(standstills: Sequence[Span], duration_s: float, limits: Limits) -> Finding:
    still_s = sum(span.length_s for span in standstills)
    return Finding(
        MACHINE,
        "standstills",
        f"{limits.standstill_share:.0%} of {duration_s:.0f} s",
        f"{still_s:.2f} s in {len(standstills)}",
        still_s <= limits.standstill_share * duration_s,
    )


# -- A soak's report: a table, a figure of memory, and the same for scripts.


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
