"""The policy files that are shipped: what their cards say, and that it is so."""

import json

import numpy as np
import onnxruntime
import pytest

from twinscrew.runtime.policy.onnx import OnnxPolicy
from twinscrew.runtime.settings import CONFIG_DIR
from twinscrew.training.evaluate import evaluate, open_policy
from twinscrew.training.scenarios import six_settings

pytestmark = pytest.mark.slow

FILES = sorted((CONFIG_DIR / "policies").glob("*.onnx"))
EVERY = pytest.mark.parametrize("file", FILES, ids=lambda file: file.stem)


def card(file):
    return json.loads(file.with_suffix(".json").read_text(encoding="utf-8"))


def test_the_default_policy_is_there():
    assert "ac_iqn" in [file.stem for file in FILES]


@EVERY
def test_the_card_belongs_to_the_file(file):
    told, metadata = card(file), OnnxPolicy(file).metadata
    assert told["policy"] == file.name
    for key, value in told["metadata"].items():
        if key in metadata.__struct_fields__ and key != "inputs":
            assert str(getattr(metadata, key)) == value


@EVERY
@pytest.mark.parametrize("row", [0, 5], ids=["3 vessels", "5 vessels, 4 buoys"])
def test_it_scores_what_its_card_says(file, row):
    """On episodes of another seed: within four standard errors of 100 episodes."""
    told = card(file)["scores"]["settings"][row]
    found = evaluate(open_policy(str(file)), six_settings()[row], episodes=100, seed=31)
    share = told["success_rate"]
    error = max(0.01, (share * (1 - share) / 100) ** 0.5)
    assert abs(found.success_rate - share) <= 4 * error
    assert found.travel_time_s == pytest.approx(told["travel_time_s"], rel=0.1)


def test_the_default_policy_is_above_the_floor_in_every_setting():
    settings = card(CONFIG_DIR / "policies" / "ac_iqn.onnx")["scores"]["settings"]
    assert settings[0]["success_rate"] >= 0.97
    assert min(row["success_rate"] for row in settings) >= 0.97


@EVERY
def test_a_vessel_behaves_the_same_alone_and_among_a_thousand(file):
    session = onnxruntime.InferenceSession(str(file), providers=["CPUExecutionProvider"])
    generator = np.random.default_rng(0)
    feed = {
        "ego": generator.normal(size=(1000, 7)).astype(np.float32) * 5,
        "objects": generator.normal(size=(1000, 5, 5)).astype(np.float32) * 5,
        "mask": (generator.random((1000, 5)) > 0.5).astype(np.float32),
    }
    together = session.run(None, feed)[0]
    for k in (0, 500, 999):
        alone = session.run(None, {name: part[k : k + 1] for name, part in feed.items()})[0]
        assert alone[0] == pytest.approx(together[k], abs=0.05)
