"""The doctor's lines: each must be able to say FAIL, and then what to do."""

import os
import socket
from collections.abc import Iterator
from pathlib import Path

import pytest

from twinscrew.runtime.bus.zenoh import ZenohSettings
from twinscrew.runtime.doctor import checks
from twinscrew.runtime.doctor.checks import Finding, Verdict, examine
from twinscrew.runtime.link.ardupilot.link import AutopilotSettings
from twinscrew.runtime.vessel.config import RuntimeConfig

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
        "memory",
        "clock",
        "priority",
        "disk",
        "permissions",
        "network",
        "sensor",
        "chart",
        "policy",
        "policy card",
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


def test_an_autopilots_port_in_use_fails(tmp_path: Path, busy_port: int) -> None:
    busy = AutopilotSettings(connection=f"udpin:{HOST}:{busy_port}")
    failed(line("autopilot port", tmp_path, autopilot=busy), str(busy_port), "in use")


def test_a_serial_line_that_is_not_there_fails_twice_with_what_to_do(tmp_path: Path) -> None:
    away = AutopilotSettings(connection=f"serial:{tmp_path / 'ttyACM0'}:921600")
    failed(line("autopilot port", tmp_path, autopilot=away), "ttyACM0")
    failed(line("permissions", tmp_path, autopilot=away), "ttyACM0", "is not there")


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
