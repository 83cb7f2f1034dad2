"""Run the missing episodes of an experiment in parallel, or one of its episodes again.

joblib's loky backend works on this machine, Ray on a cluster. Results come in the order of the
tasks. A worker that dies takes its unfinished episodes with it; they are run again.
"""

from __future__ import annotations

import importlib
import importlib.util
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, TypeVar

from joblib import Parallel, delayed, parallel_config
from joblib.externals.loky.process_executor import TerminatedWorkerError

from twinscrew.hil_sim.experiments.episode import Sailed, sail_episode, sail_task
from twinscrew.hil_sim.experiments.plan import FULL, Experiment, Key, Task, check, label, tasks
from twinscrew.hil_sim.experiments.results import (
    RESULTS_FILE,
    EpisodeRecord,
    ResultsFile,
    read_folder,
    read_results,
    write_beginnings,
)
from twinscrew.hil_sim.figures import draw_trajectories
from twinscrew.runtime.errors import ConfigError, TwinscrewError, one_of

Engine = Literal["local", "ray"]
ENGINES = ("local", "ray")
DEATHS = 3
"""[-] Workers may die so often in a row, with no episode finished, before we give up."""
CHUNK = 8
"""[-] Episodes a job that Ray is given at once: what a crash of ours can cost there."""
T = TypeVar("T")
R = TypeVar("R")
Way = tuple[AbstractContextManager[Any], Callable[..., Iterator[Any]], type[Exception]]
"""How an engine works: its context, its results one by one, and what a dead worker raises."""


def check_engine(engine: str) -> Engine:
    """Give an engine by name; a `ConfigError` if there is none, or it is not installed."""
    if engine not in ENGINES:
        raise ConfigError(one_of(engine, ENGINES), key="--engine")
    if engine == "ray" and importlib.util.find_spec("ray") is None:
        raise ConfigError("Ray is not installed: pip install 'twinscrew[ray]'", key="--engine")
    return "ray" if engine == "ray" else "local"


def in_parallel(
    function: Callable[[T], R], tasks: Iterable[T], jobs: int, engine: Engine = "local"
) -> Iterator[R]:
    """Apply a function to every task in `jobs` processes; results come in the tasks' order.

    Raises
    ------
    TwinscrewError
        Workers keep dying.
    """
    waiting, deaths = deque(tasks), 0
    backend, results, death = _ray() if engine == "ray" else _local()
    with backend:
        while waiting:
            try:
                for result in results(function, tuple(waiting), jobs):
                    yield result
                    waiting.popleft()
                    deaths = 0
            except death as error:
                deaths += 1
                if deaths > DEATHS:
                    raise TwinscrewError(
                        f"a worker died {deaths} times in a row, last near {waiting[0]}; out of "
                        "memory? The episodes done are kept: --resume with fewer --jobs"
                    ) from error


def _one_by_one(function: Callable[[T], R], tasks: tuple[T, ...], jobs: int) -> Iterator[R]:
    parallel = Parallel(n_jobs=jobs, return_as="generator", batch_size=1, pre_dispatch="2*n_jobs")
    results: Iterator[R] = parallel(delayed(function)(task) for task in tasks)
    return results


def _by_chunks(function: Callable[[T], R], tasks: tuple[T, ...], jobs: int) -> Iterator[R]:
    """Work as `_one_by_one`, for a backend that only gives whole lists."""
    size = CHUNK * jobs
    for begin in range(0, len(tasks), size):
        chunk = tasks[begin : begin + size]
        yield from Parallel(n_jobs=jobs, batch_size=1)(delayed(function)(task) for task in chunk)


def _local() -> Way:
    return nullcontext(), _one_by_one, TerminatedWorkerError


def _ray() -> Way:
    ray: Any = importlib.import_module("ray")
    ray_joblib: Any = importlib.import_module("ray.util.joblib")
    if not ray.is_initialized():
        ray.init(log_to_driver=False)  # joins the cluster that RAY_ADDRESS names, if it does
    ray_joblib.register_ray()
    return parallel_config(backend="ray"), _by_chunks, ray.exceptions.RayActorError


# -- Sail what is missing of an experiment, and keep every episode as soon as it is done.

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
    with ResultsFile(folder / RESULTS_FILE) as file:
        done = {record.key for record in file.records}
        kept, total = len(done), count(experiment)
        if progress is not None:
            progress(kept, total)  # what was there before is no measure of speed
        missing = [task for task in tasks(experiment) if key_of(task) not in done]
        for record, tracks in in_parallel(sail_task, missing, jobs, engine):
            file.append(record, tracks)
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


# -- Sail one episode of an experiment again, alone, with recordings, by its line.


@dataclass(frozen=True, slots=True)
class Rerun:
    """An episode sailed again."""

    before: EpisodeRecord
    sailed: Sailed

    @property
    def same(self) -> bool:
        """True if every decision was the same, bit for bit."""
        return self.sailed.record.decisions_sha256 == self.before.decisions_sha256


def parse_line(text: str) -> tuple[Path, int]:
    """Read `DIR:LINE`; lines count from 1, as editors and grep count them."""
    folder, colon, number = text.rpartition(":")
    if not colon or not number.isdigit() or int(number) < 1:
        raise ConfigError(f"must be DIR:LINE, as out/paper:17, got {text!r}", key="--rerun")
    return Path(folder), int(number)


def find(folder: Path, line: int) -> tuple[Experiment, EpisodeRecord]:
    """Give an experiment, and the episode in a line of its results.

    Raises
    ------
    ConfigError
        It is no results' folder, or has no such line.
    RecordingError
        Its results are damaged.
    """
    experiment = read_folder(folder).experiment
    records = read_results(folder / RESULTS_FILE)
    if line > len(records):
        raise ConfigError(f"there are {len(records)} episodes, none in line {line}", file=folder)
    return experiment, records[line - 1]


def rerun(experiment: Experiment, record: EpisodeRecord, folder: Path | None = None) -> Rerun:
    """Sail an episode again; with a folder, recordings and a figure are left in it.

    Raises
    ------
    PolicyError
        The method's policy is not any more what it was.
    """
    task = task_of(experiment, record)
    check(task.method)
    sailed = sail_episode(task, folder)
    if folder is not None:
        draw(folder / "trajectories.png", sailed)
    return Rerun(record, sailed)


def draw(path: Path, sailed: Sailed) -> None:
    """Draw an episode's trajectories."""
    vessels = sailed.record.vessels
    draw_trajectories(
        path,
        sailed.scenario,
        sailed.voyage.log,
        [vessel.outcome for vessel in vessels],
        [vessel.travel_time_s for vessel in vessels],
    )


def task_of(experiment: Experiment, record: EpisodeRecord) -> Task:
    """Give what an episode was made of."""
    method = next(one for one in experiment.methods if one.name == record.method)
    chosen = next(one for one in experiment.sets if one.name == record.set)
    switches = () if record.variant == FULL else tuple(record.variant.split("+"))
    return Task(method, chosen, switches, record.episode, record.seed, experiment.sensor)
