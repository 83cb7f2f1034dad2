"""A vessel's runtime as a process: what it is told, its life, and what it says."""

from __future__ import annotations

import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import msgspec
import tomli_w

from twinscrew.hil_sim.children import end
from twinscrew.hil_sim.drivers.punctual import ordinary
from twinscrew.hil_sim.last_words import ended
from twinscrew.runtime.app.config import RuntimeConfig
from twinscrew.runtime.errors import ConfigError

START_LIMIT_S = 20.0
"""[s] How long a runtime may take to listen."""
STOP_LIMIT_S = 5.0
"""[s] How long it may take to stop."""
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
        self._process = self._started()
        self.down = False
        """Whether it was killed, and not started again."""

    @property
    def pid(self) -> int:
        """Its process id."""
        return self._process.pid

    def check(self) -> None:
        """Raise a `LinkError` with the end of the log if it has ended by itself."""
        if not self.down and self._process.poll() is not None:
            log = (self._folder / LOG_FILE).read_bytes()
            raise ended(f"the runtime of {self._name}", self._process, log)

    def kill(self) -> None:
        """Kill it as hard as can be; that is no error until it is started again."""
        self.down = True
        self._process.kill()
        self._process.wait()
        self._let_go()

    def start_again(self) -> None:
        """Start it after it was killed."""
        self._process = self._started()
        self.down = False

    def signal(self, number: signal.Signals) -> None:
        """Send it a signal."""
        self._process.send_signal(number)

    def ask_to_stop(self) -> None:
        """Ask it to stop, also if it was held still."""
        self._process.send_signal(signal.SIGCONT)
        self._process.terminate()

    def see_off(self) -> None:
        """Wait until it has ended, and see to that."""
        end(self._process, STOP_LIMIT_S)
        self._let_go()

    def _let_go(self) -> None:
        """Close our end of its input."""
        if self._process.stdin is not None:
            self._process.stdin.close()

    def _started(self) -> subprocess.Popen[bytes]:
        file = str(self._folder / CONFIG_FILE)
        command = [sys.executable, "-m", "twinscrew.runtime.app", "run", "--config", file]
        command += ["--tethered"]  # it ends with this process, whose end of its input then closes
        with (self._folder / LOG_FILE).open("ab") as log, ordinary():
            return subprocess.Popen(command, stdin=subprocess.PIPE, stdout=log, stderr=log)


def _without_none(values: dict[str, Any]) -> dict[str, Any]:
    """Leave out what is not set: TOML has no word for it."""
    return {
        key: _without_none(value) if isinstance(value, dict) else value
        for key, value in values.items()
        if value is not None
    }
