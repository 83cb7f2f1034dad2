"""Workers that are slow, that fail, and that die."""

import importlib.util
import os
import signal
import sys
import time
from functools import partial
from pathlib import Path

import cloudpickle
import pytest

from twinscrew.hil_sim.experiments.runner import DEATHS, check_engine, in_parallel
from twinscrew.runtime.errors import ConfigError, TwinscrewError

# Workers cannot import tests: they get these functions by their code.
cloudpickle.register_pickle_by_value(sys.modules[__name__])


def square(number: int) -> int:
    time.sleep(0.05 if number == 0 else 0.0)
    return number * number


def die_once(marks: Path, number: int) -> int:
    mark = marks / str(number)
    if number % 3 == 2 and not mark.exists():
        mark.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return number


def die(number: int) -> int:
    if number == 2:
        time.sleep(0.3)
        os.kill(os.getpid(), signal.SIGKILL)
    return number


def fail(number: int) -> int:
    if number == 2:
        raise TwinscrewError("no such sea")
    return number


@pytest.mark.parametrize("jobs", [1, 2])
def test_results_come_in_the_order_of_the_tasks(jobs: int) -> None:
    assert list(in_parallel(square, range(7), jobs)) == [n * n for n in range(7)]


def test_no_task_is_lost_or_done_twice_when_workers_are_killed(tmp_path: Path) -> None:
    results = list(in_parallel(partial(die_once, tmp_path), range(8), 2))
    assert results == list(range(8))
    assert {mark.name for mark in tmp_path.iterdir()} == {"2", "5"}  # both did die


@pytest.mark.slow
def test_a_task_that_kills_every_worker_is_given_up_and_what_was_done_is_kept() -> None:
    results = in_parallel(die, range(4), 2)
    assert [next(results), next(results)] == [0, 1]
    with pytest.raises(TwinscrewError, match=f"died {DEATHS + 1} times in a row, last near 2"):
        next(results)


@pytest.mark.parametrize("jobs", [1, 2])
def test_an_error_in_a_worker_reaches_the_user_as_it_is(jobs: int) -> None:
    with pytest.raises(TwinscrewError, match="no such sea"):
        list(in_parallel(fail, range(4), jobs))


def test_an_unknown_engine_is_refused() -> None:
    with pytest.raises(ConfigError, match="'dask' is not one of 'local', 'ray'"):
        check_engine("dask")


@pytest.mark.skipif(importlib.util.find_spec("ray") is not None, reason="Ray is installed")
def test_ray_is_asked_for_where_it_is_not_installed() -> None:
    with pytest.raises(ConfigError, match=r"twinscrew\[ray\]"):
        check_engine("ray")
