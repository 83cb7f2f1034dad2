"""`twinscrew train-report`: learning curves and tables of training runs."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import typer


def train_report(
    runs: Annotated[list[Path], typer.Argument(help="Run directories, or folders of them.")],
    out: Annotated[Path, typer.Option(help="Where the figure goes.")] = Path(),
    by: Annotated[
        Literal["algorithm", "folder"],
        typer.Option(help="What makes runs seeds of one; train names folders by configuration."),
    ] = "algorithm",
    table: Annotated[
        bool, typer.Option("--table", help="Print a table in Markdown instead, by folder.")
    ] = False,
    which: Annotated[
        Literal["last", "best"],
        typer.Option(help="The table's evaluations: at the end, or of the best checkpoint."),
    ] = "last",
) -> None:
    """Draw the learning curves of training runs, mean and standard error over seeds."""
    from twinscrew.training.curves import find_runs

    if table:
        from twinscrew.training.tables import seeds_table

        print(seeds_table(find_runs(runs, "folder"), which), end="")
        return
    import matplotlib as mpl

    mpl.use("Agg")
    from twinscrew.training.plots import draw_learning_curves

    out.mkdir(parents=True, exist_ok=True)
    file = out / "learning_curves.png"
    draw_learning_curves(find_runs(runs, by), file)
    print(file)
