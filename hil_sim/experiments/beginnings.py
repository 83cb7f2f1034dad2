"""How every episode of an experiment begins, as a file: for other simulators to sail the same ones.

`twinscrew evaluate POLICY --on DIR` reads it, in the training environment.
"""

from __future__ import annotations

from pathlib import Path

import msgspec
import numpy as np

from twinscrew.hil_sim.experiments.plan import Experiment, episode_seed
from twinscrew.hil_sim.experiments.sets import SetSettings
from twinscrew.hil_sim.scenario import Scenario
from twinscrew.runtime.errors import RecordingError
from twinscrew.runtime.messages.types import Float64
from twinscrew.runtime.settings import Settings

FILE = "beginnings.json"
Row = tuple[float, ...]


class Beginning(Settings, frozen=True, kw_only=True):
    """How one episode begins; everything at rest."""

    starts: tuple[Row, ...]
    """[m, m, rad] North, east, heading of each vessel."""
    goals: tuple[Row, ...]
    """[m] North, east."""
    buoys: tuple[Row, ...]
    """[m] North, east, radius."""


class SetBeginnings(Settings, frozen=True, kw_only=True):
    """A set's episodes, in their order."""

    name: str
    episodes: tuple[Beginning, ...]


def beginnings(experiment: Experiment) -> tuple[SetBeginnings, ...]:
    """Give how the episodes of all sets begin: the same for every method and variant."""
    return tuple(
        SetBeginnings(
            name=one.name,
            episodes=tuple(_beginning(experiment, one, k) for k in range(experiment.episodes)),
        )
        for one in experiment.sets
    )


def write_beginnings(folder: Path, experiment: Experiment) -> None:
    """Leave `beginnings.json` in a results' folder, if it does not hold as many already.

    Raises
    ------
    RecordingError
        The disk is full, or failed.
    """
    path = folder / FILE
    try:
        if path.is_file() and _count(path) >= experiment.episodes:
            return
        scratch = path.with_suffix(".part")
        scratch.write_bytes(msgspec.json.encode({"sets": beginnings(experiment)}))
        scratch.replace(path)
    except OSError as error:
        raise RecordingError(f"{path}: {error.strerror or error}") from error


def _beginning(experiment: Experiment, one: SetSettings, episode: int) -> Beginning:
    scenario: Scenario = one.draw(episode_seed(experiment.seed, one.name, episode))
    return Beginning(
        starts=_rows(scenario.starts), goals=_rows(scenario.goals), buoys=_rows(scenario.buoys)
    )


def _rows(array: Float64) -> tuple[Row, ...]:
    return tuple(tuple(row) for row in np.asarray(array).tolist())


def _count(path: Path) -> int:
    """Give how many episodes a set of the file has; 0 if it is damaged."""
    try:
        sets = msgspec.json.decode(path.read_bytes())["sets"]
        return min(len(one["episodes"]) for one in sets)
    except (ValueError, KeyError, TypeError, RecursionError):
        return 0
