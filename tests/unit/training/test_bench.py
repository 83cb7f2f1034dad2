"""The benchmark times real episodes."""

from __future__ import annotations

import msgspec
import numpy as np
import pytest

from twinscrew.runtime.settings import shipped
from twinscrew.training import bench
from twinscrew.training.bench import faster_precision, update_speed, vessel_steps_per_s
from twinscrew.training.environment import VectorEnv, steer_at_goal
from twinscrew.training.settings import load_training


def test_the_benchmark_gives_its_figures() -> None:
    figures = vessel_steps_per_s(episodes=4, rounds=2)
    assert figures["vessel_steps_per_s_best"] >= figures["vessel_steps_per_s"] > 0


def test_its_driver_brings_vessels_to_their_goals() -> None:
    env = VectorEnv(episodes=8, seed=0)
    seen, arrived = env.reset(), 0
    for _ in range(80):
        result = env.step(steer_at_goal(seen.ego))
        seen = result.observation
        arrived += int(result.reached.sum())
    assert arrived > 8
    assert np.isfinite(seen.ego).all()


@pytest.mark.slow
def test_both_precisions_are_printed_and_the_faster_is_the_update(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(bench, "UPDATES", 4)
    speed = update_speed()
    times = {name: speed[f"update_{name}_ms"] for name in ("float32", "bfloat16")}
    assert speed["update_ms"] == times[speed["precision"]] == min(times.values()) > 0.0
    assert speed["samples_per_s"] == pytest.approx(256 / (speed["update_ms"] * 1e-3))


@pytest.mark.parametrize("name", ["sac", "rainbow", "ppo"])
def test_the_precision_of_every_algorithm_can_be_tried(name: str) -> None:
    settings = msgspec.structs.replace(load_training(shipped("training", name)), batch=16)
    precision, times = faster_precision(settings, updates=1)
    assert precision in times
