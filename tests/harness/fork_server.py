"""A process that has loaded what the command line needs, and forks for each command.

A command so started is a process like any other, with its own arguments, environment, signals and
exit status, but takes 0.1 s to begin instead of 1 s.
"""

from __future__ import annotations

import array
import gc
import importlib
import json
import os
import runpy
import socket
import subprocess
import sys
import tempfile
from contextlib import suppress
from pathlib import Path

ROOT = Path(__file__).parents[2]
MODULE = "twinscrew.runtime.cli"
PACKAGES = ("numpy", "msgspec", "typer", "zenoh", "scipy.stats", "matplotlib.pyplot")
"""What most commands load; none may start a thread by that, as onnxruntime does: forks lose it."""
LEARNING = ("train", "export")
"""The commands that load torch."""
ONE_THREAD = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
GREATEST_B = 1 << 20
"""[B] A request's size."""


class ForkServer:
    """Where commands are started; one is enough for all tests of a process."""

    def __init__(self) -> None:
        """Start it; it ends when its line is closed."""
        self._line, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        words = [sys.executable, "-m", "tests.harness.fork_server", str(theirs.fileno())]
        environment = {**os.environ, **ONE_THREAD, "PYTHONPATH": str(ROOT)}
        self._process = subprocess.Popen(
            words, pass_fds=[theirs.fileno()], env=environment, stdin=subprocess.DEVNULL
        )
        theirs.close()
        self.processor_s = 0.0
        """[s] Of processor, that all commands have taken."""

    def run(
        self, words: list[str], environment: dict[str, str], timeout_s: float
    ) -> subprocess.CompletedProcess[str]:
        """Run a command to its end.

        Raises
        ------
        TimeoutExpired
            It did not end; it is killed.
        """
        request = {"words": words, "environment": environment, "folder": str(Path.cwd())}
        with tempfile.TemporaryFile("w+") as out, tempfile.TemporaryFile("w+") as err:
            socket.send_fds(
                self._line, [json.dumps(request).encode()], [out.fileno(), err.fileno()]
            )
            self._line.settimeout(None)
            pid = int(self._line.recv(100) or "0")
            assert pid, "the fork server has ended, and says why on standard error"
            self._line.settimeout(timeout_s)
            try:
                status, processor_s = json.loads(self._line.recv(100))
            except TimeoutError:
                os.kill(pid, 9)
                self._line.settimeout(None)
                self._line.recv(100)
                raise subprocess.TimeoutExpired(words, timeout_s) from None
            self.processor_s += processor_s
            out.seek(0)
            err.seek(0)
            return subprocess.CompletedProcess(words, status, out.read(), err.read())


def _serve(line: socket.socket) -> None:
    """Fork for each request; return in the process that shall become the command."""
    for name in PACKAGES:
        importlib.import_module(name)
    from twinscrew.runtime.cli.main import find_command

    while True:
        data, files, _, _ = socket.recv_fds(line, GREATEST_B, 2)
        if not data:
            sys.exit(0)
        request = json.loads(data)
        for name in request["words"][:1]:
            with suppress(Exception):  # the command itself says what is wrong
                find_command(name)
                if name in LEARNING:
                    importlib.import_module("torch")
        if len(list(Path("/proc/self/task").iterdir())) > 1:
            raise RuntimeError("a package that the fork server has loaded starts threads")
        gc.freeze()
        pid = os.fork()
        if pid == 0:
            line.close()
            _become(request, files)
            return
        for file in files:
            os.close(file)
        line.send(str(pid).encode())
        _, status, used = os.wait4(pid, 0)
        answer = os.waitstatus_to_exitcode(status), used.ru_utime + used.ru_stime
        line.send(json.dumps(answer).encode())


def _become(request: dict[str, object], files: array.array[int]) -> None:
    """Take over a command's place, environment and files."""
    for number, file in enumerate(files, start=1):
        os.dup2(file, number)
        os.close(file)
    os.environ.clear()
    os.environ.update(request["environment"])
    os.chdir(request["folder"])
    sys.argv = [MODULE, *request["words"]]


if __name__ == "__main__":
    _serve(socket.socket(fileno=int(sys.argv[1])))

    runpy.run_module(MODULE, run_name="__main__", alter_sys=True)
