import re
import sys
import warnings

import pytest
from tensorboard.backend.event_processing.event_accumulator import EventAccumulator

from twinscrew.runtime.errors import ConfigError, TwinscrewError
from twinscrew.training import logs, runs
from twinscrew.training.commands import train

CONFIG = """
[agent]
algorithm = "ac_iqn"
[[phases]]
name = "learn"
steps = 40
"""
SMALL = [
    *("parallel_episodes=4", "warm_up=60", "batch=16", "updates_per_step=0.5", "log_every=5"),
    *("evaluate_every=1000", "evaluation_episodes=1", "agent.network.hidden_width=16"),
    *("agent.network.object_width=16", "agent.network.feature_width=16"),
]


@pytest.fixture
def config(tmp_path):
    file = tmp_path / "small.toml"
    file.write_text(CONFIG)
    return str(file)


def told(config, **options):
    return {
        "seeds": "0",
        "device": "cpu",
        "resume": None,
        "out": None,
        "threads": 1,
        "together": False,
    } | options


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


def sail(config, tmp_path, *changes, **options):
    """Run the command; give the run's directory."""
    folder = tmp_path / "out"
    train(config, **told(config, out=folder, changes=[*SMALL, *changes], **options))
    return folder / "seed_0"


@pytest.mark.slow
def test_keys_are_set_on_the_command_line_and_typed_as_in_toml(config, tmp_path):
    run = sail(config, tmp_path, "agent.precision=float32", "exploration.noise=0.25", steps=3)
    settings = runs.read_told(run)["settings"]
    assert settings["exploration"]["noise"] == 0.25
    assert settings["agent"]["precision"] == "float32"
    assert settings["agent"]["network"]["hidden_width"] == 16


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ("batch", "--set: expected key=value"),
        ("=3", "--set: expected key=value"),
        ("batches=3", "batches: unknown key"),
        ("batch=many", r"batch: .*got 'many'"),
        ("agent.risk=2", r"agent\.risk: .*got 2"),
    ],
)
def test_what_cannot_be_set_is_refused_by_its_key(config, tmp_path, change, words):
    with pytest.raises(ConfigError, match=words):
        sail(config, tmp_path, change)


@pytest.mark.slow
def test_a_run_stops_at_its_steps_and_goes_on_from_there(config, tmp_path):
    run = sail(config, tmp_path, "agent.precision=float32", steps=12)
    where = runs.load_checkpoint(run / runs.CHECKPOINT, "ac_iqn")["where"]
    assert where["step"] == 12
    events = [r["event"] for r in runs.read_records(run / runs.LOG)]
    assert (events[0], events[-1]) == ("start", "evaluation")
    sail(config, tmp_path, "agent.precision=float32")
    log = runs.read_records(run / runs.LOG)
    assert [r["step"] for r in log if r["event"] == "evaluation"] == [12, 40]
    assert [r["event"] for r in log].count("end") == 1


@pytest.mark.slow
def test_the_precision_is_tried_out_and_a_run_keeps_it(config, tmp_path, capsys):
    run = sail(config, tmp_path, steps=3)
    first = capsys.readouterr().err
    assert re.search(r"precision: (float32|bfloat16) \(an update takes: float32 .* bfloat16", first)
    chosen = runs.read_told(run)["settings"]["agent"]["precision"]
    assert chosen == re.search(r"precision: (\w+)", first)[1]
    sail(config, tmp_path, steps=6)
    assert "precision" not in capsys.readouterr().err
    assert runs.read_told(run)["settings"]["agent"]["precision"] == chosen


@pytest.mark.slow
def test_tensorboard_has_returns_spread_rates_and_hyper_parameters(config, tmp_path):
    run = sail(config, tmp_path, "agent.precision=float32", "environment.decision_limit=10")
    board = EventAccumulator(str(run / "tensorboard"))
    board.Reload()
    assert {
        *("train/return", "train/arrived", "train/quantile_spread", "train/rate_actor"),
        *("train/rate_critic", "train/critic_loss", "evaluation/success"),
    } <= set(board.Tags()["scalars"])
    assert board.Scalars("train/rate_critic")[-1].value < 5e-4
    assert "_hparams_/session_start_info" in board.summary_metadata


@pytest.mark.slow
def test_weights_and_biases_is_told_too_if_it_is_asked_for(config, tmp_path, monkeypatch):
    wandb = pytest.importorskip("wandb")
    monkeypatch.setenv("WANDB_MODE", "offline")
    monkeypatch.setenv("WANDB_SILENT", "true")
    logged = []
    monkeypatch.setattr(wandb.Run, "log", lambda self, values, step: logged.append((step, values)))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of another project's
        run = sail(config, tmp_path, "agent.precision=float32", wandb="boats")
    assert list((run / "wandb").glob("offline-run-*/*.wandb"))
    assert logged[-1][0] == 40
    assert any("evaluation/success" in values for _, values in logged)


def test_without_weights_and_biases_it_says_what_to_install(config, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "wandb", None)
    with pytest.raises(ConfigError, match="--wandb: not installed: pip install wandb"):
        sail(config, tmp_path, "agent.precision=float32", wandb="boats")


@pytest.mark.slow
def test_lines_tell_how_far_a_run_is_where_there_is_no_terminal(
    config, tmp_path, capsys, monkeypatch
):
    monkeypatch.setattr(logs, "EVERY_S", 0.0)
    sail(config, tmp_path, "agent.precision=float32")
    lines = capsys.readouterr().err.splitlines()
    assert re.match(r"small: step 2 of 40, \d+ transitions, [\d.]+ steps/s, gathering", lines[0])
    assert any(re.search(r"loss [\d.e-]+, \d+ min left", line) for line in lines)
    assert re.match(r"small seed 0: step 40: .*% in .* s", lines[-1])
