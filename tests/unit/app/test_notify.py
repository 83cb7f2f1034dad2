"""Signs of life for systemd."""

import os
import socket
import uuid

import pytest

from twinscrew.runtime.app.notify import ServiceManager


class Systemd:
    """The listening end."""

    def __init__(self, address):
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self._socket.bind(address)
        self._socket.setblocking(False)

    def heard(self):
        said = []
        while True:
            try:
                said.append(self._socket.recv(4096).decode().split("\n"))
            except BlockingIOError:
                return said

    def close(self):
        self._socket.close()


@pytest.fixture
def path(tmp_path):
    return str(tmp_path / "notify")


@pytest.fixture
def systemd(path):
    systemd = Systemd(path)
    yield systemd
    systemd.close()


def test_the_first_turn_of_the_loop_says_that_it_is_ready_once(systemd, path):
    manager = ServiceManager({"NOTIFY_SOCKET": path})
    for count in range(5):
        manager.alive(float(count), "standby")
    assert systemd.heard() == [["READY=1", "STATUS=standby"]]


def test_it_feeds_the_watchdog_often_enough_and_not_with_every_turn(systemd, path):
    manager = ServiceManager({"NOTIFY_SOCKET": path, "WATCHDOG_USEC": "2000000"})
    for turn in range(200):  # 10 s at 20 Hz
        manager.alive(100.0 + turn / 20.0, "active")
    fed = sum("WATCHDOG=1" in words for words in systemd.heard())
    assert 10 <= fed <= 20  # every 1 s would do, 0.5 s is meant


def test_a_loop_that_hangs_says_nothing(systemd, path):
    manager = ServiceManager({"NOTIFY_SOCKET": path, "WATCHDOG_USEC": "2000000"})
    manager.alive(0.0, "active")
    systemd.heard()
    assert systemd.heard() == []


def test_a_changed_status_is_told_at_once(systemd, path):
    manager = ServiceManager({"NOTIFY_SOCKET": path})
    for status in ("ready", "active", "active", "safe"):
        manager.alive(0.0, status)
    told = [words[-1] for words in systemd.heard()]
    assert told == ["STATUS=ready", "STATUS=active", "STATUS=safe"]


def test_the_end_is_told(systemd, path):
    ServiceManager({"NOTIFY_SOCKET": path}).stopping()
    assert systemd.heard() == [["STOPPING=1"]]


def test_an_abstract_socket_is_found():
    name = f"twinscrew-{uuid.uuid4()}"
    systemd = Systemd(f"\0{name}")
    ServiceManager({"NOTIFY_SOCKET": f"@{name}"}).alive(0.0, "ready")
    assert systemd.heard() == [["READY=1", "STATUS=ready"]]
    systemd.close()


def test_a_watchdog_meant_for_another_process_is_not_fed(systemd, path):
    environment = {"NOTIFY_SOCKET": path, "WATCHDOG_USEC": "1000000"}
    ServiceManager({**environment, "WATCHDOG_PID": "1"}).alive(0.0, "ready")
    ServiceManager({**environment, "WATCHDOG_PID": str(os.getpid())}).alive(0.0, "ready")
    others, ours = systemd.heard()
    assert "WATCHDOG=1" not in others
    assert "WATCHDOG=1" in ours


@pytest.mark.parametrize(
    "environment",
    [
        {},
        {"NOTIFY_SOCKET": ""},
        {"NOTIFY_SOCKET": "/nowhere/at/all"},
        {"WATCHDOG_USEC": "soon"},
        {"NOTIFY_SOCKET": "/nowhere", "WATCHDOG_USEC": "-5"},
    ],
)
def test_without_anybody_who_listens_nothing_happens(environment):
    manager = ServiceManager(environment)
    manager.alive(0.0, "active")
    manager.stopping()


def test_a_service_manager_that_does_not_read_holds_nothing_up(systemd, path):
    manager = ServiceManager({"NOTIFY_SOCKET": path})
    for turn in range(5000):
        manager.alive(0.0, str(turn))
    assert len(systemd.heard()) < 5000
