"""A vessel's runtime as a process: its ports, its priority, its life and its output.

The simulator stands for sensors and autopilots, so it asks for a real-time priority. What starts
does so at ordinary priority: a second of imports would use up what the kernel grants real-time
programs (95 % of every second), and everybody would be held up for the rest of it.
"""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import msgspec
import tomli_w

from twinscrew.hil_sim.children import end_all
from twinscrew.hil_sim.last_words import ended
from twinscrew.runtime.errors import ConfigError
from twinscrew.runtime.vessel import consent
from twinscrew.runtime.vessel.config import RuntimeConfig

FIFO = 5
"""[-] Real-time priority, below the runtimes': a LiDAR is not late because a program is busy."""


@contextmanager
def punctual() -> Iterator[None]:
    """Have real-time priority inside it, where the system allows; threads inherit it."""
    before = os.sched_getscheduler(0), os.sched_getparam(0)
    be_punctual()
    try:
        yield
    finally:
        os.sched_setscheduler(0, *before)


@contextmanager
def ordinary() -> Iterator[None]:
    """Have ordinary priority inside it: for starting programs, which inherit it."""
    before = os.sched_getscheduler(0), os.sched_getparam(0)
    os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
    try:
        yield
    finally:
        os.sched_setscheduler(0, *before)


def be_punctual() -> None:
    """Take real-time priority for good, where the system allows."""
    with suppress(PermissionError):
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(FIFO))


def is_punctual() -> bool:
    """Tell whether this thread has real-time priority."""
    return os.sched_getscheduler(0) == os.SCHED_FIFO


# -- Ports of this machine.

LOOPBACK = "127.0.0.1"


def free_port() -> int:
    """Give a TCP port that nobody uses now."""
    with socket.socket() as probe:
        probe.bind((LOOPBACK, 0))
        return int(probe.getsockname()[1])


# -- A vessel's runtime as a process: what it is told, its life, and what it says.

START_LIMIT_S = 20.0
"""[s] How long a runtime may take to listen."""
STOP_LIMIT_S = 5.0
"""[s] How long runtimes may take to stop."""
CONFIG_FILE = "runtime.toml"
LOG_FILE = "log.txt"
"""In the vessel's folder: what its runtime is told, and what it says."""


class RuntimeProcess:
    """Starts a runtime, and knows whether it should be running."""

    def __init__(self, config: RuntimeConfig, folder: Path) -> None:
        """Write the configuration, and start.

        Parameters
        ----------
        config
            All that the runtime is told.
        folder
            Where its configuration and its log are written.

        Raises
        ------
        ConfigError
            A name is no text, as a folder's of another encoding: TOML cannot tell it.
        """
        self._name = config.name
        self._folder = folder
        folder.mkdir(parents=True, exist_ok=True)
        text = tomli_w.dumps(_without_none(msgspec.to_builtins(config)))
        try:
            (folder / CONFIG_FILE).write_bytes(text.encode())
        except UnicodeEncodeError as error:
            raise ConfigError("must have a name in UTF-8", file=folder) from error
        if config.autopilot.arm:  # who starts a simulation says so; who starts it again does not
            consent.give(consent.place_of(folder / CONFIG_FILE, config.autopilot.consent_file))
        self.process = self._started()
        self.down = False
        """Whether it was killed, and not started again."""

    @property
    def pid(self) -> int:
        """Its process id."""
        return self.process.pid

    def check(self) -> None:
        """Raise a `LinkError` with the end of the log if it has ended by itself."""
        if not self.down and self.process.poll() is not None:
            log = (self._folder / LOG_FILE).read_bytes()
            raise ended(f"the runtime of {self._name}", self.process, log)

    def kill(self) -> None:
        """Kill it as hard as can be; that is no error until it is started again."""
        self.down = True
        self.process.kill()
        self.process.wait()
        self.let_go()

    def start_again(self) -> None:
        """Start it after it was killed."""
        self.process = self._started()
        self.down = False

    def signal(self, number: signal.Signals) -> None:
        """Send it a signal."""
        self.process.send_signal(number)

    def let_go(self) -> None:
        """Close our end of its input."""
        if self.process.stdin is not None:
            self.process.stdin.close()

    def _started(self) -> subprocess.Popen[bytes]:
        file = str(self._folder / CONFIG_FILE)
        command = [sys.executable, "-m", "twinscrew.runtime.cli", "run", "--config", file]
        command += ["--tethered"]  # it ends with this process, whose end of its input then closes
        with (self._folder / LOG_FILE).open("ab") as log, ordinary():
            return subprocess.Popen(command, stdin=subprocess.PIPE, stdout=log, stderr=log)


def see_off(runtimes: Sequence[RuntimeProcess]) -> None:
    """Ask several to stop, also those that were held still, and see to it that they have."""
    for runtime in runtimes:
        runtime.signal(signal.SIGCONT)
    end_all([runtime.process for runtime in runtimes], STOP_LIMIT_S)
    for runtime in runtimes:
        runtime.let_go()


def _without_none(values: dict[str, Any]) -> dict[str, Any]:
    """Leave out what is not set: TOML has no word for it."""
    return {
        key: _without_none(value) if isinstance(value, dict) else value
        for key, value in values.items()
        if value is not None
    }
