"""The card beside a policy file: how it was made and what it scores, as JSON."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from twinscrew.export.onnx_file import write_atomically
from twinscrew.export.parity import Parity
from twinscrew.training.validate import SETTINGS, Score


def wilson(successes: int, count: int, z: float = 1.959964) -> tuple[float, float]:
    """Give the Wilson interval of a proportion; z = 1.96 for 95 %.

    Source: Wilson (1927), Probable inference, the law of succession, and statistical inference.
    """
    share = successes / count
    middle = share + z * z / (2 * count)
    half = z * math.sqrt(share * (1 - share) / count + z * z / (4 * count * count))
    scale = 1 + z * z / count
    return (middle - half) / scale, (middle + half) / scale


def scores(score: Score, episodes: int, seed: int) -> dict[str, Any]:
    """Give what a policy scores in the six settings of the paper."""
    rows = []
    rates = zip(SETTINGS, score.rates, score.times_s, strict=True)
    for (robots, buoys, distance), rate, time_s in rates:
        low, high = wilson(round(rate * episodes), episodes)
        rows.append(
            {
                "robots": robots,
                "buoys": buoys,
                "min_distance_m": distance,
                "success_rate": round(rate, 4),
                "wilson95": [round(low, 4), round(high, 4)],
                "travel_time_s": round(time_s, 2),
            }
        )
    return {"episodes": episodes, "seed": seed, "settings": rows}


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
    write_atomically((json.dumps(card, indent=1) + "\n").encode(), target)
    return target
