import sys

import pytest

from twinscrew.runtime.errors import ConfigError, TwinscrewError
from twinscrew.training.commands import train

CONFIG = """
[agent]
algorithm = "ac_iqn"
[[phases]]
name = "learn"
steps = 10
"""


@pytest.fixture
def config(tmp_path):
    file = tmp_path / "small.toml"
    file.write_text(CONFIG)
    return str(file)


def told(config, **options):
    return {"seeds": "0", "device": "cpu", "resume": None, "out": None, "threads": 1} | options


def test_a_name_that_is_no_configuration_lists_those_that_are(config):
    with pytest.raises(ConfigError, match=r"'ac_iqnn' is not one of .*'ac_iqn'"):
        train("ac_iqnn", **told(config))


def test_a_device_that_is_not_there_is_refused(config):
    with pytest.raises(ConfigError, match="'tpu' is not one of the devices"):
        train(config, **told(config, device="tpu"))


def test_there_must_be_a_checkpoint_to_resume_from(config, tmp_path):
    with pytest.raises(ConfigError, match="no checkpoint to resume from"):
        train(config, **told(config, resume=tmp_path))


def test_without_torch_it_says_what_to_install(config, monkeypatch):
    monkeypatch.setitem(sys.modules, "torch", None)
    with pytest.raises(TwinscrewError, match=r"twinscrew\[train\]"):
        train(config, **told(config))
