"""A runtime's process: what it is told must be text."""

import os

import pytest

from twinscrew.hil_sim.drivers.processes import RuntimeProcess
from twinscrew.runtime.errors import ConfigError
from twinscrew.runtime.recording.settings import RecordingSettings
from twinscrew.runtime.vessel.config import RuntimeConfig


def test_a_folder_whose_name_is_no_text_is_refused_before_anything_starts(tmp_path):
    folder = tmp_path / os.fsdecode(b"b\xff\xfe")
    config = RuntimeConfig(recording=RecordingSettings(folder=str(folder)))
    with pytest.raises(ConfigError, match="must have a name in UTF-8"):
        RuntimeProcess(config, folder)
