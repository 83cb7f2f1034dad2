"""`twinscrew report`: an experiment's results as tables and figures."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.markup import escape

from twinscrew.hil_sim.report.material import gather
from twinscrew.hil_sim.report.write import FIGURES, write_report


def report(
    folder: Annotated[Path, typer.Argument(help="Folder of the results.")],
    evaluations: Annotated[
        list[str] | None,
        typer.Option(help="METHOD=FILE of `twinscrew evaluate --all --json`; may be repeated."),
    ] = None,
    failures: Annotated[int, typer.Option(help="Failures to sail again and draw.", min=0)] = 8,
    trajectories: Annotated[bool, typer.Option(help="Sail episodes again to draw them.")] = True,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
) -> None:
    """Turn an experiment's results into REPORT.md and figures, in its folder."""
    material = gather(folder, evaluations or ())
    with Console(stderr=True, quiet=as_json).status("drawing") as status:
        path = write_report(
            material,
            failures,
            lambda what: status.update(f"sailing again: {escape(what)}"),
            trajectories=trajectories,
        )
    if as_json:
        figures = sorted(str(file) for file in (folder / FIGURES).glob("*.png"))
        print(json.dumps({"report": str(path), "figures": figures}))
    else:
        Console().print(f"[bold]{escape(str(path))}[/bold]")
