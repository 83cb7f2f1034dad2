"""Priorities are taken in a process of its own: the tests' would keep them."""

from __future__ import annotations

import gc
import json
import os
import signal
import socket
import subprocess
import sys
import threading
import uuid
import weakref
from collections.abc import Callable, Iterator
from types import FrameType
from typing import Any

import pytest

from twinscrew.runtime.vessel.process import (
    EVERY_S,
    OLD_EVERY,
    Garbage,
    ServiceManager,
    StopRequest,
)

TAKE = """
import json, os, resource, sys, threading
from twinscrew.runtime.vessel.process import PrioritySettings, take_priority
if {unprivileged}:
    resource.setrlimit(resource.RLIMIT_RTPRIO, (0, 0))
    resource.setrlimit(resource.RLIMIT_NICE, (0, 0))
    os.setresuid(65534, 65534, 65534)
refused = take_priority(PrioritySettings({settings}))
seen = {{}}
def look():
    seen["fifo"] = os.sched_getscheduler(0) == os.SCHED_FIFO
    seen["nice"] = os.getpriority(os.PRIO_PROCESS, 0)
    seen["cpus"] = sorted(os.sched_getaffinity(0))
thread = threading.Thread(target=look)
thread.start()
thread.join()
print(json.dumps({{"refused": refused, "switch_s": sys.getswitchinterval(), **seen}}))
"""


def taken(settings: str, *, unprivileged: bool = False):
    code = TAKE.format(settings=settings, unprivileged=unprivileged)
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    return json.loads(done.stdout)


def may_be_urgent() -> bool:
    return not taken("fifo=1")["refused"]


def test_threads_that_start_later_inherit_priority_and_cores() -> None:
    seen = taken("fifo=10, cpus=(0,)")
    assert seen["cpus"] == [0]
    if may_be_urgent():
        assert seen["refused"] == []
        assert seen["fifo"] is True
    else:
        assert "SCHED_FIFO 10" in seen["refused"][0]


def test_without_real_time_priority_it_is_a_nice_value() -> None:
    seen = taken("fifo=0, nice=5")
    assert seen["fifo"] is False
    assert seen["nice"] == 5
    assert seen["refused"] == []


def test_threads_take_turns_ten_times_as_often_as_usual() -> None:
    assert taken("fifo=0, nice=0")["switch_s"] <= 0.0005


def test_cores_that_do_not_exist_are_told_and_no_error() -> None:
    (words,) = taken("fifo=0, nice=0, cpus=(1023,)")["refused"]
    assert words.startswith("cores 1023: ")


def test_what_the_system_refuses_is_told_and_no_error() -> None:
    if not may_be_urgent():
        refused = taken("fifo=10, nice=-10")["refused"]
    else:
        refused = taken("fifo=10, nice=-10", unprivileged=True)["refused"]
    assert [words.split(":")[0] for words in refused] == ["SCHED_FIFO 10", "nice -10"]


# --


class Knot:
    """Something that only the collector can free."""

    def __init__(self) -> None:
        self.itself = self


def test_inside_it_the_collector_runs_only_when_told_to() -> None:
    with Garbage() as garbage:
        garbage.collect(0.0)
        knot = weakref.ref(Knot())
        for _ in range(20_000):
            Knot()
        assert knot() is not None
        assert not garbage.collect(0.5 * EVERY_S)
        assert knot() is not None
        assert garbage.collect(EVERY_S)
        assert knot() is None


def test_what_grew_old_is_collected_in_the_end() -> None:
    with Garbage() as garbage:
        knot = Knot()
        watched = weakref.ref(knot)
        for second in range(3):
            garbage.collect(second * EVERY_S)
        del knot
        garbage.collect(3 * EVERY_S)
        assert watched() is not None
        for second in range(4, OLD_EVERY + 1):
            garbage.collect(second * EVERY_S)
        assert watched() is None


@pytest.mark.parametrize("enabled", [True, False])
def test_afterwards_everything_is_as_before(enabled: bool) -> None:
    frozen = gc.get_freeze_count()
    if not enabled:
        gc.disable()
    try:
        with Garbage():
            assert not gc.isenabled()
            assert gc.get_freeze_count() > frozen
        assert gc.isenabled() is enabled
        assert gc.get_freeze_count() == frozen
    finally:
        gc.enable()


# -- Signs of life for systemd.


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


# --


@pytest.fixture
def number() -> Iterator[signal.Signals]:
    before = signal.getsignal(signal.SIGUSR1)
    yield signal.SIGUSR1
    signal.signal(signal.SIGUSR1, before)


def signalled_at_every_line(number: signal.Signals, do: Callable[[], object]) -> int:
    """Call something, and send a signal at each of its lines; give how often one was sent."""
    sent = 0

    def trace(frame: FrameType, event: str, argument: object) -> Any:
        nonlocal sent
        if event == "line":
            sys.settrace(None)  # not in the handler itself, or it would never end
            sent += 1
            signal.raise_signal(number)
            sys.settrace(trace)
        return trace

    sys.settrace(trace)
    try:
        do()
    finally:
        sys.settrace(None)
    return sent


def test_nobody_asks_at_first() -> None:
    assert not StopRequest()()


def test_a_request_stays_also_from_another_thread() -> None:
    stop = StopRequest()
    thread = threading.Thread(target=stop.make)
    thread.start()
    thread.join()
    assert stop()
    stop.make()
    assert stop()


def test_a_handler_may_be_interrupted_by_itself_anywhere(number: signal.Signals) -> None:
    stop = StopRequest()
    signal.signal(number, stop.make)
    assert signalled_at_every_line(number, stop.make) >= 1
    assert stop()


# --

TETHERED = """
import sys, threading
from twinscrew.runtime.vessel.process import at_end_of_input
ended = threading.Event()
at_end_of_input(ended.set)
print("waits" if not ended.wait(0.2) else "ended", flush=True)
print("ended" if ended.wait(60) else "waits", flush=True)
"""


def test_it_tells_when_the_other_end_of_the_input_closes_and_not_before():
    with subprocess.Popen(
        [sys.executable, "-c", TETHERED],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    ) as process:
        assert process.stdin is not None
        assert process.stdout is not None
        process.stdin.write("what is said there means nothing\n")
        process.stdin.flush()
        assert process.stdout.readline() == "waits\n"
        process.stdin.close()
        assert process.stdout.readline() == "ended\n"


def test_without_an_input_it_tells_at_once():
    said = subprocess.run(
        ["bash", "-c", 'exec "$0" -c "$1" <&-', sys.executable, TETHERED],
        capture_output=True,
        text=True,
        check=True,
    )
    assert said.stdout.split() == ["ended", "ended"]
