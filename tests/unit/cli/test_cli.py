"""The command line finds its commands."""

import subprocess
import sys
from importlib.metadata import EntryPoint

import pytest

from twinscrew.runtime.cli import main as cli


def entry(name, module):
    return EntryPoint(name, f"{module}:{name}", cli.GROUP)


@pytest.fixture
def installed(monkeypatch):
    def install(*entries):
        monkeypatch.setattr(cli, "entry_points", lambda group: entries)

    return install


def test_a_wheel_without_a_folder_does_not_offer_its_commands(installed):
    installed(
        entry("run", "twinscrew.runtime.cli.run"),
        entry("sail", "twinscrew.no_such_folder.commands"),
    )
    assert list(cli._installed()) == ["run"]


def test_other_packages_may_add_commands(installed):
    installed(entry("dive", "somebody.elses.package"))
    assert list(cli._installed()) == ["dive"]


def test_every_installed_command_has_a_summary():
    assert set(cli._installed()) <= set(cli.SUMMARIES)


def test_an_unknown_command_is_refused_with_status_2():
    command = [sys.executable, "-m", "twinscrew.runtime.cli", "no-such-command"]
    refused = subprocess.run(command, capture_output=True, text=True, timeout=60)
    assert refused.returncode == 2
    assert "no-such-command" in refused.stderr
