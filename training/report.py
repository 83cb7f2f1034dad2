"""What training runs came to: learning curves over seeds as a figure, and a table in Markdown."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np

from twinscrew.runtime.errors import ConfigError
from twinscrew.runtime.messages.types import Float64
from twinscrew.training import runs
from twinscrew.training.evaluate import SECONDS_WORTH

Grouping = Literal["algorithm", "folder"]
Which = Literal["last", "best"]
"""The evaluation at a run's end, or that of its greatest validation score."""
QUANTITIES = {
    "cumulative_reward": "cumulative reward [-]",
    "success": "success rate [-]",
    "travel_time_s": "travel time [s]",
}
"""What is drawn, by the evaluation records' fields."""


class Column(NamedTuple):
    """One column: its heading, what it takes of an evaluation, and how it is written."""

    heading: str
    value: Callable[[Mapping[str, Any]], float | None]
    form: str


COLUMNS = (
    Column("success", lambda e: e["success"], "{:.3f}"),
    Column("rough", lambda e: e.get("rough_success"), "{:.3f}"),
    Column("time [s]", lambda e: e["travel_time_s"], "{:.1f}"),
    Column("reward", lambda e: e.get("cumulative_reward"), "{:.1f}"),
    Column("transitions [million]", lambda e: e["transitions"] / 1e6, "{:.2f}"),
    Column("minutes", lambda e: e["seconds"] / 60.0, "{:.1f}"),
)
SPREAD = ("success", "rough")
"""Columns that also give the worst and the best seed."""


def find_runs(folders: Iterable[Path], by: Grouping = "algorithm") -> dict[str, list[Path]]:
    """Give the run directories in and below some folders.

    Parameters
    ----------
    folders
        Where to look.
    by
        What makes runs seeds of one: their algorithm, or the folder that they lie in, as `train`
        names it after the configuration.

    Raises
    ------
    ConfigError
        A folder holds none.
    """
    found: dict[str, list[Path]] = {}
    for folder in folders:
        files = sorted(folder.rglob(runs.CONFIG))
        if not files:
            raise ConfigError("no training run here", file=folder)
        for file in files:
            told = runs.read_told(file.parent)
            with runs.understood(file):
                algorithm = str(told["settings"]["agent"]["algorithm"])
            name = algorithm if by == "algorithm" else file.resolve().parent.parent.name
            found.setdefault(name, []).append(file.parent)
    return found


def evaluations(folder: Path) -> list[dict[str, Any]]:
    """Give the evaluations that a run has logged.

    Raises
    ------
    ConfigError
        There is none yet.
    """
    records = [r for r in runs.read_records(folder / runs.LOG) if r.get("event") == "evaluation"]
    if not records:
        raise ConfigError("has not been evaluated yet", file=folder / runs.LOG)
    return records


# -- curves ---------------------------------------------------------------------------------------


class Curve(NamedTuple):
    """One quantity of one configuration over its transitions; T evaluations."""

    transitions: Float64
    """(T,) [-]"""
    mean: Float64
    """(T,) Over the seeds."""
    error: Float64
    """(T,) Standard error over the seeds; 0 for one seed."""
    seeds: int


def learning_curve(folders: Iterable[Path], quantity: str) -> Curve:
    """Give a quantity's curve over some runs, up to where the shortest of them is.

    Raises
    ------
    ConfigError
        A run has not been evaluated yet, or its log lacks the quantity.
    """
    series = [_series(folder, quantity) for folder in folders]
    end = min(x[-1] for x, _ in series)
    grid = next(x[x <= end] for x, _ in series)
    values = np.stack([np.interp(grid, x, y) for x, y in series])
    spread = values.std(axis=0, ddof=1) if len(series) > 1 else np.zeros(len(grid))
    return Curve(grid, values.mean(axis=0), spread / np.sqrt(len(series)), len(series))


