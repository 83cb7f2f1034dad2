"""Sail what is missing of an experiment, and keep every episode as soon as it is done."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from twinscrew.hil_sim.experiments.ablations import label
from twinscrew.hil_sim.experiments.beginnings import write_beginnings
from twinscrew.hil_sim.experiments.engine import Engine, in_parallel
from twinscrew.hil_sim.experiments.episode import sail_task
from twinscrew.hil_sim.experiments.plan import Experiment, Key, Task, check, tasks
from twinscrew.hil_sim.experiments.record import EpisodeRecord
from twinscrew.hil_sim.experiments.results import FILE, ResultsFile

Progress = Callable[[int, int], None]
"""Told how many episodes are done, and how many there are."""


@dataclass(frozen=True, slots=True)
class Finished:
    """A whole experiment's results."""

    records: list[EpisodeRecord]
    kept: int
    """[-] Episodes that were there before."""


def run(
    experiment: Experiment,
    folder: Path,
    jobs: int,
    engine: Engine = "local",
    progress: Progress | None = None,
) -> Finished:
    """Sail an experiment's missing episodes into its folder.

    Raises
    ------
    PolicyError
        A policy has changed since the experiment was begun.
    RecordingError
        The results cannot be read or written.
    TwinscrewError
        An episode could not be sailed, or workers keep dying. What is done is kept.
    """
    for method in experiment.methods:
        check(method)
    write_beginnings(folder, experiment)
    with ResultsFile(folder / FILE) as file:
        done = {record.key for record in file.records}
        kept, total = len(done), count(experiment)
        if progress is not None:
            progress(kept, total)  # what was there before is no measure of speed
        missing = [task for task in tasks(experiment) if key_of(task) not in done]
        for record in in_parallel(sail_task, missing, jobs, engine):
            file.append(record)
            if progress is not None:
                progress(len(file.records), total)
        return Finished(list(file.records), kept)


def count(experiment: Experiment) -> int:
    """Give how many episodes an experiment has."""
    kinds = len(experiment.methods) * len(experiment.sets) * len(experiment.variants)
    return kinds * experiment.episodes


def key_of(task: Task) -> Key:
    """Give which episode a task is."""
    return Key(task.method.name, task.set.name, label(task.switches), task.episode)
