"""`twinscrew soak`, half a minute of it: that it sails, samples, and reports.

Whether its limits hold is for `make soak` to say, on a machine that is not busy with tests.
"""

import json
from pathlib import Path

import pytest
from tests.harness.commands import as_json, twinscrew


@pytest.mark.nightly
@pytest.mark.realtime
def test_half_a_minute_is_sailed_sampled_and_reported(tmp_path: Path) -> None:
    folder = tmp_path / "soak"
    done = twinscrew("soak", "--minutes", 0.5, "--seed", 2, "--out", folder, "--json")
    report = as_json(done)
    assert done.returncode == (0 if report["fine"] else 1)
    assert report == json.loads((folder / "report.json").read_text())
    found = {(row["vessel"], row["what"]): row for row in report["findings"]}
    assert {vessel for vessel, _ in found} == {"wamv1", "wamv2", "wamv3", "machine"}
    for vessel in ("wamv1", "wamv2", "wamv3"):
        assert found[vessel, "unhandled exceptions"]["fine"] is True, report
        assert found[vessel, "file handles"]["fine"] is True, report
        assert int(found[vessel, "missed deadlines"]["limit"].split(" of ")[1]) > 100
    assert sum(len(faults) for faults in report["faults"].values()) >= 1
    assert (folder / "memory.png").read_bytes().startswith(b"\x89PNG")


def test_a_folder_that_holds_something_is_not_overwritten(tmp_path: Path) -> None:
    (tmp_path / "notes.txt").write_text("mine")
    done = twinscrew("soak", "--minutes", 0.5, "--out", tmp_path)
    assert done.returncode == 2
    assert "not empty" in done.stderr
