"""However `twinscrew sitl` ends, its runtimes end with it."""

import os
import signal
import subprocess
import time
from pathlib import Path

import pytest
from tests.harness.commands import TWINSCREW

pytestmark = pytest.mark.slow

PATIENCE_S = 200.0
"""[s] Far beyond what anything here takes: what hangs must not hang the tests."""


def runtimes(folder: Path) -> list[int]:
    """Give the processes that run with a configuration in this folder."""
    found = []
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit():
            try:
                words = (entry / "cmdline").read_bytes().decode(errors="replace").split("\0")
            except OSError:
                continue  # it has just ended
            if "run" in words and any(word.startswith(str(folder)) for word in words):
                found.append(int(entry.name))
    return found


def wait_until(is_so, what: str) -> None:
    deadline_s = time.monotonic() + PATIENCE_S
    while not is_so():
        assert time.monotonic() < deadline_s, what
        time.sleep(0.05)


@pytest.mark.parametrize(
    ("number", "status"),
    [
        (signal.SIGINT, 130),
        (signal.SIGTERM, 128 + signal.SIGTERM),
        (signal.SIGKILL, -signal.SIGKILL),
    ],
)
@pytest.mark.parametrize("running", [1, 3])
def test_runtimes_end_with_the_simulator(tmp_path, number, status, running):
    """Killed while it starts its three runtimes, or when all of them run."""
    folder = tmp_path / "run"
    words = [*TWINSCREW, "sitl", "--vessels", "3", "--seed", "1", "--out", str(folder)]
    process = subprocess.Popen(words, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        wait_until(lambda: len(runtimes(folder)) >= running, "the runtimes never started")
        process.send_signal(number)
        assert process.wait(PATIENCE_S) == status
        wait_until(lambda: not runtimes(folder), "runtimes were left behind")
    finally:
        process.kill()
        for left in runtimes(folder):
            os.kill(left, signal.SIGKILL)
