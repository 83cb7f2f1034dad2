import json
import shutil

import msgspec
import numpy as np
import pytest
import torch

from twinscrew.export import parity
from twinscrew.export.command import export
from twinscrew.export.onnx_file import DeployedPolicy
from twinscrew.export.run_dir import load_run
from twinscrew.runtime.errors import ConfigError, PolicyError
from twinscrew.runtime.messages.types import Observation
from twinscrew.runtime.policy.onnx import OnnxPolicy
from twinscrew.runtime.policy.risk import RiskSettings
from twinscrew.training import runs
from twinscrew.training.agents import make_agent
from twinscrew.training.agents.ac_iqn import AcIqnSettings
from twinscrew.training.networks import NetworkSettings
from twinscrew.training.settings import Phase, TrainSettings

SMALL = NetworkSettings(ego_width=16, object_width=16, hidden_width=16)
AGENT = AcIqnSettings(network=SMALL)
TOLD = AcIqnSettings(network=SMALL, risk_levels=8)


def make_run(folder, told_agent, **phase):
    """Make a run directory as training leaves it, of an agent that has learnt nothing."""
    folder.mkdir()
    settings = TrainSettings(agent=told_agent, phases=[Phase(name="none", steps=1, **phase)])
    told = {"seed": 7, "settings": msgspec.to_builtins(settings)}
    (folder / runs.CONFIG).write_text(json.dumps(told))
    runs.append_record(folder / runs.LOG, {"event": "start", "machine": "a test"})
    agent = make_agent(told_agent, 7, "cpu")
    score = json.dumps({"success": 0.0})
    content = {"agent": agent.state(), "phase": 0, "where": {"step": 1}, "score": score}
    runs.save_checkpoint(folder / runs.BEST, "ac_iqn", content)
    return folder


@pytest.fixture(scope="module")
def run_dir(tmp_path_factory):
    return make_run(tmp_path_factory.mktemp("runs") / "seed_7", AGENT)


@pytest.fixture(scope="module")
def file(run_dir, tmp_path_factory):
    out = tmp_path_factory.mktemp("policies") / "made.onnx"
    export(run_dir, out, margin=1.2, episodes=1, seed=3, last=False, json_=False)
    return out


@pytest.mark.slow
def test_the_runtime_accepts_the_file(file, run_dir):
    policy = OnnxPolicy(file)
    assert policy.name == "ac_iqn"
    assert policy.period_s == 0.5
    assert policy.metadata.radius_margin == 1.2
    assert policy.metadata.training_run == f"{run_dir.parent.name}/seed_7"


def test_the_file_decides_as_the_agent(file, run_dir):
    agent = make_agent(AGENT, 0, "cpu")
    agent.restore(runs.load_checkpoint(run_dir / runs.BEST, "ac_iqn")["agent"])
    seen = parity.recorded_observations(decisions=3)
    with torch.no_grad():
        expected = agent.deployed(1.2)(seen) * 1000.0
    policy = OnnxPolicy(file)
    for k in (0, 17, 60):
        one = Observation(
            ego=seen.ego[k].numpy(), objects=seen.objects[k].numpy(), mask=seen.mask[k].numpy()
        )
        assert policy.act(one).tolist() == pytest.approx(expected[k].tolist(), abs=0.05)


def test_the_card_tells_how_it_was_made_and_what_it_scores(file):
    card = json.loads(file.with_suffix(".json").read_text())
    assert card["policy"] == "made.onnx"
    assert card["trained"]["seed"] == 7
    assert card["trained"]["machine"] == "a test"
    assert card["parity"]["max_difference_n_per_s"] < 0.05
    assert card["scores"]["seed"] == 3
    assert [(row["robots"], row["buoys"]) for row in card["scores"]["settings"]] == [
        (3, 0), (4, 0), (5, 0), (5, 2), (5, 3), (5, 4)
    ]  # fmt: skip
    low, high = card["scores"]["settings"][0]["wilson95"]
    assert 0.0 <= low <= card["scores"]["settings"][0]["success_rate"] <= high <= 1.0


