"""What the doctor says of a policy and its card."""

import json
import shutil
from pathlib import Path

import numpy as np
import pytest

from twinscrew.runtime.doctor.checks import Verdict, check_card, check_policy
from twinscrew.runtime.policy import load
from twinscrew.runtime.policy.observation import PAPER
from twinscrew.runtime.settings import CONFIG_DIR
from twinscrew.runtime.vessel.config import RuntimeConfig

SHIPPED = CONFIG_DIR / "policies" / "ac_iqn.onnx"


@pytest.fixture
def mine(tmp_path: Path) -> Path:
    """A policy file of one's own, with its card."""
    for suffix in (".onnx", ".json"):
        shutil.copy(SHIPPED.with_suffix(suffix), tmp_path / f"mine{suffix}")
    return tmp_path / "mine.onnx"


def edit(policy: Path, **changes: object) -> None:
    card = policy.with_suffix(".json")
    card.write_text(json.dumps({**json.loads(card.read_text()), **changes}))


def judged(policy: Path | str) -> tuple[Verdict, str]:
    found = check_card(RuntimeConfig(policy=str(policy)))
    return found.verdict, found.found


def test_the_shipped_policy_has_its_card(mine: Path) -> None:
    for policy in ("ac_iqn", mine):
        verdict, told = judged(policy)
        assert verdict is Verdict.OK
        assert "% success" in told


def test_a_policy_that_is_no_file_needs_no_card() -> None:
    assert judged("apf")[0] is Verdict.OK


def test_a_policy_without_a_card_is_a_warning(mine: Path) -> None:
    mine.with_suffix(".json").unlink()
    assert judged(mine) == (Verdict.WARN, "no mine.json")


def test_the_card_of_another_policy_fails(mine: Path) -> None:
    card = json.loads(mine.with_suffix(".json").read_text())
    edit(mine, metadata={**card["metadata"], "training_run": "sac/seed_7"})
    verdict, told = judged(mine)
    assert verdict is Verdict.FAIL
    assert "sac/seed_7" in told


@pytest.mark.parametrize(
    "words", ["", "[]", "{}", "no JSON", pytest.param("[" * 100_000, id="deep")]
)
def test_what_is_no_card_fails(mine: Path, words: str) -> None:
    mine.with_suffix(".json").write_text(words)
    assert judged(mine)[0] is Verdict.FAIL


@pytest.mark.parametrize("rates", [[], ["all"], [None], [float("nan")], [1.5]])
def test_a_card_whose_success_is_no_share_fails(mine: Path, rates: list[object]) -> None:
    edit(mine, scores={"settings": [{"success_rate": rate} for rate in rates]})
    verdict, told = judged(mine)
    assert verdict is Verdict.FAIL
    assert "mine.json is no card" in told


def test_a_policy_that_often_fails_is_a_warning(mine: Path) -> None:
    edit(mine, scores={"settings": [{"success_rate": 0.995}, {"success_rate": 0.6}]})
    verdict, told = judged(mine)
    assert verdict is Verdict.WARN
    assert "60.0 to 99.5 %" in told


def test_a_policy_that_answers_differently_each_time_fails(monkeypatch: pytest.MonkeyPatch) -> None:
    class Moody:
        name, period_s, shown = "moody", 0.5, PAPER
        rng = np.random.default_rng(0)

        def act(self, observation: object) -> object:
            return self.rng.normal(size=2)

    monkeypatch.setattr(load, "load_policy", lambda *args: Moody())
    found = check_policy(RuntimeConfig())
    assert found.verdict is Verdict.FAIL
    assert "answers differ" in found.found
