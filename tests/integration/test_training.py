"""A whole training run, small: gathered, learnt, evaluated, saved, killed, resumed, exported."""

import json
import shutil
import signal
import subprocess
import sys
import time

import pytest
import torch

from twinscrew.export.command import export
from twinscrew.runtime.errors import ConfigError
from twinscrew.training import evaluate, runs
from twinscrew.training.evaluate import open_policy
from twinscrew.training.logs import Progress
from twinscrew.training.scenarios import six_settings
from twinscrew.training.settings import load_training
from twinscrew.training.train import Training, train

pytestmark = pytest.mark.slow

CONFIG = """
parallel_episodes = 8
warm_up = 200
batch = 32
updates_per_step = 0.5
log_every = 10
evaluate_every = 20
evaluation_episodes = 2
[agent]
algorithm = "ac_iqn"
precision = "float32"
[agent.network]
object_width = 16
feature_width = 32
hidden_width = 32
[[phases]]
name = "first"
steps = 40
[[phases]]
name = "second"
steps = {second}
keep_replay = false
[phases.environment.reward]
collision = -60
[phases.agent]
risk = 0.5
"""


def written(tmp_path, second=20):
    file = tmp_path / "small.toml"
    file.write_text(CONFIG.format(second=second))
    return file


def trained(folder, file, seed=0):
    settings = load_training(file)
    with runs.locked(folder), Progress("test", 60) as progress:
        training = Training(settings, seed, folder, "cpu")
        train([training], progress)
    return training


@pytest.fixture(autouse=True)
def _one_thread():
    torch.set_num_threads(1)


@pytest.fixture(autouse=True)
def _one_setting(monkeypatch):
    """Validate in the first of the six settings alone: what is tested lies elsewhere."""
    monkeypatch.setattr(evaluate, "six_settings", lambda: six_settings()[:1])


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """A run to its end, validated in all six settings: where it was made, and what it is."""
    folder = tmp_path_factory.mktemp("whole")
    return folder, trained(folder / "run", written(folder))


@pytest.fixture
def finished(whole, tmp_path):
    """A copy of it, for what goes on with it: its file and its folder."""
    shutil.copytree(whole[0], tmp_path, dirs_exist_ok=True)
    return tmp_path / "small.toml", tmp_path / "run"


def weights(training):
    return torch.cat([p.flatten() for p in training.agent.average_actor.parameters()])


def test_a_run_logs_evaluates_and_saves(whole):
    folder, training = whole
    log = runs.read_records(folder / "run" / runs.LOG)
    assert [r["event"] for r in (log[0], log[-1])] == ["start", "end"]
    evaluations = [r for r in log if r["event"] == "evaluation"]
    assert [r["step"] for r in evaluations] == [20, 40, 60]
    assert [r["phase"] for r in evaluations] == ["first", "first", "second"]
    assert all(len(r["rates"]) == 6 for r in evaluations)
    assert training.agent.settings.risk == 0.5
    assert 15 <= training.agent.updates <= 30
    assert list((folder / "run" / "tensorboard").glob("events*"))


def test_the_same_seed_gives_the_same_policy_and_another_another(whole, tmp_path):
    _, one = whole
    same, other = (trained(tmp_path / f"{s}", written(tmp_path), s) for s in (0, 1))
    assert torch.equal(weights(one), weights(same))
    assert not torch.equal(weights(one), weights(other))


def test_a_finished_run_takes_further_phases_from_where_it_ended(whole, finished):
    longer, folder = finished
    longer.write_text(longer.read_text() + '[[phases]]\nname = "third"\nsteps = 20\n')
    second = trained(folder, longer)
    assert second.step == whole[1].step + 20
    assert second.agent.updates > whole[1].agent.updates


def test_a_run_of_before_a_setting_existed_goes_on(whole, finished):
    file, folder = finished
    told = json.loads((folder / runs.CONFIG).read_text())
    del told["settings"]["priority"]
    (folder / runs.CONFIG).write_text(json.dumps(told))
    assert trained(folder, file).step == whole[1].step


def test_a_directory_of_another_configuration_is_refused(finished):
    file, folder = finished
    with pytest.raises(ConfigError, match="another configuration or seed"):
        trained(folder, file, seed=5)
    with pytest.raises(ConfigError, match="another configuration"):
        trained(folder, written(file.parent, second=30))


class KilledError(Exception):
    """What ends a run in the middle of things."""


def log_of(folder):
    """The records of a run, without the times of the clock."""
    log = runs.read_records(folder / runs.LOG)
    return [{k: v for k, v in r.items() if k not in ("time", "seconds")} for r in log]


