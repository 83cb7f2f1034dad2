import json

import pytest

from twinscrew.runtime.bus.zenoh_config import ZenohSettings, zenoh_config
from twinscrew.runtime.errors import ConfigError
from twinscrew.runtime.settings import convert


def value(config, key):
    return json.loads(config.get_json(key))


def test_by_default_nothing_listens_and_nobody_is_looked_for():
    config = zenoh_config(ZenohSettings())
    assert value(config, "listen/endpoints") == []
    assert value(config, "scouting/multicast/enabled") is False
    assert value(config, "connect/endpoints") == ["tcp/127.0.0.1:7447"]
    assert value(config, "mode") == "peer"


def test_every_setting_arrives_in_the_configuration():
    settings = ZenohSettings(
        mode="client",
        connect=("tcp/10.0.0.1:7447",),
        listen=("tcp/127.0.0.1:7448",),
        multicast_scouting=True,
        shared_memory=False,
    )
    config = zenoh_config(settings)
    assert value(config, "mode") == "client"
    assert value(config, "connect/endpoints") == ["tcp/10.0.0.1:7447"]
    assert value(config, "listen/endpoints") == ["tcp/127.0.0.1:7448"]
    assert value(config, "scouting/multicast/enabled") is True
    assert value(config, "transport/shared_memory/enabled") is False


def test_a_file_rules_where_the_settings_say_nothing(tmp_path):
    file = tmp_path / "zenoh.json5"
    file.write_text('{mode: "client", /* a comment */ connect: {endpoints: ["tls/a:7447"]}}')
    config = zenoh_config(ZenohSettings(config_file=str(file), listen=("tcp/127.0.0.1:1",)))
    assert value(config, "mode") == "client"
    assert value(config, "connect/endpoints") == ["tls/a:7447"]
    assert value(config, "listen/endpoints") == ["tcp/127.0.0.1:1"]


@pytest.mark.parametrize("text", ["{mode: ", '{mode: "captain"}', '{"mod": 1}', "\x00"])
def test_a_file_that_is_no_configuration_is_refused_by_name(tmp_path, text):
    file = tmp_path / "broken.json5"
    file.write_text(text)
    with pytest.raises(ConfigError, match=r"broken\.json5: not a Zenoh configuration"):
        zenoh_config(ZenohSettings(config_file=str(file)))


def test_a_file_that_is_not_there_is_refused_by_name():
    with pytest.raises(ConfigError, match=r"nowhere\.json5: no such file"):
        zenoh_config(ZenohSettings(config_file="nowhere.json5"))


def test_an_endpoint_that_is_none_is_refused_without_the_places_in_zenohs_source():
    with pytest.raises(ConfigError, match=r"listen/endpoints: .*harbour") as caught:
        zenoh_config(ZenohSettings(listen=("harbour",)))
    assert ".rs" not in str(caught.value)


def test_a_mode_that_does_not_exist_is_refused_with_those_that_do():
    with pytest.raises(ConfigError, match="mode"):
        convert({"mode": "captain"}, ZenohSettings)
