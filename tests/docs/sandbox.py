"""A folder in which the documentation's commands run: the sources, a run, a scan, a boat."""

from __future__ import annotations

import os
import re
import runpy
import shlex
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from tests.docs.commands import ROOT, Command
from tests.harness.commands import TWINSCREW

OWN = {"runs", "build", "dist", ".git", ".venv"}
"""What the sandbox has of its own, or not at all."""
PATIENCE_S = 400.0
"""[s] A command that hangs must not hang the tests; far beyond what any takes."""
BOAT = 'name = "wamv"\n[bus]\nconnect = []\n[autopilot]\nconnection = "udpout:127.0.0.1:9"\n'
INTERRUPTED = {130, -signal.SIGINT}
"""[-] How Ctrl-C ends a program that has not set itself up yet."""
RUN_PLACE = re.compile(r"runs/<\w+>")


def make_sandbox(folder: Path) -> Path:
    """Lay out a sandbox; it takes a run of three simulated seconds."""
    for path in ROOT.iterdir():
        if path.name not in OWN:
            (folder / path.name).symlink_to(path)
    (folder / "boat.toml").write_text(BOAT)
    smoke = runpy.run_path(str(ROOT / "deploy" / "smoke.py"))
    (folder / "scan.pcd").write_text(pcd(smoke["buoy"](8.0, 0.4)))
    words = [*TWINSCREW, "sitl", "--scenario", "crossing", "--lockstep", "--max-time", "3"]
    words += ["--out", "runs/first"]
    sailed = subprocess.run(words, cwd=folder, capture_output=True, text=True, timeout=PATIENCE_S)
    assert (folder / "runs" / "first" / "summary.json").is_file(), sailed.stderr
    return folder


def pcd(places: list[tuple[float, float, float]]) -> str:
    """Write points as an ASCII PCD file."""
    count = len(places)
    head = f"VERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH {count}\n"
    head += f"HEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS {count}\nDATA ascii\n"
    return head + "".join(f"{x:.4f} {y:.4f} {z:.4f}\n" for x, y, z in places)


def run(command: Command, folder: Path) -> str:
    """Run a command as its mark says; give what it said."""
    assert command.mark is not None
    words = RUN_PLACE.sub("runs/first", command.words)
    line = f"{words} {command.mark.added}".strip()
    with tempfile.TemporaryFile("w+") as said:
        process = subprocess.Popen(
            ["bash", "-c", f"exec {line}" if is_simple(line) else line],
            cwd=folder,
            env=environment(),
            stdout=said,
            stderr=subprocess.STDOUT,
        )
        try:
            if command.mark.until:
                wait_for(command.mark.until, said.fileno(), process)
                process.send_signal(signal.SIGINT)
            status = process.wait(PATIENCE_S)
        finally:
            process.kill()
        said.seek(0)
        words = said.read()
    meant = {command.mark.status} | (INTERRUPTED if command.mark.until else set())
    assert status in meant, f"{line}: status {status}:\n{words}"
    return words


def wait_for(word: str, file: int, process: subprocess.Popen[bytes]) -> None:
    """Wait until a command has said a word."""
    deadline_s = time.monotonic() + PATIENCE_S
    while word not in os.pread(file, 1_000_000, 0).decode():
        if process.poll() is not None:
            words = os.pread(file, 1_000_000, 0).decode()
            raise AssertionError(f"it ended before it said {word!r}:\n{words}")
        assert time.monotonic() < deadline_s, f"it never said {word!r}"
        time.sleep(0.1)


def is_simple(line: str) -> bool:
    """Tell whether a line is one program: then a signal reaches it, not its shell."""
    return not set(shlex.split(line)) & {"&&", "|", ">", ";"} and "=" not in line.split()[0]


def environment() -> dict[str, str]:
    """Give the environment that the README asks for: the installation's programs on the path."""
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    return {**os.environ, "PATH": path, "OMP_NUM_THREADS": "1", "COLUMNS": "120"}
