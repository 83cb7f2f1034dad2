"""Runs the command line as users do: in a process of its own."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Any

from tests.harness.fork_server import MODULE, ForkServer

GIVE_UP_S = 250
"""[s] A command that hangs must not hang the tests; far beyond what any takes."""
TWINSCREW = (sys.executable, "-m", MODULE)
AT_START = ("PYTHON", "OMP_", "OPENBLAS_", "_TWINSCREW", "COMP_")
"""What is looked at while an interpreter, or a library, is loaded."""


def twinscrew(
    *words: object, fresh: bool = False, **environment: str
) -> subprocess.CompletedProcess[str]:
    """Run a command to its end, in a process of its own: forked, or a fresh one if so asked.

    A fresh one it is too where the environment says something to Python or to libraries.
    """
    told = [str(word) for word in words]
    if fresh or any(name.startswith(AT_START) for name in environment):
        return subprocess.run(
            [*TWINSCREW, *told],
            capture_output=True,
            text=True,
            timeout=GIVE_UP_S,
            env=_environment(environment),
        )
    return fork_server().run(told, _environment(environment), GIVE_UP_S)


@cache
def fork_server() -> ForkServer:
    """Give where this process's commands are started."""
    return ForkServer()


def start(*words: object, log: Path) -> subprocess.Popen[bytes]:
    """Start a command; what it says on standard error goes to a file."""
    with log.open("wb") as stream:
        return subprocess.Popen(
            [*TWINSCREW, *map(str, words)],
            stdout=subprocess.DEVNULL,
            stderr=stream,
            env=_environment({}),
        )


@contextmanager
def running(*words: object, log: Path) -> Iterator[subprocess.Popen[bytes]]:
    """Start a command as `start` does, and leave nothing of it behind."""
    process = start(*words, log=log)
    try:
        yield process
    finally:
        process.kill()
        process.wait()


def stop(process: subprocess.Popen[bytes], number: int = signal.SIGTERM) -> int:
    """Tell a command that still runs to stop; give its exit status."""
    assert process.poll() is None
    process.send_signal(number)
    return process.wait(GIVE_UP_S)


def as_json(finished: subprocess.CompletedProcess[str]) -> dict[str, Any]:
    """Give the one JSON object on standard output."""
    assert finished.stdout, finished.stderr
    answer: dict[str, Any] = json.loads(finished.stdout)
    return answer


def _environment(changes: dict[str, str]) -> dict[str, str]:
    return {**os.environ, "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", **changes}
