"""Every shipped training configuration, cut short, through the real loop."""

import math

import msgspec
import pytest
import torch

from twinscrew.runtime.settings import CONFIG_DIR
from twinscrew.training import runs
from twinscrew.training.logs import Progress
from twinscrew.training.settings import Phase, load_training
from twinscrew.training.train import Training, train

pytestmark = pytest.mark.slow

FOLDER = CONFIG_DIR / "training"
FILES = [
    *sorted(FOLDER.glob("*.toml")),
    *(
        pytest.param(file, marks=pytest.mark.nightly)  # of one algorithm, and settings of its own
        for file in sorted(FOLDER.rglob("*/*.toml"))
    ),
]


@pytest.mark.parametrize("file", FILES, ids=lambda file: file.stem)
def test_it_gathers_learns_evaluates_and_saves(file, tmp_path):
    torch.set_num_threads(1)
    loaded = load_training(file)
    agent = loaded.agent
    if hasattr(agent, "horizon"):
        agent = msgspec.structs.replace(agent, horizon=8)
    settings = msgspec.structs.replace(
        loaded,
        agent=agent,
        parallel_episodes=4,
        replay=2000,
        warm_up=60,
        batch=16,
        updates_per_step=0.5,
        log_every=10,
        evaluate_every=30,
        evaluation_episodes=1,
        rough_share=0.0,
        phases=[Phase(name="short", steps=30)],
    )
    with Progress("test", 30) as progress:
        training = Training(settings, 0, tmp_path, "cpu")
        train([training], progress)
    records = runs.read_records(tmp_path / runs.LOG)
    losses = [record["critic_loss"] for record in records if record["event"] == "train"]
    assert losses
    assert all(math.isfinite(loss) for loss in losses)
    assert training.agent.updates >= 5
    assert (tmp_path / runs.BEST).exists()