def test_a_file_of_another_network_is_refused(file, run_dir):
    other = DeployedPolicy(make_agent(AGENT, 99, "cpu").deployed(1.2), 1000.0)
    with pytest.raises(PolicyError, match="differs from the network"):
        parity.check_parity(other, file)


def test_a_folder_without_a_run_is_refused(tmp_path):
    with pytest.raises(ConfigError, match="no training run here"):
        export(tmp_path, tmp_path / "p.onnx", None, 1, 0, False, False)


def test_a_run_without_that_checkpoint_is_refused(run_dir, tmp_path):
    with pytest.raises(ConfigError, match=r"checkpoint\.pt.*No such file"):
        export(run_dir, tmp_path / "p.onnx", None, 1, 0, last=True, json_=False)


@pytest.mark.slow
@pytest.mark.parametrize(("asked", "level"), [(None, 0.25), (0.75, 0.75)])
def test_a_conditioned_policy_holds_its_phases_level_or_the_one_asked_for(tmp_path, asked, level):
    run_dir = make_run(tmp_path / "seed_0", TOLD, agent={"risk": 0.25})
    out = tmp_path / "made.onnx"
    export(run_dir, out, margin=1.0, risk=asked, episodes=1, seed=3, last=False, json_=False)
    inputs = json.loads(OnnxPolicy(out).metadata.inputs)
    assert inputs["risk"]["default"] == level
    one = Observation(
        ego=np.array([20.0, 3.0, 1.0, 0.0, 0.0, 100.0, 200.0], np.float32),
        objects=np.zeros((5, 5), np.float32),
        mask=np.zeros(5, np.float32),
    )
    told = OnnxPolicy(out, risk=RiskSettings(level=level)).act(one)
    assert OnnxPolicy(out).act(one).tolist() == told.tolist()
    assert OnnxPolicy(out, risk=RiskSettings(level=0.125)).act(one).tolist() != told.tolist()


def test_a_level_is_refused_for_a_policy_that_takes_none(run_dir, tmp_path):
    with pytest.raises(ConfigError, match="not trained for risk levels"):
        export(run_dir, tmp_path / "a.onnx", margin=1.0, risk=0.5, episodes=1)


@pytest.mark.parametrize(
    "change",
    [
        {"agent": {}},
        {"agent": None},
        {"phase": 7},
        {"phase": "last"},
        {"where": None},
        {"score": "no JSON"},
    ],
)
def test_a_checkpoint_that_holds_something_else_is_refused_by_name(run_dir, tmp_path, change):
    folder = shutil.copytree(run_dir, tmp_path / "seed_7")
    content = runs.load_checkpoint(folder / runs.BEST, "ac_iqn")
    runs.save_checkpoint(folder / runs.BEST, "ac_iqn", content | change)
    with pytest.raises(ConfigError, match=r"best\.pt: damaged, or of another version"):
        load_run(folder)


def test_weights_of_other_networks_are_refused_by_name(run_dir, tmp_path):
    larger = msgspec.structs.replace(AGENT, network=msgspec.structs.replace(SMALL, ego_width=24))
    folder = make_run(tmp_path / "seed_7", larger)
    shutil.copy(run_dir / runs.BEST, folder / runs.BEST)
    with pytest.raises(ConfigError, match=r"best\.pt: damaged, or of another version"):
        load_run(folder)


@pytest.mark.parametrize("change", [{"seed": None}, {"seed": "one"}, {"settings": []}])
def test_a_run_that_was_told_something_else_is_refused_by_name(run_dir, tmp_path, change):
    folder = shutil.copytree(run_dir, tmp_path / "seed_7")
    told = json.loads((folder / runs.CONFIG).read_text())
    (folder / runs.CONFIG).write_text(json.dumps(told | change))
    with pytest.raises(ConfigError, match=r"config\.json"):
        load_run(folder)
