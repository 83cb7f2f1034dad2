"""`twinscrew faults`: make every fault of the table, and hold the boat to what was promised."""

from __future__ import annotations

import json
import tempfile
import time
from contextlib import ExitStack
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from twinscrew.hil_sim.faults.plan import FaultPlan, load_plan
from twinscrew.hil_sim.faults.table import as_table
from twinscrew.hil_sim.faults.trial import groups, try_out
from twinscrew.hil_sim.faults.verdict import Verdict
from twinscrew.runtime.errors import ConfigError
from twinscrew.runtime.settings import CONFIG_DIR

BROKEN = 1


def faults(
    only: Annotated[
        list[str] | None, typer.Option(help="A name in config/faults, or a file; may be repeated.")
    ] = None,
    together: Annotated[
        int, typer.Option(help="How many vessels sail at a time, each with its fault.", min=1)
    ] = 4,
    seed: Annotated[int, typer.Option(help="What everything random is drawn from.", min=0)] = 0,
    out: Annotated[Path | None, typer.Option(help="Folder to keep logs and recordings in.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
) -> None:
    """Try faults on real processes in real time, and measure what the boat does.

    Exit status 0 if every promise was kept, 1 if one was broken, 2 for a usage or set-up error.
    """
    names = only or sorted(path.stem for path in (CONFIG_DIR / "faults").glob("*.toml"))
    plans = [load_plan(name) for name in names]
    if out is not None and out.exists() and any(out.iterdir()):
        raise ConfigError("the folder is not empty; a run needs a new one", file=out)
    console = Console(stderr=True, quiet=as_json)
    begin_s = time.monotonic()
    with ExitStack() as stack:
        folder = out or Path(stack.enter_context(tempfile.TemporaryDirectory()))
        found = _try_all(plans, together, folder, seed, console)
    kept = all(verdict.kept for verdict in found)
    _tell(found, time.monotonic() - begin_s, as_json=as_json)
    if not kept:
        raise typer.Exit(BROKEN)


def _try_all(
    plans: list[FaultPlan], together: int, folder: Path, seed: int, console: Console
) -> list[Verdict]:
    found = []
    for batch in groups(plans, together):
        found += try_out(batch, folder, seed, lambda words: console.print(words, highlight=False))
    return sorted(found, key=lambda verdict: verdict.name)


def _tell(found: list[Verdict], wall_s: float, *, as_json: bool) -> None:
    broken = [verdict.name for verdict in found if not verdict.kept]
    if as_json:
        report = {
            "kept": not broken,
            "faults": {verdict.name: verdict.as_dict() for verdict in found},
            "wall_s": round(wall_s, 1),
        }
        print(json.dumps(report))
        return
    console = Console()
    console.print(as_table(found))
    words = f"[red]broken: {', '.join(broken)}[/red]" if broken else "[green]all kept[/green]"
    console.print(f"{len(found)} faults in {wall_s:.0f} s: {words}")
