"""How much faster than real time the lock-step simulation is, and where its time goes."""

from __future__ import annotations

import cProfile
import pstats
from statistics import median
from typing import Any

from twinscrew.hil_sim.scenario import load_scenario
from twinscrew.hil_sim.sitl import SitlSettings, sail

VESSELS = 5
SEEDS = (1, 2, 3)
PARTS = {
    "lidar": ("hil_sim/world.py", "cloud"),
    "physics": ("hil_sim/supervisor.py", "advance"),
    "decode_and_core": ("runtime/app/core.py", "feed"),
    "perception": ("runtime/app/pipeline.py", "_perceive"),
    "tracking": ("runtime/tracking/tracker.py", "step"),
    "policy": ("runtime/app/pipeline.py", "_act"),
    "autopilot_and_link": ("hil_sim/drivers/lockstep.py", "exchange"),
}
"""The functions whose time, with all they call, is told; perception to policy lie in the core."""


def run() -> dict[str, Any]:
    """Measure: {"sitl": {"real_time_factor", "share_percent": {...}}}, recording nothing."""
    factors = [_sail(seed) for seed in (SEEDS[0], *SEEDS)][1:]  # the first one warms up
    return {
        "sitl": {
            "real_time_factor": round(median(factors), 2),
            "vessels": VESSELS,
            "share_percent": _shares(),
        }
    }


def _sail(seed: int) -> float:
    scenario = load_scenario("random", vessels=VESSELS, seed=seed)
    return sail(scenario, SitlSettings(seed=seed, lockstep=True)).real_time_factor


def _shares() -> dict[str, float]:
    profile = cProfile.Profile()
    profile.runcall(_sail, SEEDS[0])
    stats = pstats.Stats(profile).stats  # type: ignore[attr-defined]
    whole = max(row[3] for row in stats.values())
    shares = {}
    for part, (file, function) in PARTS.items():
        spent = [
            row[3] for key, row in stats.items() if key[0].endswith(file) and key[2] == function
        ]
        shares[part] = round(100.0 * max(spent, default=0.0) / whole, 1)
    return shares
