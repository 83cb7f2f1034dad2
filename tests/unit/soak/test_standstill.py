"""A core that stood still is told apart from one that was busy."""

import os
import signal
import time
from pathlib import Path

import pytest
from tests.harness.waiting import wait_until

from twinscrew.hil_sim.faults.timeline import Span
from twinscrew.hil_sim.soak.limits import Watch, within

STILL = [Span(1.0, 1.25), Span(1.0, 1.5), Span(4.0, 4.5)]


@pytest.mark.parametrize(
    ("begin_s", "end_s", "held_up_s"),
    [(0.0, 9.0, 1.25), (1.25, 2.0, 0.25), (1.5, 4.0, 0.0), (4.25, 9.0, 0.25)],
)
def test_only_what_lies_within_counts(begin_s: float, end_s: float, held_up_s: float) -> None:
    assert within(STILL, begin_s, end_s) == held_up_s


@pytest.mark.slow
def test_a_watchman_who_could_not_run_writes_down_from_when_to_when(tmp_path: Path) -> None:
    with Watch(tmp_path) as watch:
        wait_until(lambda: all(file.exists() for file in watch.files.values()))
        began_s = time.monotonic()
        os.kill(watch.pids[0], signal.SIGSTOP)
        time.sleep(0.5)
        os.kill(watch.pids[0], signal.SIGCONT)
        wait_until(lambda: any(span.length_s > 0.4 for span in watch.standstills()))
    longest = max(watch.standstills(), key=lambda span: span.length_s)
    assert began_s - 0.1 < longest.begin_s < longest.end_s <= time.monotonic()


def test_a_line_that_was_not_finished_is_left_out(tmp_path: Path) -> None:
    watch = Watch(tmp_path)
    assert watch.standstills() == []
    next(iter(watch.files.values())).write_text("3.0 3.5\n1.0 2.0\n7.0 8")
    assert watch.standstills() == [(1.0, 2.0), (3.0, 3.5)]
