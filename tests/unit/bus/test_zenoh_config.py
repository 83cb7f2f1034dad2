import json

import pytest

from twinscrew.runtime.bus.zenoh import ZenohSettings, zenoh_config
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


@pytest.mark.parametrize("text", ['{mode: "peer"}', '{mode: "router"}', "{}"])
def test_a_file_that_says_nothing_of_it_neither_listens_nor_looks_for_others(tmp_path, text):
    """Zenoh alone would listen at every address of the machine."""
    file = tmp_path / "zenoh.json5"
    file.write_text(text)
    config = zenoh_config(ZenohSettings(config_file=str(file)))
    assert value(config, "listen/endpoints") == []
    assert value(config, "scouting/multicast/enabled") is False


def test_a_file_may_listen_and_look_for_others_if_it_says_so(tmp_path):
    file = tmp_path / "zenoh.json5"
    file.write_text(
        '{listen: {endpoints: ["tls/0.0.0.0:7447"]}, scouting: {multicast: {enabled: true}}}'
    )
    config = zenoh_config(ZenohSettings(config_file=str(file)))
    assert value(config, "listen/endpoints") == ["tls/0.0.0.0:7447"]
    assert value(config, "scouting/multicast/enabled") is True


@pytest.mark.parametrize("which", ["listen_private_key", "connect_private_key"])
def test_a_private_key_that_others_may_read_is_refused_by_name(tmp_path, which):
    key, file = tmp_path / "boat.key", tmp_path / "zenoh.json5"
    key.write_text("secret")
    file.write_text(f'{{transport: {{link: {{tls: {{{which}: "{key}"}}}}}}}}')
    key.chmod(0o600)
    zenoh_config(ZenohSettings(config_file=str(file)))
    key.chmod(0o640)
    with pytest.raises(ConfigError, match=r"boat\.key: others may use this key .*chmod 600"):
        zenoh_config(ZenohSettings(config_file=str(file)))
    key.unlink()
    with pytest.raises(ConfigError, match=r"boat\.key: No such file"):
        zenoh_config(ZenohSettings(config_file=str(file)))


@pytest.mark.parametrize("limit_mb", [1.0, 64.0])
def test_zenoh_itself_gives_up_a_message_of_twice_the_limit(tmp_path, limit_mb):
    file = tmp_path / "zenoh.json5"
    file.write_text("{}")
    for settings in ({}, {"config_file": str(file)}):
        config = zenoh_config(ZenohSettings(max_message_mb=limit_mb, **settings))
        assert value(config, "transport/link/rx/max_message_size") == 2_000_000 * limit_mb


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
