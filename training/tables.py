"""What several seeds of each configuration came to, as a table in Markdown."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np

from twinscrew.training import runs
from twinscrew.training.curves import evaluations
from twinscrew.training.validate import SECONDS_WORTH

Which = Literal["last", "best"]
"""The evaluation at a run's end, or that of its greatest validation score."""


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
