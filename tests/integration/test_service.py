"""`twinscrew run` as systemd sees it: a real process, a real notification socket."""

import os
import signal
import socket
import subprocess
import sys
import time

import pytest

pytestmark = pytest.mark.slow

WATCHDOG_S = 1.0
PATIENCE_S = 200.0


@pytest.fixture
def systemd(tmp_path):
    """The socket that a service talks to."""
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as line:
        line.bind(str(tmp_path / "notify"))
        yield line


@pytest.fixture
def service(systemd, tmp_path):
    config = tmp_path / "boat.toml"
    config.write_text(
        'name = "wamv"\n[bus]\nconnect = []\n[autopilot]\nconnection = "udpout:127.0.0.1:9"\n'
    )
    environment = {
        **os.environ,
        "NOTIFY_SOCKET": systemd.getsockname(),
        "WATCHDOG_USEC": str(round(WATCHDOG_S * 1e6)),
    }
    environment.pop("WATCHDOG_PID", None)
    command = [sys.executable, "-m", "twinscrew.runtime.cli", "run", "--config", str(config)]
    process = subprocess.Popen(command, env=environment, stderr=subprocess.DEVNULL)
    yield process
    process.kill()
    process.wait()


def hear(systemd, word, patience_s=PATIENCE_S):
    """Listen until a word is said; give everything that was."""
    said, deadline_s = [], time.monotonic() + patience_s
    while word not in said:
        systemd.settimeout(max(0.01, deadline_s - time.monotonic()))
        said += systemd.recv(4096).decode().split("\n")
    return said


def test_a_runtime_that_loops_says_so_and_one_that_hangs_falls_silent(systemd, service):
    said = hear(systemd, "READY=1")
    assert said[0] == "READY=1"
    assert "STATUS=standby" in said or "STATUS=standby" in hear(systemd, "STATUS=standby")
    for _ in range(3):
        hear(systemd, "WATCHDOG=1")

    service.send_signal(signal.SIGSTOP)
    time.sleep(0.2)
    systemd.setblocking(False)
    while True:  # what was said before it hung
        try:
            systemd.recv(4096)
        except BlockingIOError:
            break
    with pytest.raises(TimeoutError):
        hear(systemd, "WATCHDOG=1", patience_s=1.5 * WATCHDOG_S)

    service.send_signal(signal.SIGCONT)
    hear(systemd, "WATCHDOG=1")
    service.terminate()
    hear(systemd, "STOPPING=1")
    assert service.wait(PATIENCE_S) == 0
