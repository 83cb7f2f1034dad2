"""What the doctor says of connections, devices and files."""

import os
import socket
from collections.abc import Iterator
from pathlib import Path

import pytest

from twinscrew.runtime.bus.zenoh import ZenohSettings
from twinscrew.runtime.doctor.checks import Verdict, check_network, check_permissions, endpoint_of
from twinscrew.runtime.link.ardupilot.link import AutopilotSettings
from twinscrew.runtime.vessel.config import RuntimeConfig

HOST = "127.0.0.1"


@pytest.fixture
def port() -> Iterator[int]:
    with socket.create_server((HOST, 0)) as server:
        yield server.getsockname()[1]


def boat(*connect: str, line: str = f"udpin:{HOST}:0", file: str | None = None) -> RuntimeConfig:
    return RuntimeConfig(
        bus=ZenohSettings(connect=connect, config_file=file),
        autopilot=AutopilotSettings(connection=line),
    )


@pytest.mark.parametrize(
    ("locator", "read"),
    [
        ("tcp/10.0.0.5:7447", ("tcp", "10.0.0.5", 7447)),
        ("tls/[fe80::1]:7447", ("tls", "fe80::1", 7447)),
        ("tcp/boat.local:7447#iface=eth0", ("tcp", "boat.local", 7447)),
        ("unixsock-stream/tmp/z", None),
    ],
)
def test_zenohs_locators_are_read(locator: str, read: tuple[str, str, int] | None) -> None:
    assert endpoint_of(locator) == read


def test_an_endpoint_where_somebody_listens_is_fine(port: int) -> None:
    found = check_network(boat(f"tcp/{HOST}:{port}"))
    assert found.verdict is Verdict.OK
    assert str(port) in found.found


def test_one_where_nobody_does_fails_and_names_it(port: int) -> None:
    with socket.create_server((HOST, 0)) as closed:
        silent = closed.getsockname()[1]
    found = check_network(boat(f"tcp/{HOST}:{port}", f"tcp/{HOST}:{silent}"))
    assert found.verdict is Verdict.FAIL
    assert f"{silent}: Connection refused" in found.found
    assert str(port) not in found.found.split("tcp/")[1:][-1].replace(str(silent), "")


def test_a_boat_that_calls_nobody_is_fine() -> None:
    assert check_network(boat()).verdict is Verdict.OK


def test_a_device_of_another_group_is_named_with_its_group(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    device = tmp_path / "ttyUSB0"
    device.touch()
    monkeypatch.setattr(os, "access", lambda path, mode: False)
    for line in (f"serial:{device}:921600", str(device)):
        found = check_permissions(boat(line=line))
        assert found.verdict is Verdict.FAIL
        assert "may not be used" in found.found
        assert "of group" in found.found
        assert "dialout" in found.advice


def test_a_configuration_of_zenoh_that_cannot_be_read_fails(tmp_path: Path) -> None:
    found = check_permissions(boat(file=str(tmp_path / "none.json5")))
    assert found.verdict is Verdict.FAIL
    assert "none.json5: is not there" in found.found


@pytest.mark.parametrize(("user", "verdict"), [(0, "WARN"), (65_000, "OK")])
def test_a_boat_is_better_not_run_as_root(
    monkeypatch: pytest.MonkeyPatch, user: int, verdict: str
) -> None:
    monkeypatch.setattr(os, "geteuid", lambda: user)
    assert check_permissions(boat()).verdict.value == verdict
