"""Learning curves: the evaluations of several runs, as mean and standard error over seeds."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np

from twinscrew.runtime.errors import ConfigError
from twinscrew.runtime.messages.types import Float64
from twinscrew.training import runs

Grouping = Literal["algorithm", "folder"]
QUANTITIES = {
    "cumulative_reward": "cumulative reward [-]",
    "success": "success rate [-]",
    "travel_time_s": "travel time [s]",
}
"""What is drawn, by the evaluation records' fields."""


class Curve(NamedTuple):
    """One quantity of one configuration over its transitions; T evaluations."""

    transitions: Float64
    """(T,) [-]"""
    mean: Float64
    """(T,) Over the seeds."""
    error: Float64
    """(T,) Standard error over the seeds; 0 for one seed."""
    seeds: int


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
    """Give those of `QUANTITIES` that all of some runs have logged: older versions told less."""
    told = [evaluations(folder)[0] for folder in folders]
    return {key: label for key, label in QUANTITIES.items() if all(key in first for first in told)}


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
