from pathlib import Path

from twinscrew.runtime.app.session import unused


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
