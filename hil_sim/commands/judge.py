"""`twinscrew judge`: whether vessels kept the rules of the road, by two judges."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from twinscrew.hil_sim.rules.compare import RULE_WORDS, answer, compare, gather
from twinscrew.hil_sim.rules.pages import draw_pages

MOST_SHOWN = 20
"""[-] Differences that the terminal lists; --json has them all."""


def judge(
    path: Annotated[
        Path,
        typer.Argument(
            help="A folder of `experiment` or `sitl`, a recording, or a folder of them."
        ),
    ],
    tracks: Annotated[
        str,
        typer.Option(
            help="truth: where the simulator had everybody; boat: what each boat knew; auto: the "
            "truth where there is one."
        ),
    ] = "auto",
    pages: Annotated[
        Path | None,
        typer.Option(help="Draw every encounter: FILE.pdf, or a folder for PNG pages."),
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
) -> None:
    """Say how rules 8 and 13 to 17 were kept, by two judges, and where the two differ."""
    with Console(stderr=True, quiet=as_json).status("judging") as status:
        cases = list(gather(path, tracks))
        encounters = compare(cases)
        said = answer(encounters, len(cases))
        if pages is not None:
            status.update("drawing")
            said["pages"] = [str(file) for file in draw_pages(pages, encounters)]
    if as_json:
        print(json.dumps(said))
        return
    _tell(said)


def _tell(said: dict[str, Any]) -> None:
    console = Console()
    console.print(f"{said['episodes']} episodes, {said['encounters']} encounters")
    table = Table("method", "rule", "kept, by A", "where possible", "kept, by B", "early, readable")
    for row in said["verdicts"]:
        cells = (_words(row[key]) for key in ("a", "a_where_possible", "b", "rule_8"))
        table.add_row(escape(row["method"]) or "-", f"{row['rule']} {row['words']}", *cells)
    console.print(table)
    agreement = said["agreement"]
    rules = ", ".join(
        f"rule {rule} {_words(share)}"
        for rule, share in agreement["by_rule"].items()
        if share["of"]
    )
    console.print(f"the judges agree in {_words(agreement['overall'])}: {rules or 'no encounters'}")
    for one in said["differences"][:MOST_SHOWN]:
        what = f"{one['episode']}: {one['vessel']} and {one['other']} at {one['begin_s']:.1f} s"
        console.print(f"- {escape(what)} ({RULE_WORDS[one['rule']]}): {escape(one['reason'])}")
    if len(said["differences"]) > MOST_SHOWN:
        console.print(f"and {len(said['differences']) - MOST_SHOWN} more: --json lists them")
    for file in said.get("pages", ()):
        console.print(f"[bold]{escape(file)}[/bold]")


def _words(share: dict[str, Any]) -> str:
    if not share["of"]:
        return "-"
    low, high = share["wilson95"]
    return f"{share['rate']:.0%} ({share['count']}/{share['of']}) [{low:.0%}, {high:.0%}]"
