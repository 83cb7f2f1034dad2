"""What the doctor says of a computer."""

import os
from collections import namedtuple
from pathlib import Path

import pytest

from twinscrew.runtime.doctor import checks as checks_machine
from twinscrew.runtime.doctor.checks import (
    Verdict,
    check_clock,
    check_cores,
    check_disk,
    check_memory,
    check_priority,
    clock_error_ms,
)


def test_a_nearly_full_disk_is_a_warning(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    usage = namedtuple("usage", "total used free")
    monkeypatch.setattr(checks_machine.shutil, "disk_usage", lambda path: usage(9e9, 8e9, 1e9))
    found = check_disk(tmp_path)
    assert (found.verdict, found.found.split(" at ")[0]) == (Verdict.WARN, "1.0 GB free")


@pytest.mark.parametrize(
    ("cores", "load", "verdict"), [(1, 0.1, "WARN"), (4, 9.0, "WARN"), (4, 1.0, "OK")]
)
def test_the_processor_must_have_room(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, cores: int, load: float, verdict: str
) -> None:
    monkeypatch.setattr(os, "sched_getaffinity", lambda pid: set(range(cores)))
    monkeypatch.setattr(os, "getloadavg", lambda: (load, load, load))
    monkeypatch.setattr(checks_machine, "SYSTEM", tmp_path)
    assert check_cores().verdict.value == verdict


def test_a_processor_that_saves_power_is_a_warning(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(os, "sched_getaffinity", lambda pid: {0, 1})
    monkeypatch.setattr(os, "getloadavg", lambda: (0.0, 0.0, 0.0))
    monkeypatch.setattr(checks_machine, "SYSTEM", tmp_path)
    for core, governor in enumerate(("performance", "powersave")):
        folder = tmp_path / f"cpu{core}" / "cpufreq"
        folder.mkdir(parents=True)
        (folder / "scaling_governor").write_text(f"{governor}\n")
    found = check_cores()
    assert found.verdict is Verdict.WARN
    assert "powersave" in found.found
    assert "performance" in found.advice


@pytest.mark.parametrize(("free_kb", "verdict"), [(200_000, "WARN"), (2_000_000, "OK")])
def test_the_runtime_needs_free_memory(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, free_kb: int, verdict: str
) -> None:
    told = tmp_path / "meminfo"
    told.write_text(f"MemTotal:       4000000 kB\nMemAvailable:   {free_kb} kB\n")
    monkeypatch.setattr(checks_machine, "MEMORY", told)
    assert check_memory().verdict.value == verdict


def test_this_machines_memory_can_be_read() -> None:
    assert " MB free" in check_memory().found


def test_a_date_before_the_software_was_made_is_a_warning(monkeypatch: pytest.MonkeyPatch) -> None:
    epoch = checks_machine.time.gmtime(0)
    monkeypatch.setattr(checks_machine.time, "gmtime", lambda: epoch)
    found = check_clock()
    assert found.verdict is Verdict.WARN
    assert "set the date" in found.advice


@pytest.mark.parametrize(
    ("error_ms", "verdict", "told"),
    [
        (None, "WARN", "kept by nobody"),
        (900.0, "WARN", "right to 900.0 ms"),
        (1.5, "OK", "right to 1.5 ms"),
    ],
)
def test_a_clock_must_be_kept_right(
    monkeypatch: pytest.MonkeyPatch, error_ms: float | None, verdict: str, told: str
) -> None:
    monkeypatch.setattr(checks_machine, "clock_error_ms", lambda: error_ms)
    found = check_clock()
    assert found.verdict.value == verdict
    assert told in found.found


def test_the_kernel_tells_how_wrong_its_clock_may_be_or_that_it_does_not_know() -> None:
    error_ms = clock_error_ms()
    assert error_ms is None or 0.0 <= error_ms < 60_000.0


def test_a_user_who_may_not_raise_the_priority_is_told_how(monkeypatch: pytest.MonkeyPatch) -> None:
    import resource

    monkeypatch.setattr(os, "geteuid", lambda: 1000)
    monkeypatch.setattr(resource, "getrlimit", lambda which: (0, 0))
    found = check_priority()
    assert found.verdict is Verdict.WARN
    assert "LimitRTPRIO" in found.advice
