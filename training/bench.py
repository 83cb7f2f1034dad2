"""`twinscrew bench --only training`: how fast the environment and the learner are."""

from __future__ import annotations

from typing import Any

from twinscrew.training.bench_environment import vessel_steps_per_s
from twinscrew.training.bench_learner import update_speed


def run() -> dict[str, Any]:
    """Give the figures under the key "training"."""
    return {"training": {**vessel_steps_per_s(), **update_speed()}}
