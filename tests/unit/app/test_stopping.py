import signal
import sys
import threading
from collections.abc import Callable, Iterator
from types import FrameType
from typing import Any

import pytest

from twinscrew.runtime.app.stopping import StopRequest


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
