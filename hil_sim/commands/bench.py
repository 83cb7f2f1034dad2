"""`twinscrew bench`: figures of this machine, each part an entry point of its own."""

from __future__ import annotations

import json
import os
import platform
from collections.abc import Callable
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console
from rich.table import Table

from twinscrew.hil_sim.bench.budgets import compared, load_budgets
from twinscrew.runtime.errors import ConfigError, one_of
from twinscrew.runtime.files import processor

GROUP = "twinscrew.benches"
BY_DEFAULT = (
    "latency",
    "perception",
    "tracking",
    "harbour",
    "assurance",
    "route",
    "startup",
    "sitl",
    "wire",
    "training",
)


def bench(
    only: Annotated[str | None, typer.Option(help=f"One part: {', '.join(BY_DEFAULT)}.")] = None,
    plot: Annotated[
        Path | None, typer.Option(help="With --only perception: a folder for pictures.")
    ] = None,
    seconds: Annotated[
        float, typer.Option(help="With the wire part: how long each measurement lasts.", min=1)
    ] = 20.0,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
) -> None:
    """Measure speed, latency and perception, and print the figures beside their budgets."""
    console = Console(stderr=True)
    results: dict[str, Any] = {}
    for entry in _chosen(only):
        if not as_json:
            console.print(f"measuring {entry.name} ...")
        run = _load(entry, console)
        if run is not None:
            results |= run(**_options(entry.name, plot, seconds))
    results["budgets"] = compared(results, load_budgets())
    results["machine"] = machine()
    if as_json:
        print(json.dumps(results))
        return
    for name, values in results.items():
        if values != {}:
            _print(Console(), name, values)


def machine() -> dict[str, Any]:
    """Tell on what the figures were measured."""
    return {
        "cpu": processor(),
        "cores": len(os.sched_getaffinity(0)),
        "load": round(os.getloadavg()[0], 2),
        "python": platform.python_version(),
        "system": platform.platform(),
    }


def _chosen(only: str | None) -> list[EntryPoint]:
    installed = {entry.name: entry for entry in entry_points(group=GROUP)}
    if only is None:
        return [installed[name] for name in BY_DEFAULT if name in installed]
    if only not in installed:
        raise ConfigError(one_of(only, sorted(installed)), key="--only")
    return [installed[only]]


def _load(entry: EntryPoint, console: Console) -> Callable[..., dict[str, Any]] | None:
    try:
        function: Callable[..., dict[str, Any]] = entry.load()
    except ModuleNotFoundError as error:
        console.print(f"{entry.name}: not measured, {error.name!r} is not installed")
        return None
    return function


def _options(name: str, plot: Path | None, seconds: float) -> dict[str, Any]:
    if name == "perception" and plot is not None:
        return {"plot": plot}
    return {"seconds": seconds} if name == "wire" else {}


def _print(console: Console, name: str, values: Any) -> None:
    rows = _rows(values)
    if rows is None:
        console.print(f"[bold]{name}[/bold]: {_leaf(values)}")
        return
    for title, table_rows in rows.items():
        columns = sorted({key for row in table_rows.values() for key in row}, key=str)
        table = Table("", *columns, title=f"{name} {title}".strip(), title_justify="left")
        for label, row in table_rows.items():
            table.add_row(label, *(_leaf(row.get(column, "")) for column in columns))
        console.print(table)


def _rows(values: Any) -> dict[str, dict[str, dict[str, Any]]] | None:
    """Bring nested figures into tables: title -> row -> column -> figure."""
    if not isinstance(values, dict):
        return None
    figures, rows, tables = (
        {name: value for name, value in values.items() if _depth(value) == depth}
        for depth in range(3)
    )
    first = {"": rows} if rows else {}
    overall = {"overall" if rows else "": {"": figures}} if figures else {}
    return first | overall | tables


def _depth(values: Any) -> int:
    if not isinstance(values, dict):
        return 0
    return 1 + max((_depth(value) for value in values.values()), default=0)


def _leaf(value: Any) -> str:
    return f"{value:.4g}" if isinstance(value, float) else str(value)
