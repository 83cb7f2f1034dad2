"""Prints the table of docs/assurance.md: what the assurance does to collisions and travel times.

    python -m tests.hil_sim.assurance_table POLICY VESSELS BUOYS EPISODES FIRST_SEED [LIMIT_S]

POLICY is `random`, or what a runtime's configuration names. Each seed is sailed twice, without the
assurance and with it, in the full simulator.
"""

from __future__ import annotations

import sys

import numpy as np
from tests.hil_sim.reckless import Episode, sail

from twinscrew.runtime.safety.assurance import AssuranceSettings


def row(episodes: list[Episode]) -> str:
    """Sum up episodes: outcomes of vessels, mean travel time of those that arrived."""
    results = [result for episode in episodes for result in episode.results]
    outcomes = [result.outcome.value for result in results if result.outcome is not None]
    counts = {name: outcomes.count(name) for name in ("goal", "collision", "timeout")}
    whole = sum(
        all(result.outcome is not None and result.outcome.value == "goal" for result in e.results)
        for e in episodes
    )
    times = [r.travel_time_s for r in results if r.outcome and r.outcome.value == "goal"]
    mean = f"{np.mean(times):.2f} s" if times else "-"
    interventions = sum(episode.interventions for episode in episodes)
    return (
        f"{len(episodes)} episodes, {whole} with all at their goals; vessels: {counts}; "
        f"travel time {mean}; {interventions} interventions"
    )


def main() -> None:
    """Sail and print, after every seed what is known so far."""
    policy, vessels, buoys, count, first = sys.argv[1], *map(int, sys.argv[2:6])
    limit_s = float(sys.argv[6]) if len(sys.argv) > 6 else None
    arms: dict[bool, list[Episode]] = {False: [], True: []}
    for seed in range(first, first + count):
        for enabled, episodes in arms.items():
            settings = AssuranceSettings(enabled=enabled)
            episodes.append(
                sail(vessels, buoys, seed, policy=policy, assurance=settings, limit_s=limit_s)
            )
        for enabled, episodes in arms.items():
            print(f"{'with' if enabled else 'without':8s}{row(episodes)}", flush=True)


if __name__ == "__main__":
    main()
