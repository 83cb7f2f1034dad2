"""Files are read as far as a file of their kind can be long."""

import os
import threading
from pathlib import Path

import pytest

from twinscrew.runtime.errors import ConfigError
from twinscrew.runtime.files import read_file
from twinscrew.runtime.settings import Settings, load


def test_a_file_is_read_up_to_its_limit_and_no_further(tmp_path: Path) -> None:
    file = tmp_path / "a"
    file.write_bytes(b"12345")
    assert read_file(file, 5) == b"12345"
    with pytest.raises(ConfigError, match=r"a: has more than 4e-06 MB"):
        read_file(file, 4)


def test_a_device_that_never_ends_is_refused_as_settings() -> None:
    with pytest.raises(ConfigError, match="/dev/zero: has more than 16 MB"):
        load(Path("/dev/zero"), Settings)


def test_a_pipe_is_as_good_as_a_file(tmp_path: Path) -> None:
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    writer = threading.Thread(target=lambda: pipe.write_bytes(b"# nothing"))
    writer.start()
    assert load(pipe, Settings) == Settings()
    writer.join()