def logged(folders: Iterable[Path]) -> dict[str, str]:
    """Give those of `QUANTITIES` that all of some runs have logged: older versions logged less."""
    first = [evaluations(folder)[0] for folder in folders]
    return {key: label for key, label in QUANTITIES.items() if all(key in one for one in first)}


def _series(folder: Path, quantity: str) -> tuple[Float64, Float64]:
    records = evaluations(folder)
    if quantity not in records[0]:
        raise ConfigError(
            "not logged: a run of an older version", file=folder / runs.LOG, key=quantity
        )
    with runs.understood(folder / runs.LOG):
        return (
            np.array([r["transitions"] for r in records], float),
            np.array([r[quantity] for r in records], float),
        )


def draw_learning_curves(groups: Mapping[str, list[Path]], file: Path) -> None:
    """Draw reward, success and travel time over transitions: mean, and standard error as a band.

    Parameters
    ----------
    groups
        Run directories of several seeds, by the name they are drawn under.
    file
        The picture; its suffix says the format.
    """
    import matplotlib.pyplot as plt

    drawn = logged(folder for folders in groups.values() for folder in folders)
    size = (4.5 * len(drawn), 3.8)
    figure, grid = plt.subplots(1, len(drawn), figsize=size, layout="constrained", squeeze=False)
    for axis, (quantity, label) in zip(grid[0], drawn.items(), strict=True):
        for name, folders in sorted(groups.items()):
            curve = learning_curve(folders, quantity)
            x = curve.transitions / 1e6
            (line,) = axis.plot(x, curve.mean, label=f"{name} ({curve.seeds} seeds)")
            low, high = curve.mean - curve.error, curve.mean + curve.error
            axis.fill_between(x, low, high, color=line.get_color(), alpha=0.25)
        axis.set(xlabel="transitions [million]", ylabel=label)
        axis.grid(alpha=0.3)
    grid[0][0].legend(title="line: mean, band: standard error")
    figure.savefig(file)
    plt.close(figure)


# -- table ----------------------------------------------------------------------------------------


def seeds_table(groups: Mapping[str, list[Path]], which: Which = "last") -> str:
    """Give one row a configuration: the mean over its seeds, and (worst .. best) of the rates.

    Parameters
    ----------
    groups
        Run directories of several seeds, by the name of their row.
    which
        The evaluation that is counted.

    Raises
    ------
    ConfigError
        A run has not been evaluated yet.
    """
    heads = ["configuration", "seeds", *(column.heading for column in COLUMNS)]
    rows = [heads, ["---"] * len(heads)]
    for name, folders in groups.items():
        records = [chosen(folder, which) for folder in folders]
        cells = [_cell(column, records) for column in COLUMNS]
        rows.append([name, str(len(records)), *cells])
    return "".join(f"| {' | '.join(row)} |\n" for row in rows)


def chosen(folder: Path, which: Which) -> dict[str, Any]:
    """Give the last evaluation of a run, or the one that its best checkpoint was selected by."""
    records = evaluations(folder)
    with runs.understood(folder / runs.LOG):
        record = records[-1] if which == "last" else max(records, key=selection_value)
        for column in COLUMNS:
            float(column.value(record) or 0.0)
    return record


def selection_value(record: Mapping[str, Any]) -> float:
    """Give what selection maximised (`Score.value`), from a logged evaluation."""
    kinds = [record["success"], *(record[key] for key in ("rough_success",) if key in record)]
    return float(np.mean(kinds)) - SECONDS_WORTH * float(record["travel_time_s"])


def _cell(column: Column, records: list[dict[str, Any]]) -> str:
    values = [column.value(record) for record in records]
    known = [value for value in values if value is not None]
    if len(known) < len(values):
        return "-"
    text = column.form.format(np.mean(known))
    if column.heading not in SPREAD or len(known) < 2:
        return text
    return f"{text} ({column.form} .. {column.form})".format(min(known), max(known))
