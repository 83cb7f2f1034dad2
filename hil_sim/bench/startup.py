"""From starting `twinscrew run` to its first command on the socket."""

from __future__ import annotations

import subprocess
import sys
import tempfile
import time
from pathlib import Path
from statistics import median
from typing import Any

import tomli_w

from twinscrew.hil_sim.drivers.processes import LOOPBACK
from twinscrew.runtime.errors import LinkError
from twinscrew.runtime.link.transport import UdpTransport
from twinscrew.runtime.mavlink import Wire

STARTS = 5
LIMIT_S = 20.0
COMMAND = "RC_CHANNELS_OVERRIDE"


def run() -> dict[str, Any]:
    """Measure: {"startup_s": median of five starts}."""
    return {"startup_s": round(median(_start_once() for _ in range(STARTS)), 3)}


def _start_once() -> float:
    listener = UdpTransport(LOOPBACK, 0, listens=True)
    with tempfile.TemporaryDirectory() as folder:
        config = Path(folder) / "runtime.toml"
        config.write_text(
            tomli_w.dumps(
                {
                    "autopilot": {"connection": f"udpout:{LOOPBACK}:{listener.port}"},
                    "bus": {"connect": []},
                }
            )
        )
        begin_s = time.monotonic()
        process = subprocess.Popen(
            [sys.executable, "-m", "twinscrew.runtime.cli", "run", "--config", str(config)],
            stderr=subprocess.DEVNULL,
        )
        try:
            _wait_for_command(listener, process, begin_s)
            return time.monotonic() - begin_s
        finally:
            process.terminate()
            process.wait()
            listener.close()


def _wait_for_command(
    listener: UdpTransport, process: subprocess.Popen[bytes], begin_s: float
) -> None:
    wire = Wire(255, 0)
    while time.monotonic() - begin_s < LIMIT_S:
        if any(message.get_type() == COMMAND for message in wire.decode(listener.receive())):
            return
        if process.poll() is not None:
            raise LinkError(f"the runtime ended with status {process.returncode}")
        time.sleep(0.001)
    raise LinkError(f"no command after {LIMIT_S:g} s")
