"""docs/architecture.md shows the path of one scan; a profile of a scan says if it is true."""

from __future__ import annotations

import cProfile
import pstats
import re
from pathlib import Path

import pytest

from twinscrew.hil_sim.bench.latency import CONFIG, clouds, stamped
from twinscrew.runtime.bus.base import Received
from twinscrew.runtime.vessel.vessel import make_vessel

ROOT = Path(__file__).parents[3]
MOST_FILES = 12
"""[-] Files that a reader opens to follow a scan."""
MOST_FUNCTIONS = 210
"""[-] The runtime's functions in a profile of one scan; the aim is 90."""
ROW = re.compile(r"^\| `(runtime/[\w/]+\.py)` \| `(?:\w+\.)?(\w+)` \|", re.MULTILINE)
DRIVER = "runtime/vessel/realtime.py"
"""Not in the profile: it has a clock and sockets."""


def path_of_a_scan() -> list[tuple[str, str]]:
    """Give file and function of each row of the table."""
    return ROW.findall((ROOT / "docs" / "architecture.md").read_text(encoding="utf-8"))


@pytest.fixture(scope="module")
def profile() -> set[tuple[str, str]]:
    """File and name of each of the runtime's functions that one scan calls."""
    vessel = make_vessel(CONFIG)
    vessel.engaged = True
    *settling, last = stamped(clouds()["30k"], 41)  # the policy is asked for the last
    for stamp_ns, scan, odometry in settling:
        vessel.handle(Received("odometry", odometry, 0), stamp_ns / 1e9)
        vessel.handle(Received("points", scan, 0), stamp_ns / 1e9)
    stamp_ns, scan, odometry = last
    vessel.handle(Received("odometry", odometry, 0), stamp_ns / 1e9)
    profiler = cProfile.Profile()
    out = profiler.runcall(vessel.handle, Received("points", scan, 0), stamp_ns / 1e9)
    assert out.decision is not None
    assert out.decision.acted
    called = pstats.Stats(profiler).stats  # type: ignore[attr-defined]
    files = ((Path(file).resolve(), name) for file, _, name in called)
    return {
        (str(file.relative_to(ROOT)), name)
        for file, name in files
        if file.is_relative_to(ROOT / "runtime") and not name.startswith("<")
    }


def test_a_reader_opens_at_most_a_dozen_files_to_follow_a_scan() -> None:
    files = {file for file, _ in path_of_a_scan()}
    assert 8 <= len(files) <= MOST_FILES
    assert all((ROOT / file).is_file() for file in files)


def test_a_scan_passes_through_every_function_of_the_table(profile: set[tuple[str, str]]) -> None:
    assert set(path_of_a_scan()) - profile == {(DRIVER, "_compute")}
    assert "def _compute(" in (ROOT / DRIVER).read_text(encoding="utf-8")


def test_a_profile_of_a_scan_shows_few_functions(profile: set[tuple[str, str]]) -> None:
    assert len(profile) <= MOST_FUNCTIONS, sorted(profile)
