"""`twinscrew view`: what it refuses before it shows anything."""

from pathlib import Path

import pytest

from twinscrew.hil_sim.commands.view import view
from twinscrew.hil_sim.viewer import sources
from twinscrew.runtime.errors import ConfigError, RecordingError


@pytest.mark.parametrize(
    "ways", [{}, {"replay": Path("run"), "connect": "tcp/127.0.0.1:7447"}, {"config": []}]
)
def test_it_wants_one_thing_to_look_at(ways):
    with pytest.raises(ConfigError, match="one of --connect, --config, --run and --replay"):
        view(**ways, port=0)


def test_a_sensor_that_does_not_exist_is_refused():
    with pytest.raises(ConfigError, match="vrx32"):
        sources.from_endpoint("tcp/127.0.0.1:1", "wamv", "no-such-lidar")


def test_a_recording_that_does_not_exist_is_refused(tmp_path):
    with pytest.raises(RecordingError, match="no such file or folder"):
        sources.RecordedSource(tmp_path / "nothing")


def test_a_configuration_that_does_not_exist_is_refused(tmp_path):
    with pytest.raises(ConfigError, match=r"boat\.toml"):
        sources.from_configs([tmp_path / "boat.toml"])
