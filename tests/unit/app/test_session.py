from pathlib import Path

import pytest

from twinscrew.runtime.app.config import RuntimeConfig
from twinscrew.runtime.app.recording_settings import RecordingSettings
from twinscrew.runtime.app.session import (
    SUMMARY_FILE,
    Session,
    nothing_told,
    read_summary,
    unused,
)
from twinscrew.runtime.bus.zenoh import ZenohSettings
from twinscrew.runtime.errors import RecordingError
from twinscrew.runtime.link.ardupilot.settings import AutopilotSettings


def config(folder: Path, **recording: float) -> RuntimeConfig:
    return RuntimeConfig(
        bus=ZenohSettings(connect=()),
        autopilot=AutopilotSettings(connection="udpin:127.0.0.1:0"),
        recording=RecordingSettings(folder=str(folder), **recording),
    )


def test_a_boat_that_starts_again_keeps_its_recordings(tmp_path: Path) -> None:
    folder = tmp_path / "recording"
    assert unused(folder) == folder
    folder.mkdir()
    assert unused(folder) == folder
    (folder / "a.mcap").touch()
    assert unused(folder) == tmp_path / "recording-2"
    (tmp_path / "recording-2").mkdir()
    (tmp_path / "recording-2" / "b.mcap").touch()
    assert unused(folder) == tmp_path / "recording-3"


def test_a_boats_file_decides_how_its_recording_rotates(tmp_path: Path) -> None:
    settings = config(tmp_path, rotate_mb=0.05, quota_mb=0.2)
    with Session(settings, source=tmp_path / "boat.toml") as session:
        for number in range(50):
            session._recorder.record("points", bytes(20_000), number)
    files = list((tmp_path / "recording").glob("*.mcap"))
    assert len(files) > 2
    assert sum(file.stat().st_size for file in files) < 0.35e6


def test_a_priority_that_was_refused_is_told_and_in_the_summary(tmp_path: Path) -> None:
    words = ("SCHED_FIFO 10: Operation not permitted",)
    with Session(config(tmp_path), source=tmp_path / "boat.toml", refused=words) as session:
        assert session.write_summary().priority_refused == words
    assert b"priority_refused" in next((tmp_path / "recording").glob("*.mcap")).read_bytes()


def test_a_runtime_that_was_killed_has_told_nothing() -> None:
    summary = nothing_told("wamv1")
    assert (summary.name, summary.decisions, summary.overruns) == ("wamv1", 0, 0)
    assert set(summary.latency_ms) == {"p50", "p99", "p999", "max"}


@pytest.mark.parametrize(
    "content",
    [None, b"{", b'{"vessel": "\xff"}', pytest.param(b'{"x": ' + b"[" * 100_000, id="deep")],
)
def test_a_summary_that_is_missing_or_damaged_is_refused_by_name(
    tmp_path: Path, content: bytes | None
) -> None:
    if content is not None:
        (tmp_path / SUMMARY_FILE).write_bytes(content)
    with pytest.raises(RecordingError, match=SUMMARY_FILE):
        read_summary(tmp_path)
