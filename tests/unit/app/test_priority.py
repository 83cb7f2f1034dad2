"""Priorities are taken in a process of its own: the tests' would keep them."""

import json
import subprocess
import sys

TAKE = """
import json, os, resource, sys, threading
from twinscrew.runtime.app.priority import PrioritySettings, take
if {unprivileged}:
    resource.setrlimit(resource.RLIMIT_RTPRIO, (0, 0))
    resource.setrlimit(resource.RLIMIT_NICE, (0, 0))
    os.setresuid(65534, 65534, 65534)
refused = take(PrioritySettings({settings}))
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
