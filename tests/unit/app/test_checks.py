"""The doctor's lines: each must be able to say FAIL, and then what to do."""

import os
import socket
from collections import namedtuple
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from twinscrew.runtime.app import checks
from twinscrew.runtime.app.checks import Finding, Verdict, examine
from twinscrew.runtime.app.config import RuntimeConfig
from twinscrew.runtime.bus.zenoh_config import ZenohSettings
from twinscrew.runtime.link.autopilot import AutopilotSettings
from twinscrew.runtime.policy import load

HOST = "127.0.0.1"
AT_HOME = ZenohSettings(connect=())


def config(**changes: object) -> RuntimeConfig:
    settings = {
        "bus": AT_HOME,
        "autopilot": AutopilotSettings(connection=f"udpin:{HOST}:0"),
        **changes,
    }
    return RuntimeConfig(**settings)


def line(what: str, folder: Path, **changes: object) -> Finding:
    (found,) = [f for f in examine(config(**changes), folder) if f.what == what]
    return found


def failed(found: Finding, *words: str) -> None:
    assert found.verdict is Verdict.FAIL
    assert found.advice
    for word in words:
        assert word in found.found


@pytest.fixture
def busy_port() -> Iterator[int]:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as taken:
        taken.bind((HOST, 0))
        yield taken.getsockname()[1]


def test_on_this_machine_nothing_fails(tmp_path: Path) -> None:
    findings = examine(config(), tmp_path)
    assert [f for f in findings if f.verdict is Verdict.FAIL] == []
    assert [f.what for f in findings] == [
        "Python",
        "packages",
        "native kernels",
        "processor",
        "clock",
        "priority",
        "disk",
        "sensor",
        "policy",
        "autopilot port",
        "Zenoh",
    ]


def test_a_missing_package_fails(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(checks, "PACKAGES", ("numpy", "no-such-package-of-ours"))
    failed(checks.check_packages(), "missing: no-such-package-of-ours")


def test_kernels_that_were_not_built_fail(monkeypatch: pytest.MonkeyPatch) -> None:
    import twinscrew.runtime as package

    monkeypatch.delattr(package, "_native", raising=False)
    monkeypatch.setitem(__import__("sys").modules, "twinscrew.runtime._native", None)
    found = checks.check_native()
    failed(found, "_native")
    assert found.advice == "make native"


def test_a_sensor_that_does_not_exist_fails(tmp_path: Path) -> None:
    failed(line("sensor", tmp_path, sensor="sonar"), "sonar", "vrx32")


def test_a_policy_that_does_not_exist_fails(tmp_path: Path) -> None:
    failed(line("policy", tmp_path, policy="clairvoyant"), "clairvoyant", "ac_iqn")


def test_a_policy_that_answers_differently_each_time_fails(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    class Moody:
        name, period_s = "moody", 0.5
        rng = np.random.default_rng(0)

        def act(self, observation: object) -> object:
            return self.rng.normal(size=2)

    monkeypatch.setattr(load, "load_policy", lambda *args: Moody())
    failed(line("policy", tmp_path), "answers differ")


def test_an_autopilots_port_in_use_fails(tmp_path: Path, busy_port: int) -> None:
    busy = AutopilotSettings(connection=f"udpin:{HOST}:{busy_port}")
    failed(line("autopilot port", tmp_path, autopilot=busy), str(busy_port), "in use")


def test_a_zenoh_port_in_use_fails(tmp_path: Path) -> None:
    with socket.socket() as taken:
        taken.bind((HOST, 0))
        taken.listen()
        port = taken.getsockname()[1]
        listening = ZenohSettings(connect=(), listen=(f"tcp/{HOST}:{port}",))
        failed(line("Zenoh", tmp_path, bus=listening), str(port))


def test_a_folder_that_cannot_be_written_to_fails(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(os, "access", lambda path, mode: False)
    failed(line("disk", tmp_path / "new" / "run"), str(tmp_path), "cannot be written")


def test_a_nearly_full_disk_is_a_warning(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    usage = namedtuple("usage", "total used free")
    monkeypatch.setattr(checks.shutil, "disk_usage", lambda path: usage(9e9, 8e9, 1e9))
    found = line("disk", tmp_path)
    assert (found.verdict, found.found.split(" at ")[0]) == (Verdict.WARN, "1.0 GB free")


@pytest.mark.parametrize(
    ("cores", "load", "verdict"), [(1, 0.1, "WARN"), (4, 9.0, "WARN"), (4, 1.0, "OK")]
)
def test_the_processor_must_have_room(
    monkeypatch: pytest.MonkeyPatch, cores: int, load: float, verdict: str
) -> None:
    monkeypatch.setattr(os, "sched_getaffinity", lambda pid: set(range(cores)))
    monkeypatch.setattr(os, "getloadavg", lambda: (load, load, load))
    assert checks.check_cores().verdict.value == verdict


def test_a_date_before_the_software_was_made_is_a_warning(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    epoch = checks.time.gmtime(0)
    monkeypatch.setattr(checks.time, "gmtime", lambda: epoch)
    assert checks.check_clock().verdict is Verdict.WARN
