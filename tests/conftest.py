"""What holds for every test: its tier, and how property tests draw their examples.

Three tiers, by how long a test takes, its set-up included:

    make test-fast      all that is not marked: each at most FAST_S
    make test           those marked slow too, each at most SLOW_S; then, with nothing beside them,
                        those marked realtime: they hold real processes to the time of a clock
    make test-nightly   those marked nightly too; and fails if a test has outgrown its tier
"""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Iterator

import hypothesis
import pytest
from tests.harness.commands import fork_server

FAST_S, SLOW_S = 1.0, 20.0
"""[s] Of processor, the processes included that a test has started and waited for."""
NOISE = 3.0
"""[-] A test is in the wrong tier if it takes so many times that much processor, or"""
WAITING = 10.0
"""[-] at night, when nothing else is busy, if it lasts so many times that long."""

# What a shell starts in the background ignores Ctrl-C, and so do all its children;
# with a handler of our own, the programs that tests start and interrupt begin as in a terminal.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)

# Property tests play as many examples as fit a minute's test run, and the same ones every time: a
# landing does not depend on luck. `make test-nightly` looks for new ones, ten times as many where a
# test does not set its own number; HYPOTHESIS_PROFILE=nightly for 100 000 of these.
hypothesis.settings.register_profile("landing", derandomize=True, deadline=None)
hypothesis.settings.register_profile("wide", max_examples=1000, deadline=None)
hypothesis.settings.register_profile("nightly", max_examples=100_000, deadline=None)
hypothesis.settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "landing"))

BEGAN = pytest.StashKey[tuple[float, float]]()
OUTGROWN = "outgrown"
"""The property of a report that says by how much its test has outgrown its tier."""


def pytest_addoption(parser: pytest.Parser) -> None:
    """Let the nightly run fail where a test has outgrown its tier."""
    parser.addoption("--tiers", action="store_true", help="fail if a test has outgrown its tier")


def clocks() -> tuple[float, float]:
    """[s] Give processor's time, of this process and those it has waited for, and a clock's."""
    taken = os.times()
    processor_s = taken.user + taken.system + taken.children_user + taken.children_system
    if fork_server.cache_info().currsize:
        processor_s += fork_server().processor_s
    return processor_s, time.monotonic()


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_setup(item: pytest.Item) -> None:
    """Note when a test begins."""
    item.stash[BEGAN] = clocks()


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(
    item: pytest.Item, call: pytest.CallInfo[None]
) -> Iterator[pytest.TestReport]:
    """Say in a test's last report if it has outgrown its tier."""
    report = yield
    tiers = {mark.name for mark in item.iter_markers()} & {"slow", "nightly", "realtime"}
    if call.when == "teardown" and not tiers & {"nightly", "realtime"}:
        allowed_s = SLOW_S if tiers else FAST_S
        processor_s, lasted_s = (
            end - begin for end, begin in zip(clocks(), item.stash[BEGAN], strict=True)
        )
        too_long = item.config.getoption("--tiers") and lasted_s > WAITING * allowed_s
        if processor_s > NOISE * allowed_s or too_long:
            words = f"{processor_s:.1f} s of processor in {lasted_s:.1f} s; allowed {allowed_s} s"
            report.user_properties.append((OUTGROWN, words))
    return report


def outgrown(reporter: pytest.TerminalReporter) -> dict[str, str]:
    """Give the tests that have outgrown their tiers, and by how much."""
    reports = [report for kind in reporter.stats.values() for report in kind]
    return {
        report.nodeid: words
        for report in reports
        for name, words in getattr(report, "user_properties", ())
        if name == OUTGROWN
    }


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """Name the tests that have outgrown their tiers."""
    if found := outgrown(terminalreporter):
        terminalreporter.section("tests that have outgrown their tiers (tests/conftest.py)")
        for test, words in found.items():
            terminalreporter.line(f"{test}: {words}")


def pytest_sessionfinish(session: pytest.Session, exitstatus: int) -> None:
    """Fail for them, where that is asked for: other machines are slower, or busy."""
    reporter = session.config.pluginmanager.get_plugin("terminalreporter")
    if exitstatus == 0 and reporter and session.config.getoption("--tiers") and outgrown(reporter):
        session.exitstatus = pytest.ExitCode.TESTS_FAILED
