"""The doctor's line about files."""

from pathlib import Path

import pytest
from tests.unit.runtime.vessel.test_approval import SECRET, Dock

from twinscrew.runtime.bus.zenoh import ZenohSettings
from twinscrew.runtime.doctor.checks import Finding, Sources, Verdict, check_files, examine
from twinscrew.runtime.vessel.config import RuntimeConfig


@pytest.fixture
def dock(tmp_path: Path) -> Dock:
    return Dock(tmp_path)


def looked_at(dock: Dock) -> Finding:
    return check_files(Sources(dock.config, dock.manifest, dock.public_key))


def test_approved_files_are_well_and_whose_word_it_is_is_told(dock: Dock) -> None:
    found = looked_at(dock)
    assert found.verdict is Verdict.OK
    assert SECRET.public.name in found.found


def test_a_changed_file_fails_by_name(dock: Dock) -> None:
    dock.policy.write_bytes(b"changed")
    found = looked_at(dock)
    assert found.verdict is Verdict.FAIL
    assert "policy.onnx has changed" in found.found
    assert "manifest write" in found.advice


def test_without_a_manifest_the_line_says_what_that_means(dock: Dock) -> None:
    found = check_files(Sources(dock.config))
    assert found.verdict is Verdict.OK
    assert found.found == "no manifest: nobody would notice a changed file"


def test_the_line_is_there_when_a_file_was_given(dock: Dock, tmp_path: Path) -> None:
    config = RuntimeConfig(bus=ZenohSettings(connect=()))
    lines = [finding.what for finding in examine(config, tmp_path, Sources(dock.config))]
    assert lines[-1] == "files"
    assert "files" not in [finding.what for finding in examine(config, tmp_path)]
