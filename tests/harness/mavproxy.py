"""MAVProxy as a process: a real ground station at its command line, without any window."""

from __future__ import annotations

import os
import socket
import subprocess
import sys
import threading
import time
from pathlib import Path
from typing import Self

from tests.harness.waiting import wait_until

PROGRAM = Path(sys.executable).with_name("mavproxy.py")
MODULES = "wp,fence,param,mode,arm,cmdlong,link,misc"
"""Those that need neither a window nor the network."""
LOOK_S = 0.3
"""[s] Between two looks."""


class MavProxy:
    """Listens for vehicles on a UDP port, and does what is typed; a context."""

    def __init__(self, folder: Path) -> None:
        self.address = f"127.0.0.1:{free_udp_port()}"
        self._folder = folder
        self._lines: list[str] = []

    def __enter__(self) -> Self:
        words = (f"--master=udpin:{self.address}", f"--default-modules={MODULES}")
        words += ("--nowait", "--force-connected", f"--state-basedir={self._folder}")
        self._process = subprocess.Popen(
            [sys.executable, str(PROGRAM), *words],
            cwd=self._folder,
            env={**os.environ, "HOME": str(self._folder), "PYTHONUNBUFFERED": "1"},
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            errors="replace",
        )
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._process.kill()
        self._reader.join()
        self._process.__exit__(None, None, None)  # closes the pipes, and waits

    @property
    def said(self) -> str:
        """Everything that it has printed."""
        return "".join(self._lines)

    def type(self, line: str, answer: str) -> None:
        """Type a command; wait until it prints something new with this in it."""
        before = len(self._lines)
        self._write(line)
        self.hears(answer, before)

    def look(self, line: str, answer: str) -> None:
        """Type a command that shows something, again and again until it shows this."""
        before = len(self._lines)

        def shows() -> bool:
            self._write(line)
            time.sleep(LOOK_S)
            return answer in "".join(self._lines[before:])

        wait_until(shows)

    def hears(self, words: str, since: int = 0) -> None:
        """Wait until it prints something."""

        def look() -> bool:
            assert self._process.poll() is None, f"MAVProxy ended: {self.said}"
            return words in "".join(self._lines[since:])

        try:
            wait_until(look)
        except AssertionError as error:
            raise AssertionError(f"{words!r} was never printed: {self.said}") from error

    def _write(self, line: str) -> None:
        assert self._process.stdin is not None
        self._process.stdin.write(line + "\n")
        self._process.stdin.flush()

    def _read(self) -> None:
        assert self._process.stdout is not None
        self._lines.extend(iter(self._process.stdout.readline, ""))


def free_udp_port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])
