"""Evaluation: what counts as success, and that batches do not matter."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import torch

from twinscrew.export.command import describe
from twinscrew.export.onnx_file import DeployedPolicy, onnx_bytes
from twinscrew.runtime.cli.main import main
from twinscrew.runtime.errors import ConfigError
from twinscrew.training.agents.ac_iqn import AcIqnSettings
from twinscrew.training.environment import EnvironmentSettings, VectorEnv, steer_at_goal
from twinscrew.training.evaluate import (
    Evaluation,
    OneByOne,
    Outcomes,
    evaluate,
    open_policy,
    sail,
    score,
)
from twinscrew.training.networks import Actor, NetworkSettings, Pilot, See
from twinscrew.training.perception import PAPER, Observations
from twinscrew.training.scenarios import ScenarioSettings
from twinscrew.training.settings import Phase, TrainSettings

THREE = ScenarioSettings(robots=3, min_distance_m=30.0)


class Driver:
    """A batch policy from a function of the ego states."""

    name, layout, range_m = "driver", PAPER, 20.0

    def __init__(self, action: Callable[[np.ndarray], np.ndarray], period_s: float = 0.5) -> None:
        self.action, self.period_s = action, period_s

    def begin(self, episodes: int, vessels: int) -> None:
        pass

    def rates(self, seen: Observations, active: np.ndarray) -> np.ndarray:
        return 1000.0 * self.action(seen.ego) * active[..., None]


IDLE = Driver(lambda ego: np.zeros((*ego.shape[:2], 2)))


def test_every_episode_is_a_success_a_collision_or_a_timeout() -> None:
    result = evaluate(Driver(steer_at_goal), THREE, episodes=60, seed=1)
    successes = round(result.success_rate * 60)
    assert successes + result.collisions + result.timeouts == 60
    assert 0 < successes < 60
    assert result.travel_time_s is not None
    assert 9.0 < result.travel_time_s < 40.0  # 30 to 70 m at up to 3.3 m/s


def test_the_batch_does_not_change_the_result() -> None:
    driver = Driver(steer_at_goal)
    whole, parts = (evaluate(driver, THREE, 30, seed=2, batch=batch) for batch in (30, 7))
    assert whole == parts


def test_vessels_that_stay_where_they_are_time_out_and_have_no_travel_time() -> None:
    result = evaluate(IDLE, THREE, episodes=3, seed=0)
    assert (result.timeouts, result.collisions, result.success_rate) == (3, 0, 0.0)
    assert result.travel_time_s is None
    assert json.loads(json.dumps(result.record()))["travel_time_s"] is None


def test_the_policys_period_is_the_environments() -> None:
    fast = evaluate(Driver(steer_at_goal, period_s=0.25), THREE, episodes=20, seed=1)
    assert fast.travel_time_s is not None
    with pytest.raises(ConfigError, match="period_s"):
        evaluate(Driver(steer_at_goal, period_s=0.13), THREE, episodes=1, seed=1)


def test_a_collision_counts_before_a_timeout() -> None:
    result = score(
        Outcomes(
            np.array([True, True, False, False]),
            np.array([1, 0, 1, 0], bool),
            np.ones(2),
            np.array([1.0, 4.0]),
            np.array([True, False, False, False]),
            np.array([False, False, False, False]),
        ),
        9,
    )
    assert result.cumulative_reward == 2.5
    assert (result.quays, result.fences) == (1, 0)
    assert (result.collisions, result.timeouts, result.success_rate) == (2, 1, 0.25)
    assert result.seed == 9
    assert result.wilson95 == pytest.approx((0.0456, 0.6994), abs=1e-4)  # of 1 of 4, by hand


def test_a_vessel_that_stays_where_it_is_pays_for_every_decision() -> None:
    env = VectorEnv(EnvironmentSettings(scenarios=(THREE,)), 2, 0, auto_reset=False)
    rewards = sail(env, IDLE).rewards
    # 180 decisions of 0.5 s at -0.1 each; it drifts nowhere and meets nobody.
    assert rewards.tolist() == pytest.approx([-18.0] * 6, abs=1e-4)


def test_a_baseline_sails_one_by_one() -> None:
    policy = open_policy("apf")
    assert isinstance(policy, OneByOne)
    result = evaluate(policy, ScenarioSettings(robots=1, min_distance_m=30.0), episodes=1, seed=0)
    assert result.success_rate == 1.0


def test_the_command_prints_one_json_object_with_the_fixed_keys(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    argv = ["twinscrew", "evaluate", "apf", "--robots", "1", "--episodes", "1", "--json"]
    monkeypatch.setattr("sys.argv", argv)
    with pytest.raises(SystemExit) as ended:
        main()
    assert not ended.value.code
    record = json.loads(capsys.readouterr().out)
    assert list(record) == [
        "episodes",
        "success_rate",
        "wilson95",
        "travel_time_s",
        "collisions",
        "timeouts",
        "seed",
        "cumulative_reward",
    ]
    assert record["episodes"] == 1


@pytest.mark.parametrize(
    ("option", "word"),
    [
        (["--robots", "60"], "allowed"),
        (["--robots", "0"], "robots"),
        (["--min-distance", "80"], "72.1"),
        (["--episodes", "0"], "episodes"),
        (["--seed", "-1"], "seed"),
    ],
)
def test_an_impossible_request_ends_with_status_2_and_says_what_is_allowed(
    option: list[str],
    word: str,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("sys.argv", ["twinscrew", "evaluate", "apf", "--json", *option])
    with pytest.raises(SystemExit) as ended:
        main()
    assert ended.value.code == 2
    captured = capsys.readouterr()
    assert word in captured.err
    assert captured.out == ""


def test_evaluations_are_plain_values() -> None:
    record = Evaluation(1, 1.0, (0.2, 1.0), 12.5, 0, 0, 3, 30.0).record()
    assert json.loads(json.dumps(record))["wilson95"] == [0.2, 1.0]


def run(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, *words: str) -> str:
    """Run `twinscrew evaluate` and give what it prints."""
    monkeypatch.setattr("sys.argv", ["twinscrew", "evaluate", *words])
    with pytest.raises(SystemExit):
        main()
    captured = capsys.readouterr()
    return captured.out or captured.err


@pytest.mark.slow
def test_a_curve_over_risk_levels_is_one_object_by_level(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    settings = NetworkSettings(ego_width=16, object_width=16, hidden_width=16)
    torch.manual_seed(0)
    pilot = Pilot(See(settings), Actor(settings, extra=1), risk=0.5)
    run_told = TrainSettings(agent=AcIqnSettings(), phases=[Phase(name="none", steps=1)])
    data = onnx_bytes(DeployedPolicy(pilot, 1000.0), describe(run_told, "none", 0.5))
    file = tmp_path / "policy.onnx"
    file.write_bytes(data)
    words = [str(file), "--robots", "1", "--episodes", "2", "--json"]
    curve = json.loads(run(capsys, monkeypatch, *words, "--risks", "0.5,1,adaptive"))["risks"]
    assert list(curve) == ["0.5", "1", "adaptive"]
    own = json.loads(run(capsys, monkeypatch, *words))
    assert own == curve["0.5"]
    assert own != curve["1"]
    assert "--risk, --risks" in run(capsys, monkeypatch, *words, "--risk", "1", "--risks", "1,0.5")
