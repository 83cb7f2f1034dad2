import errno
import json
import os
import random
import subprocess
import sys
from pathlib import Path

import pytest
import torch

from twinscrew.runtime.errors import ConfigError, TwinscrewError
from twinscrew.training import runs


def test_a_checkpoint_comes_back_as_it_was(tmp_path):
    file = tmp_path / "checkpoint.pt"
    runs.save_checkpoint(file, "ac_iqn", {"step": 7, "weights": torch.arange(3.0)})
    content = runs.load_checkpoint(file, "ac_iqn")
    assert content["step"] == 7
    assert content["weights"].tolist() == [0, 1, 2]


def test_a_checkpoint_of_another_algorithm_is_refused_by_name(tmp_path):
    runs.save_checkpoint(tmp_path / "c.pt", "sac", {})
    with pytest.raises(ConfigError, match=r"c\.pt.*'sac'.*'ac_iqn'"):
        runs.load_checkpoint(tmp_path / "c.pt", "ac_iqn")


def test_a_checkpoint_of_another_version_is_refused(tmp_path):
    torch.save({"format": 99, "algorithm": "ac_iqn"}, tmp_path / "c.pt")
    with pytest.raises(ConfigError, match="version 99"):
        runs.load_checkpoint(tmp_path / "c.pt", "ac_iqn")


def test_a_missing_checkpoint_is_named(tmp_path):
    with pytest.raises(ConfigError, match=r"c\.pt.*No such file"):
        runs.load_checkpoint(tmp_path / "c.pt", "ac_iqn")


@pytest.mark.parametrize("content", [b"", b"no checkpoint", b"PK\x03\x04 cut short"])
def test_bytes_that_are_no_checkpoint_are_refused(tmp_path, content):
    (tmp_path / "c.pt").write_bytes(content)
    with pytest.raises(ConfigError, match="not a readable checkpoint"):
        runs.load_checkpoint(tmp_path / "c.pt", "ac_iqn")


def test_a_checkpoint_that_holds_code_is_not_run(tmp_path):
    torch.save({"format": 1, "algorithm": "ac_iqn", "x": Path("/tmp")}, tmp_path / "c.pt")  # noqa: S108
    with pytest.raises(ConfigError, match="not a readable checkpoint"):
        runs.load_checkpoint(tmp_path / "c.pt", "ac_iqn")


def test_a_full_disk_leaves_the_last_checkpoint(tmp_path, monkeypatch):
    file = tmp_path / "checkpoint.pt"
    runs.save_checkpoint(file, "ac_iqn", {"step": 1})

    def full(descriptor):
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(TwinscrewError, match="No space left"):
        runs.save_checkpoint(file, "ac_iqn", {"step": 2})
    assert runs.load_checkpoint(file, "ac_iqn")["step"] == 1
    assert [p.name for p in tmp_path.iterdir()] == ["checkpoint.pt"]


def test_a_run_directory_holds_one_run_at_a_time(tmp_path):
    folder = tmp_path / "run"
    with runs.locked(folder), pytest.raises(ConfigError, match="in use"), runs.locked(folder):
        pass
    with runs.locked(tmp_path / "run"):
        pass


def test_a_place_that_cannot_be_a_directory_is_refused(tmp_path):
    (tmp_path / "file").write_text("")
    with (
        pytest.raises(ConfigError, match=r"file.*cannot be written"),
        runs.locked(tmp_path / "file"),
    ):
        pass


@pytest.mark.slow
def test_the_lock_of_a_killed_process_is_free(tmp_path):
    code = (
        "import os, sys; from pathlib import Path; from twinscrew.training import runs\n"
        "with runs.locked(Path(sys.argv[1])): os._exit(1)"
    )
    subprocess.run([sys.executable, "-c", code, str(tmp_path / "run")], check=False)
    with runs.locked(tmp_path / "run"):
        pass


def test_records_are_read_as_they_were_written(tmp_path):
    log = tmp_path / "log.jsonl"
    runs.append_record(log, {"event": "train", "step": 1})
    runs.append_record(log, {"event": "train", "step": 2})
    assert [record["step"] for record in runs.read_records(log)] == [1, 2]


def test_a_line_that_was_cut_off_at_the_end_is_dropped(tmp_path):
    log = tmp_path / "log.jsonl"
    log.write_text(json.dumps({"step": 1}) + '\n{"st')
    assert [record["step"] for record in runs.read_records(log)] == [1]


def test_a_broken_line_in_the_middle_is_named(tmp_path):
    log = tmp_path / "log.jsonl"
    log.write_text('{"st\n{"step": 1}\n')
    with pytest.raises(ConfigError, match="line 1"):
        runs.read_records(log)


@pytest.mark.parametrize(
    "content",
    [
        b"",
        b"{",
        b"[1]",
        b"{}",
        b'{"settings": 3}',
        b"\xff\xfe",
        pytest.param(b"[" * 100_000, id="deep"),
    ],
)
def test_a_configuration_that_is_none_is_refused_by_name(tmp_path, content):
    (tmp_path / runs.CONFIG).write_bytes(content)
    with pytest.raises(ConfigError, match=r"config\.json: damaged, or of another version"):
        runs.read_told(tmp_path)


def test_a_checkpoint_with_any_bytes_changed_is_read_or_refused(tmp_path):
    file = tmp_path / "checkpoint.pt"
    runs.save_checkpoint(file, "a", {"weights": torch.zeros(20), "names": ["x", {"y": 1.0}]})
    data, generator = file.read_bytes(), random.Random(2)
    refused = 0
    for _ in range(150):
        changed = bytearray(data)
        for place in generator.choices(range(len(data)), k=3):
            changed[place] = generator.randrange(256)
        file.write_bytes(changed[: generator.randrange(len(data)) if refused % 3 == 2 else None])
        try:
            runs.load_checkpoint(file, "a")
        except ConfigError as error:
            assert str(file) in str(error)  # noqa: PT017
            refused += 1
    assert refused > 10


@pytest.mark.parametrize("line", [b"3", b"null", b'"text"', b"[1]"])
def test_a_line_that_is_no_record_is_named(tmp_path, line):
    (tmp_path / runs.LOG).write_bytes(b'{"event": "start"}\n' + line + b"\n")
    with pytest.raises(ConfigError, match="line 2 is no record"):
        runs.read_records(tmp_path / runs.LOG)


@pytest.mark.parametrize("line", [b"\xff\xfe", pytest.param(b"[" * 100_000, id="deep")])
def test_a_line_that_is_no_text_is_named(tmp_path, line):
    (tmp_path / runs.LOG).write_bytes(line + b'\n{"event": "start"}\n')
    with pytest.raises(ConfigError, match="line 1 is not JSON"):
        runs.read_records(tmp_path / runs.LOG)


def test_a_file_that_cannot_be_written_is_named(tmp_path):
    with pytest.raises(TwinscrewError, match=r"nowhere.*policy\.onnx.*No such file"):
        runs.replace_file(tmp_path / "nowhere" / "policy.onnx", lambda out: out.write(b"x"))


def test_a_file_is_replaced_as_a_whole(tmp_path):
    for content in (b"old", b"new"):
        runs.replace_file(tmp_path / "policy.onnx", lambda out, data=content: out.write(data))
    assert [p.name for p in tmp_path.iterdir()] == ["policy.onnx"]
    assert (tmp_path / "policy.onnx").read_bytes() == b"new"
