"""How much faster than real time the lock-step simulation is, and where its time goes."""

from __future__ import annotations

import cProfile
import pstats
import time
from statistics import median
from typing import Any

from twinscrew.hil_sim.scenario import load_scenario
from twinscrew.hil_sim.sitl import SitlSettings, sail

VESSELS = 5
SEEDS = (1, 2, 3)
PARTS = {
    "lidar": (("hil_sim/world.py", "cloud"),),
    "physics": (("hil_sim/supervisor.py", "advance"),),
    "messages_out": (
        ("runtime/messages/point_cloud.py", "encode_point_cloud"),
        ("runtime/messages/navigation.py", "encode_odometry"),
    ),
    "messages_in": (
        ("runtime/messages/point_cloud.py", "decode_point_cloud"),
        ("runtime/messages/navigation.py", "decode_odometry"),
    ),
    "perception": (("runtime/vessel/pipeline.py", "_perceive"),),
    "tracking": (("runtime/tracking/tracker.py", "step"),),
    "policy": (("runtime/policy/observation.py", "observe"), ("runtime/policy/onnx.py", "act")),
    "assurance": (("runtime/safety/assurance.py", "step"),),
    "autopilot_and_link": (("hil_sim/drivers/lockstep.py", "exchange"),),
}
"""The functions whose time, with all they call, is told; no part lies in another."""


def run() -> dict[str, Any]:
    """Measure: {"sitl": {"real_time_factor", "cpu_real_time_factor", "share_percent": {...}}}.

    Nothing is recorded. The factor by CPU time is that of a core which has nothing else to do; on
    a busy machine it is still lower, as others take the caches.
    """
    measured = [_sail(seed) for seed in (SEEDS[0], *SEEDS)][1:]  # the first one warms up
    return {
        "sitl": {
            "real_time_factor": round(median(wall for wall, _ in measured), 2),
            "cpu_real_time_factor": round(median(cpu for _, cpu in measured), 2),
            "vessels": VESSELS,
            "share_percent": _shares(),
        }
    }


def _sail(seed: int) -> tuple[float, float]:
    """Sail; give how much faster than real time it was, by the wall's clock and by CPU time."""
    scenario = load_scenario("random", vessels=VESSELS, seed=seed)
    begin_s = time.process_time()
    report = sail(scenario, SitlSettings(seed=seed, lockstep=True))
    cpu_s = time.process_time() - begin_s
    return report.real_time_factor, report.real_time_factor * report.wall_s / cpu_s


def _shares() -> dict[str, float]:
    profile = cProfile.Profile()
    profile.runcall(_sail, SEEDS[0])
    stats = pstats.Stats(profile).stats  # type: ignore[attr-defined]
    whole = max(row[3] for row in stats.values())
    return {
        part: round(100.0 * sum(_spent(stats, *one) for one in functions) / whole, 1)
        for part, functions in PARTS.items()
    }


def _spent(stats: dict[tuple[str, int, str], tuple[Any, ...]], file: str, function: str) -> float:
    """Give the seconds in a function, with all it calls; 0 if it was not called."""
    found = [row[3] for key, row in stats.items() if key[0].endswith(file) and key[2] == function]
    return max(found, default=0.0)
