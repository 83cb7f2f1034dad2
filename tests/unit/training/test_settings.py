import pytest

from twinscrew.runtime.errors import ConfigError
from twinscrew.runtime.settings import CONFIG_DIR
from twinscrew.training.agents.ac_iqn import AcIqnSettings
from twinscrew.training.settings import load_training, parse_seeds, phase_settings

START = """
[agent]
algorithm = "ac_iqn"
[[phases]]
name = "learn"
steps = 10
"""


def written(tmp_path, text):
    file = tmp_path / "training.toml"
    file.write_text(text)
    return file


def test_little_is_needed(tmp_path):
    settings = load_training(written(tmp_path, START))
    assert isinstance(settings.agent, AcIqnSettings)
    assert settings.discount == 0.99


@pytest.mark.parametrize("file", sorted((CONFIG_DIR / "training").rglob("*.toml")), ids=str)
def test_every_shipped_configuration_can_be_read(file):
    assert load_training(file).phases


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (START + "batches = 3\n", "batches.*unknown key"),
        ("batchs = 3\n" + START, "batchs.*unknown key.*allowed: .*batch"),
        (START.replace("ac_iqn", "acqn"), "acqn"),
        (START.replace("steps = 10", "steps = 0"), r"phases\[.*\]\.steps.*got 0"),
        (START + "[phases.agent]\nrisk = 0\n", r"phase 1 \(learn\).*risk.*got 0"),
        (START + "[phases.environment.reward]\ncolision = -3\n", r"phase 1.*colision"),
        (START + "[phases.agent.network]\nkind = 'paper'\n", "networks stay the same"),
        ("[agent]\nalgorithm = 'ac_iqn'\n", "phases"),
    ],
)
def test_what_is_wrong_is_named(tmp_path, text, words):
    with pytest.raises(ConfigError, match=words):
        load_training(written(tmp_path, text))


def test_a_phase_changes_only_what_it_names(tmp_path):
    text = START + "[phases.agent]\nrisk = 0.5\n[phases.environment.reward]\ncollision = -60\n"
    settings = load_training(written(tmp_path, text))
    agent, environment, rough = phase_settings(settings, settings.phases[0])
    assert agent.risk == 0.5
    assert agent.fractions == settings.agent.fractions
    assert environment.reward.collision == -60
    assert environment.reward.goal == settings.environment.reward.goal
    assert rough == environment


def test_seeds_are_read_as_they_are_typed():
    assert parse_seeds("0,1, 7") == [0, 1, 7]


@pytest.mark.parametrize("text", ["", "a", "1,1", "0,-1", "1.5"])
def test_what_is_no_list_of_seeds_is_refused(text):
    with pytest.raises(ConfigError, match="--seeds"):
        parse_seeds(text)
