"""`twinscrew train-report`: learning curves of training runs."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer


def train_report(
    runs: Annotated[list[Path], typer.Argument(help="Run directories, or folders of them.")],
    out: Annotated[Path, typer.Option(help="Where the figure goes.")] = Path(),
) -> None:
    """Draw the learning curves of training runs, mean and standard error over seeds."""
    import matplotlib as mpl

    mpl.use("Agg")
    from twinscrew.training.curves import find_runs
    from twinscrew.training.plots import draw_learning_curves

    out.mkdir(parents=True, exist_ok=True)
    file = out / "learning_curves.png"
    draw_learning_curves(find_runs(runs), file)
    print(file)
