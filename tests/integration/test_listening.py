"""Nothing listens beyond this machine unless it was told to: the sockets of real processes."""

import ipaddress
import json
import signal
import socket
from collections.abc import Iterator
from pathlib import Path

import psutil
import pytest
from tests.harness.commands import start
from tests.harness.waiting import wait_until

from twinscrew.hil_sim.drivers.processes import free_port

pytestmark = pytest.mark.slow


def open_to(process: psutil.Process) -> set[tuple[str, str, int]]:
    """Where a process and its children can be reached: TCP that listens, UDP that is bound."""
    found = set()
    for one in (process, *process.children(recursive=True)):
        for connection in one.net_connections(kind="inet"):
            udp = connection.type == socket.SOCK_DGRAM
            if udp or connection.status == psutil.CONN_LISTEN:
                found.add(("udp" if udp else "tcp", connection.laddr.ip, connection.laddr.port))
    return found


def beyond_this_machine(process: psutil.Process) -> list[tuple[str, str, int]]:
    return [at for at in open_to(process) if not ipaddress.ip_address(at[1]).is_loopback]


@pytest.fixture
def log(tmp_path: Path) -> Path:
    return tmp_path / "log.txt"


def running(log: Path, *words: object) -> Iterator[psutil.Process]:
    process = start(*words, log=log)
    try:
        wait_until(lambda: "running" in log.read_text() or process.poll() is not None)
        assert process.poll() is None, log.read_text()
        yield psutil.Process(process.pid)
    finally:
        process.kill()
        process.wait()


def configured(folder: Path, text: str = "") -> Path:
    """A boat's file with all defaults but the number of the autopilot's port."""
    path = folder / "boat.toml"
    path.write_text(f'[autopilot]\nconnection = "udpin:127.0.0.1:0"\n{text}')
    return path


def test_the_runtime_by_its_defaults(tmp_path: Path, log: Path) -> None:
    for process in running(log, "run", "--config", configured(tmp_path)):
        ports = open_to(process)
        assert [(kind, address) for kind, address, _ in ports] == [("udp", "127.0.0.1")]
        assert beyond_this_machine(process) == []


def test_the_runtime_with_a_file_for_zenoh_that_says_nothing_of_listening(
    tmp_path: Path, log: Path
) -> None:
    """Zenoh's own default would be every address."""
    (tmp_path / "zenoh.json5").write_text('{mode: "peer"}')
    config = configured(tmp_path, f'[bus]\nconfig_file = "{tmp_path / "zenoh.json5"}"\n')
    for process in running(log, "run", "--config", config):
        assert beyond_this_machine(process) == []


def test_by_comparison_the_runtime_listens_where_it_was_told_to(tmp_path: Path, log: Path) -> None:
    port = free_port()
    config = configured(tmp_path, f'[bus]\nconnect = []\nlisten = ["tcp/0.0.0.0:{port}"]\n')
    for process in running(log, "run", "--config", config):
        assert beyond_this_machine(process) == [("tcp", "0.0.0.0", port)]  # noqa: S104


def test_a_simulated_fleet_with_its_live_view(tmp_path: Path, log: Path) -> None:
    out = tmp_path / "run"
    words = ("sitl", "--vessels", 2, "--buoys", 0, "--view", "--port", 0, "--out", out)
    process = start(*words, "--max-time", 20, log=log)
    fleet = psutil.Process(process.pid)
    try:
        wait_until(lambda: process.poll() is not None or " s  " in log.read_text())
        assert process.poll() is None, log.read_text()
        ports = open_to(fleet)
        kinds = sorted(kind for kind, _, _ in ports)
        # Zenoh and the page listen by TCP; two autopilots and two runtimes talk by UDP.
        assert kinds == ["tcp", "tcp", "udp", "udp", "udp", "udp"], json.dumps(sorted(ports))
        assert beyond_this_machine(fleet) == []
    finally:
        process.send_signal(signal.SIGINT)
        process.wait()
