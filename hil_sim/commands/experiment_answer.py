"""What `twinscrew experiment` prints when it is done."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.markup import escape
from rich.table import Table

from twinscrew.hil_sim.experiments.results import results_sha256
from twinscrew.hil_sim.experiments.runner import Finished
from twinscrew.hil_sim.experiments.suites import Counted, counted
from twinscrew.hil_sim.experiments.summary import Cell, summarise


def tell(
    finished: Finished, folder: Path, wall_s: float, suite: str = "", *, as_json: bool
) -> None:
    """Print what was sailed in `wall_s` seconds: one JSON object, or tables."""
    cells = summarise(finished.records)
    sailed = len(finished.records) - finished.kept
    digest = results_sha256(finished.records)
    figures = list(counted(suite, finished.records)) if suite else []
    if as_json:
        print(
            json.dumps(
                {
                    "out": str(folder),
                    "episodes": len(finished.records),
                    "sailed_now": sailed,
                    "kept": finished.kept,
                    "results_sha256": digest,
                    "cells": [one.record() for one in cells],
                    **({"suite": _suite(suite, figures)} if suite else {}),
                    "wall_s": round(wall_s, 2),
                }
            )
        )
        return
    console = Console()
    console.print(_table(cells))
    for one in figures:
        console.print(_figures(one))
    console.print(f"{sailed} episodes sailed in {wall_s:.0f} s, {finished.kept} were there before")
    console.print(
        f"results {digest[:16]}...; [bold]twinscrew report {escape(str(folder))}[/bold] tells more"
    )


def _suite(name: str, figures: list[Counted]) -> dict[str, Any]:
    return {"name": name, "figures": [one.record() for one in figures]}


def _figures(one: Counted) -> Table:
    """Give a suite's figures; tables among them are left to the report."""
    table = Table("figure", "value", title=f"{one.method}, {one.set}, {one.variant}")
    for name, value in one.figures.items():
        if not isinstance(value, dict):
            table.add_row(name, str(value))
    for words, reached in one.aims.items():
        table.add_row(f"aim: {words}", "[green]reached[/green]" if reached else "[red]missed[/red]")
    return table


def _table(cells: list[Cell]) -> Table:
    table = Table("set", "method", "variant", "success", "95 %", "travel time", "failures")
    for one in cells:
        low, high = one.wilson95
        mean, least, most = one.travel_time_s
        table.add_row(
            escape(one.set),
            escape(one.method),
            one.variant,
            f"{one.successes}/{one.episodes}",
            f"{low:.0%} .. {high:.0%}",
            f"{mean:.2f} s ({least:.2f} .. {most:.2f})" if one.successes else "-",
            ", ".join(f"{cause} {n}" for cause, n in one.failures.items() if n) or "-",
        )
    return table
