"""`make audit`: red for what is known to be bad, never green for what nobody looked at."""

import importlib.util
import subprocess
import sys
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

FILE = Path(__file__).parents[3] / "deploy" / "audit.py"
VULNERABLE = {
    "name": "jinja2",
    "version": "2.4",
    "vulns": [{"id": "CVE-1", "fix_versions": ["2.5", "2.6"]}, {"id": "CVE-2", "fix_versions": []}],
}
CLEAN = {"name": "numpy", "version": "2.0", "vulns": []}
UNKNOWN = {"name": "ours", "skip_reason": "not found"}


@pytest.fixture
def audit(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    spec = importlib.util.spec_from_file_location("audit", FILE)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    monkeypatch.setitem(sys.modules, "audit", module)
    spec.loader.exec_module(module)
    monkeypatch.setattr(module, "_program", lambda: Path("pip-audit"))
    return module


def answering(audit: ModuleType, monkeypatch: pytest.MonkeyPatch, **reports: Any) -> list[str]:
    """Let services answer with packages, or not at all; give whom was asked."""
    asked = []

    def ask(program: Path, service: str) -> Any:
        asked.append(service)
        packages = reports.get(service)
        return None if packages is None else audit.understood(service, {"dependencies": packages})

    monkeypatch.setattr(audit, "_ask", ask)
    return asked


def test_a_vulnerability_is_red_and_told_with_what_mends_it(
    audit: ModuleType, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    asked = answering(audit, monkeypatch, pypi=[VULNERABLE, CLEAN, UNKNOWN])
    assert audit.main() == 1
    out = capsys.readouterr().out
    assert "vulnerability: jinja2 2.4: CVE-1; mended in 2.5, 2.6" in out
    assert "CVE-2; mended in none yet" in out
    assert "2 known, 0 accepted in 2 of 3 packages (pypi)" in out
    assert asked == ["pypi"]


def test_one_that_somebody_accepted_is_not(
    audit: ModuleType,
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    answering(audit, monkeypatch, pypi=[VULNERABLE])
    file = tmp_path / "accepted.txt"
    file.write_text("# said by somebody\nCVE-1  # no template of others\n\nCVE-2\n")
    monkeypatch.setattr(audit, "ACCEPTED", file)
    assert audit.main() == 0
    assert "0 known, 2 accepted" in capsys.readouterr().out


def test_clean_packages_are_green(
    audit: ModuleType, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    answering(audit, monkeypatch, pypi=[CLEAN])
    assert audit.main() == 0
    assert "0 known, 0 accepted in 1 of 1 packages (pypi)" in capsys.readouterr().out


def test_where_one_service_knows_nothing_the_next_is_asked(
    audit: ModuleType, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked = answering(audit, monkeypatch, pypi=[UNKNOWN], osv=[VULNERABLE])
    assert audit.main() == 1
    assert asked == ["pypi", "osv"]


@pytest.mark.parametrize("reports", [{}, {"pypi": [UNKNOWN]}, {"osv": [UNKNOWN, UNKNOWN]}])
def test_where_nobody_knows_anything_that_is_said_and_nothing_is_red(
    audit: ModuleType,
    monkeypatch: pytest.MonkeyPatch,
    reports: dict[str, Any],
    capsys: pytest.CaptureFixture[str],
) -> None:
    answering(audit, monkeypatch, **reports)
    assert audit.main() == 0
    out = capsys.readouterr().out
    assert "NOT AUDITED" in out
    assert "0 known" not in out


def test_without_the_tool_that_is_said(
    audit: ModuleType, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(audit, "_program", lambda: None)
    assert audit.main() == 0
    assert "NOT AUDITED" in capsys.readouterr().out


def test_a_tool_that_answers_nothing_is_a_service_out_of_reach(
    audit: ModuleType, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    lost = subprocess.CompletedProcess([], 1, stdout="", stderr="Traceback\nno route to host\n")
    monkeypatch.setattr(audit.subprocess, "run", lambda *_, **__: lost)
    assert audit.ask() is None
    assert "pypi: no route to host" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("licence", "reaches_over"),
    [
        ("GPL-3.0-or-later", True),
        ("GNU General Public License v3 (GPLv3)", True),
        ("AGPL-3.0", True),
        ("GNU Affero General Public License v3", True),
        ("MIT AND GPL-2.0", True),
        ("LGPL-3.0", False),
        ("GNU Lesser General Public License v3 (LGPLv3)", False),
        ("Apache-2.0 OR BSD-3-Clause", False),
        ("none", False),
    ],
)
def test_only_strong_copyleft_is_no_licence_for_a_boat(
    audit: ModuleType, licence: str, reaches_over: bool
) -> None:
    assert bool(audit.COPYLEFT.search(licence)) is reaches_over


def test_a_package_of_such_a_licence_is_red(
    audit: ModuleType, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    answering(audit, monkeypatch, pypi=[CLEAN])
    monkeypatch.setattr(audit, "licence_of", lambda p: "AGPL-3.0" if p.name == "scipy" else "MIT")
    assert audit.main() == 1
    assert "licence: scipy " in capsys.readouterr().out


def test_what_a_boat_gets_is_what_the_runtime_needs_and_no_extra(audit: ModuleType) -> None:
    names = [package.name.lower() for package in audit.shipped()]
    assert {"twinscrew", "numpy", "pymavlink", "eclipse-zenoh", "protobuf"} <= set(names)
    assert not {"torch", "pytest", "aiohttp"} & set(names)
    assert len(names) == len(set(names))
    assert all(audit.licence_of(package) != "none" for package in audit.shipped())
