from pathlib import Path

import pytest

from twinscrew.hil_sim.bench.budgets import load_budgets
from twinscrew.hil_sim.experiments.plan import load_sets
from twinscrew.hil_sim.faults.plan import load_plan
from twinscrew.hil_sim.scenario import dnv_situations, load_scenario
from twinscrew.hil_sim.sea.sea import SeaSettings
from twinscrew.hil_sim.shapes import load_shape
from twinscrew.hil_sim.soak.limits import load_soak
from twinscrew.hil_sim.tracks.autoferry import autoferry_settings
from twinscrew.runtime.errors import ConfigError
from twinscrew.runtime.perception.sensor import load_sensor
from twinscrew.runtime.policy.load import load_policy
from twinscrew.runtime.safety.envelope import EnvelopeSettings
from twinscrew.runtime.settings import CONFIG_DIR, load
from twinscrew.runtime.vessel.config import RuntimeConfig, load_config
from twinscrew.runtime.vessel_description import load_vessel
from twinscrew.training.scenarios import six_settings
from twinscrew.training.settings import load_training

READERS = {
    "runtime.toml": load_config,
    "budgets.toml": load_budgets,
    "sensors/*": load_sensor,
    "sea/*": lambda path: load(path, SeaSettings),
    "scenarios/*": load_scenario,
    "training/*": load_training,
    "training/ablation/*": load_training,
    "shapes/*": load_shape,
    "vessels/*": load_vessel,
    "experiments/settings.toml": lambda path: six_settings(),
    "experiments/training_vessel.toml": load_vessel,
    "policies/apf.toml": lambda path: load_policy("apf"),
    "policies/mpc.toml": lambda path: load_policy("mpc"),
    "policies/orca.toml": lambda path: load_policy("orca"),
    "policies/sbmpc.toml": lambda path: load_policy("sbmpc"),
    "meetings/dnv.toml": lambda path: dnv_situations(),
    "experiments/*": load_sets,
    "faults/*": load_plan,
    "tracking/autoferry.toml": autoferry_settings,
    "envelope.toml": lambda path: load(path, EnvelopeSettings),
    "soak.toml": lambda path: load_soak(),
}
"""Who reads what; the first that fits."""


def written(folder: Path, text: str) -> Path:
    path = folder / "boat.toml"
    path.write_text(text)
    return path


@pytest.mark.parametrize(
    "path", sorted(CONFIG_DIR.rglob("*.toml")), ids=lambda path: str(path.relative_to(CONFIG_DIR))
)
def test_every_shipped_file_can_be_used_by_who_reads_it(path: Path) -> None:
    name = path.relative_to(CONFIG_DIR)
    reader = next((READERS[pattern] for pattern in READERS if name.match(pattern)), None)
    assert reader is not None, f"say in READERS who reads config/{name}"
    assert reader(path) is not None


def test_an_empty_file_gives_the_defaults(tmp_path: Path) -> None:
    config = load_config(written(tmp_path, ""))
    assert config == RuntimeConfig()
    assert (config.thrust.min_n, config.thrust.max_n, config.command_rate_hz) == (-500, 1000, 20)


def test_a_file_says_only_what_differs(tmp_path: Path) -> None:
    text = 'name = "boat7"\n[mission]\nwaypoints_m = [[10, 0], [10, 20.5]]\n'
    config = load_config(written(tmp_path, text))
    assert config.name == "boat7"
    assert config.mission.waypoints_m == ((10.0, 0.0), (10.0, 20.5))
    assert config.sensor == RuntimeConfig().sensor


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ('nmae = "boat7"', ["nmae", "unknown key", "name, vessel, sensor"]),
        ("[mission]\ngoal_radius_m = 0", ["mission.goal_radius_m", "> 0", "got 0"]),
        ("[mission]\nwaypoint_m = []", ["mission.waypoint_m", "unknown key", "waypoints_m"]),
        ("[tracking]\nspeed = 1", ["tracking.speed", "unknown key"]),
        ("[autopilot]\nsystem_id = 300", ["autopilot.system_id", "300", "255"]),
        ('[autopilot]\ncontrol = "radio"', ["autopilot.control", "radio"]),
        ('command_rate_hz = "fast"', ["command_rate_hz", "fast", "float"]),
        ("command_rate_hz = 0.01", ["command_rate_hz", ">= 20", "got 0.01"]),
        ("[odometry]\nmax_lag_s = 1.0", ["odometry.max_lag_s", "<= 0.4", "got 1.0"]),
        ("command_rate_hz = 1e6", ["command_rate_hz", "<= 1000", "got 1000000.0"]),
        ("[thrust]\nmax_n = 2000", ["thrust.max_n", "[0, 1000] N"]),
        ("[thrust]\nmin_n = -900", ["thrust.min_n", "[-500, 0] N"]),
        ("[thrust]\nmin_n = 10", ["thrust.min_n", "[-500, 0] N"]),
        ("[thrust", ["not TOML"]),
    ],
)
def test_what_cannot_be_used_is_refused_with_file_key_value_and_what_is_allowed(
    tmp_path: Path, text: str, words: list[str]
) -> None:
    path = written(tmp_path, text)
    with pytest.raises(ConfigError) as refusal:
        load_config(path)
    for word in [str(path), *words]:
        assert word in str(refusal.value)


def test_a_file_that_is_not_there_is_refused_by_name(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"none\.toml: No such file"):
        load_config(tmp_path / "none.toml")
