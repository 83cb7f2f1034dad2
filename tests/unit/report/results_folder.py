"""A results' folder of episodes that nobody sailed."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from tests.unit.experiments.episodes import encounter, episode, vessel

from twinscrew.hil_sim.experiments.plan import Experiment, Method, SetSettings
from twinscrew.hil_sim.experiments.results import RESULTS_FILE, EpisodeRecord, ResultsFile, begin

SETS = ("3 rob 0 obs", "5 rob 4 obs")
HIT = (vessel("collision", 8.0, "buoy", near=-0.02), vessel())


def made_up() -> list[EpisodeRecord]:
    """Two methods, two sets, three episodes: ac_iqn never fails, apf fails in four."""
    records = []
    for one in SETS:
        for number in range(3):
            good = (vessel(travel_time_s=16.0 + number), vessel(travel_time_s=17.0 + number))
            deviation = encounter("head_on", acted=False, gap_m=2.0, rule_gap_m=1.0)
            records.append(
                episode(number, "ac_iqn", good, set=one, encounters=(encounter(), deviation))
            )
            cause = (None, "buoy", "time")[number]
            vessels = HIT if cause == "buoy" else good
            records.append(episode(number, "apf", vessels, cause=cause, set=one))
    return records


def folder(path: Path, records: Iterable[EpisodeRecord], **changes) -> Path:
    """Write a results' folder; the policies' hashes are of no real file."""
    methods = tuple(Method(name=name, policy=name, sha256="0" * 64) for name in ("ac_iqn", "apf"))
    sets = tuple(
        SetSettings(name=name, vessels=n, buoys=b)
        for name, n, b in zip(SETS, (3, 5), (0, 4), strict=True)
    )
    asked = {"methods": methods, "sets": sets, "episodes": 3, "seed": 7, **changes}
    begin(path, Experiment(**asked))
    with ResultsFile(path / RESULTS_FILE) as file:
        for record in records:
            file.append(record)
    return path
