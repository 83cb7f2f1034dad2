"""What `twinscrew sitl` prints when it is done."""

from __future__ import annotations

import json
from pathlib import Path

from rich.console import Console
from rich.markup import escape

from twinscrew.hil_sim.faults.table import as_table as faults_table
from twinscrew.hil_sim.sitl_report import SitlReport
from twinscrew.hil_sim.summary import as_dict, as_table


def tell(report: SitlReport, folder: Path, *, as_json: bool) -> None:
    """Print one JSON object, or the table and what was promised and kept."""
    if as_json:
        print(json.dumps(as_dict(report)))
        return
    console = Console()
    console.print(as_table(report))
    if report.verdicts:
        names, found = zip(*report.verdicts, strict=True)
        console.print(faults_table(found, names=names))
    console.print(f"{report.real_time_factor:.1f} x real time; decisions {report.sha256[:16]}...")
    console.print(
        f"[bold]{escape(str(folder))}[/bold]: summary.json, trajectories.png, <vessel>/recording"
    )
