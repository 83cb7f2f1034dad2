"""Runs the command line as users do: in a process of its own."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

GIVE_UP_S = 120
"""[s] A command that hangs must not hang the tests; far beyond what any takes."""
TWINSCREW = (sys.executable, "-m", "twinscrew.runtime.cli")


def twinscrew(*words: object, **environment: str) -> subprocess.CompletedProcess[str]:
    """Run a command to its end."""
    return subprocess.run(
        [*TWINSCREW, *map(str, words)],
        capture_output=True,
        text=True,
        timeout=GIVE_UP_S,
        env=_environment(environment),
    )


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
