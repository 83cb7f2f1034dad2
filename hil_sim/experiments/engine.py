"""Episodes in parallel: joblib's loky on this machine, or a Ray cluster by the same interface.

Results come in the order of the tasks, so that a file of results does not depend on who was faster.
A worker that dies takes its episodes with it, and nothing else: they are sailed again.
"""

from __future__ import annotations

import importlib
import importlib.util
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from contextlib import AbstractContextManager, nullcontext
from typing import Any, Literal, TypeVar

from joblib import Parallel, delayed, parallel_config
from joblib.externals.loky.process_executor import TerminatedWorkerError

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
