"""The card beside a policy file: how it was made and what it scores, as JSON."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from twinscrew.export.parity import Parity
from twinscrew.training.evaluate import Evaluation, Score
from twinscrew.training.runs import replace_file
from twinscrew.training.scenarios import six_settings


def scores(score: Score, episodes: int, seed: int) -> dict[str, Any]:
    """Give what a policy scores in the six settings: as published, and rough if it was asked."""
    found = {"episodes": episodes, "seed": seed, "settings": _rows(score.settings)}
    return found | ({"rough": _rows(score.rough)} if score.rough else {})


def _rows(kind: Sequence[Evaluation]) -> list[dict[str, Any]]:
    return [
        {
            "robots": row.robots,
            "buoys": row.buoys,
            "min_distance_m": row.min_distance_m,
            "success_rate": round(one.success_rate, 4),
            "wilson95": [round(end, 4) for end in one.wilson95],
            "travel_time_s": one.travel_time_s and round(one.travel_time_s, 2),
            "collisions": one.collisions,
            "timeouts": one.timeouts,
        }
        for row, one in zip(six_settings(), kind, strict=True)
    ]


def write_card(
    file: Path,
    metadata: Mapping[str, str],
    trained: Mapping[str, Any],
    parity: Parity,
    scored: Mapping[str, Any],
) -> Path:
    """Write the card of a policy file beside it, as NAME.json; give where."""
    card = {
        "policy": file.name,
        "metadata": {**metadata, "inputs": json.loads(metadata["inputs"])},
        "trained": trained,
        "parity": parity._asdict(),
        "scores": scored,
    }
    target = file.with_suffix(".json")
    replace_file(target, lambda out: out.write((json.dumps(card, indent=1) + "\n").encode()))
    return target
