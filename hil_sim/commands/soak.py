"""`twinscrew soak`: sail for long with faults at random, and look for what grows or breaks."""

from __future__ import annotations

import json
from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from twinscrew.hil_sim.soak.findings import Finding, as_dict, findings, write
from twinscrew.hil_sim.soak.limits import load_soak
from twinscrew.hil_sim.soak.run import soak as sail
from twinscrew.runtime.errors import ConfigError

NOT_FINE = 1
TELL_S = 30.0


def soak(
    minutes: Annotated[float, typer.Option(help="How long.", min=0.5)] = 60.0,
    seed: Annotated[int, typer.Option(help="What faults are drawn from.", min=0)] = 0,
    out: Annotated[Path | None, typer.Option(help="Folder of the report and the logs.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
) -> None:
    """Sail with faults at random; watch memory, file handles, threads, deadlines, exceptions.

    Exit status 0 if all is within the limits of config/soak.toml and every promise was kept, 1 if
    not, 2 for a usage or set-up error.
    """
    folder = out or Path("runs") / datetime.now(UTC).strftime("soak-%Y%m%d-%H%M%S")
    if folder.exists() and any(folder.iterdir()):
        raise ConfigError("the folder is not empty; a run needs a new one", file=folder)
    folder.mkdir(parents=True, exist_ok=True)
    settings = load_soak()
    console = Console(stderr=True, quiet=as_json)
    told_s = 0.0

    def tell(time_s: float) -> None:
        nonlocal told_s
        if time_s >= told_s:
            told_s += TELL_S
            console.print(f"{time_s / 60:5.1f} of {minutes:g} min", highlight=False)

    vessels, standstills = sail(settings, 60.0 * minutes, seed, folder, tell)
    found = findings(vessels, standstills, 60.0 * minutes, settings)
    report = as_dict(vessels, found, minutes, seed)
    write(folder, vessels, found, report)
    if as_json:
        print(json.dumps(report))
    else:
        Console().print(_table(found))
        Console().print(f"[bold]{escape(str(folder))}[/bold]: report.md, report.json, memory.png")
    if not report["fine"]:
        raise typer.Exit(NOT_FINE)


def _table(found: list[Finding]) -> Table:
    table = Table("vessel", "what", "limit", "found", "")
    for finding in found:
        mark = "[green]fine[/green]" if finding.fine else "[red]NOT FINE[/red]"
        table.add_row(finding.vessel, finding.what, finding.limit, finding.found, mark)
    return table