@pytest.mark.parametrize("killed_at", [27, 47])
def test_a_run_that_was_cut_off_becomes_the_run_that_was_not(tmp_path, killed_at, monkeypatch):
    file = written(tmp_path)
    whole = trained(tmp_path / "whole", file)
    assert not list((tmp_path / "whole").glob("replay_*"))  # a finished run needs none
    take = Training.take

    def stumble(self, step):
        take(self, step)
        if self.step == killed_at:
            raise KilledError

    with monkeypatch.context() as patch:
        patch.setattr(Training, "take", stumble)
        with pytest.raises(KilledError):
            trained(tmp_path / "cut", file)
    again = trained(tmp_path / "cut", file)
    assert torch.equal(weights(again), weights(whole))
    assert torch.equal(again.memory.rows, whole.memory.rows)
    assert log_of(tmp_path / "cut") == log_of(tmp_path / "whole")


def test_seeds_that_train_together_become_those_that_train_alone(tmp_path):
    file = written(tmp_path)
    alone = [trained(tmp_path / f"alone_{seed}", file, seed) for seed in (0, 1)]
    settings = load_training(file)
    both = [Training(settings, seed, tmp_path / f"seed_{seed}", "cpu") for seed in (0, 1)]
    for one in both:
        one.folder.mkdir()
    with Progress("test", 60) as progress:
        train(both, progress)
    for one, other in zip(alone, both, strict=True):
        assert one.agent.updates == other.agent.updates > 10
        assert torch.allclose(weights(one), weights(other), atol=1e-4)
        rates = [
            [r["rates"] for r in log_of(run.folder) if r["event"] == "evaluation"]
            for run in (one, other)
        ]
        assert rates[0] == rates[1]
    first = trained(tmp_path / "seed_0", file)  # each is a run of its own, that can go on alone
    assert first.step == 60


def test_runs_that_are_not_equally_far_do_not_train_together(tmp_path):
    file = written(tmp_path)
    trained(tmp_path / "seed_0", file)
    (tmp_path / "seed_1").mkdir()
    settings = load_training(file)
    both = [Training(settings, seed, tmp_path / f"seed_{seed}", "cpu") for seed in (0, 1)]
    with pytest.raises(ConfigError, match="not equally far"), Progress("test", 60) as progress:
        train(both, progress)


def test_a_killed_run_goes_on_from_its_last_checkpoint(tmp_path):
    file, out = written(tmp_path, second=4000), tmp_path / "out"
    command = [sys.executable, "-m", "twinscrew.runtime.cli", "train", str(file), "--out", str(out)]
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    checkpoint = out / "seed_0" / runs.CHECKPOINT
    while not checkpoint.exists():
        assert process.poll() is None
        time.sleep(0.1)
    process.send_signal(signal.SIGKILL)
    process.wait()
    before = runs.load_checkpoint(checkpoint, "ac_iqn")["where"]
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    while runs.load_checkpoint(checkpoint, "ac_iqn")["where"]["step"] <= before["step"]:
        assert process.poll() is None
        time.sleep(0.1)
    process.send_signal(signal.SIGKILL)
    process.wait()
    log = runs.read_records(out / "seed_0" / runs.LOG)
    assert [r["event"] for r in log].count("start") == 1
    assert runs.load_checkpoint(checkpoint, "ac_iqn")["where"]["updates"] > before["updates"]


def test_a_run_that_is_asked_to_stop_saves_says_where_and_goes_on(tmp_path):
    """The first networks are there within seconds; SIGTERM and Ctrl-C save all that was learnt."""
    file, out = written(tmp_path, second=400_000), tmp_path / "out"
    file.write_text(file.read_text().replace("evaluate_every = 20", "evaluate_every = 100000"))
    command = [sys.executable, "-m", "twinscrew.runtime.cli", "train", str(file), "--out", str(out)]
    step = 0
    for number in (signal.SIGTERM, signal.SIGINT):
        process = subprocess.Popen(command, stderr=subprocess.PIPE, text=True)
        latest = out / "seed_0" / runs.LATEST
        while not latest.exists():
            assert process.poll() is None
            time.sleep(0.1)
        process.send_signal(number)
        _, said = process.communicate()
        checkpoint = out / "seed_0" / runs.CHECKPOINT
        assert f"saved {checkpoint}" in said
        assert process.returncode == 128 + number
        where = runs.load_checkpoint(checkpoint, "ac_iqn")["where"]
        assert where["step"] > step
        assert where["updates"] > 0
        assert not latest.exists()  # the checkpoint is newer
        step = where["step"]


@pytest.mark.parametrize("name", [runs.LATEST, runs.CHECKPOINT])
def test_whatever_a_run_has_saved_can_be_exported_and_sailed(tmp_path, name, capsys, monkeypatch):
    monkeypatch.setattr(evaluate, "six_settings", six_settings)  # for the card
    run = tmp_path / "run" / "seed_0"
    training = Training(load_training(written(tmp_path)), 0, run)
    with runs.locked(run), training.opened():
        training.keep_latest() if name == runs.LATEST else training.save()
    export(run, tmp_path / "mine.onnx", episodes=1, margin=None, risk=None, seed=1, last=False)
    assert name in capsys.readouterr().err
    card = json.loads((tmp_path / "mine.json").read_text())
    assert card["trained"]["checkpoint"]["selected_on"] is None
    assert open_policy(str(tmp_path / "mine.onnx")).name == "ac_iqn"
