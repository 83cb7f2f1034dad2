import signal
import subprocess
import sys
import threading
import time

import pytest

from twinscrew.hil_sim.children import end, end_all, undisturbed

STUBBORN = (
    "import signal, time; signal.signal(15, signal.SIG_IGN); print(1, flush=True); time.sleep(600)"
)


def start_something(noted: list[str]) -> None:
    with undisturbed():
        signal.raise_signal(signal.SIGINT)
        noted.append("started")


def test_ctrl_c_waits_until_what_was_started_is_noted():
    noted: list[str] = []
    with pytest.raises(KeyboardInterrupt):
        start_something(noted)
    assert noted == ["started"]


def test_afterwards_signals_mean_what_they_meant_before():
    before = signal.getsignal(signal.SIGINT), signal.getsignal(signal.SIGTERM)
    with undisturbed():
        pass
    assert (signal.getsignal(signal.SIGINT), signal.getsignal(signal.SIGTERM)) == before


def test_an_error_inside_goes_on_and_signals_are_as_before():
    before = signal.getsignal(signal.SIGINT)
    with pytest.raises(OSError, match="no such program"), undisturbed():
        raise OSError("no such program")
    assert signal.getsignal(signal.SIGINT) is before


def test_in_another_thread_it_touches_no_signal():
    seen = []

    def work():
        with undisturbed():
            seen.append(signal.getsignal(signal.SIGINT))

    thread = threading.Thread(target=work)
    thread.start()
    thread.join()
    assert seen == [signal.getsignal(signal.SIGINT)]


def test_who_does_not_end_when_asked_is_made_to():
    with subprocess.Popen([sys.executable, "-c", STUBBORN], stdout=subprocess.PIPE) as process:
        assert process.stdout is not None
        process.stdout.readline()  # it ignores SIGTERM from now on
        end(process, 0.2)
        assert process.returncode == -signal.SIGKILL


def test_several_who_do_not_end_when_asked_are_waited_for_together():
    begun = [
        subprocess.Popen([sys.executable, "-c", STUBBORN], stdout=subprocess.PIPE) for _ in range(4)
    ]
    for process in begun:
        assert process.stdout is not None
        process.stdout.readline()
    begin_s = time.monotonic()
    end_all(begun, 0.5)
    assert time.monotonic() - begin_s < 1.5
    assert [process.returncode for process in begun] == [-signal.SIGKILL] * 4
    for process in begun:
        process.stdout.close()
