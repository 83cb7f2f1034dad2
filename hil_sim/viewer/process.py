"""A viewer beside a run: a process of its own, so that it cannot hold up anything."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Literal

from twinscrew.hil_sim.children import end, undisturbed
from twinscrew.runtime.errors import ConfigError

STOP_LIMIT_S = 3.0
"""[s] How long it may take to stop."""


class Viewer:
    """A running viewer."""

    def __init__(self, process: subprocess.Popen[str]) -> None:
        self._process = process
        stream = process.stdout
        self.url = stream.readline().strip() if stream is not None else ""
        """Where its page is."""
        if not self.url:
            process.wait()
            raise ConfigError("the viewer did not start; what it said stands above", key="--view")

    def wait(self) -> None:
        """Wait until somebody stops it."""
        self._process.wait()


@contextmanager
def viewer(
    way: Literal["run", "replay"], folder: Path, port: int, *, orders: bool = False
) -> Iterator[Viewer]:
    """Have a viewer look at a run or its recordings inside the context.

    Parameters
    ----------
    orders
        Whether its page may give goals.

    Raises
    ------
    ConfigError
        It does not start: the port is in use.
    """
    command = [sys.executable, "-m", "twinscrew.runtime.cli", "view"]
    command += [f"--{way}", str(folder), "--port", str(port)]
    command += ["--tethered", *(["--orders"] if orders else [])]
    with ExitStack() as stack:
        with undisturbed():
            process = subprocess.Popen(
                command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
            )
            stack.callback(end, process, STOP_LIMIT_S)
        yield Viewer(process)
