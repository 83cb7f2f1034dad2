"""What a report is made of: an experiment's folder, its cells, and what others published."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from twinscrew.hil_sim.experiments.plan import (
    Experiment,
    calmed,
    eased,
    episode_seed,
    label,
    load_sets,
    vessel_of,
)
from twinscrew.hil_sim.experiments.results import (
    RESULTS_FILE,
    EpisodeRecord,
    Folder,
    read_folder,
    read_results,
)
from twinscrew.hil_sim.experiments.summary import Cell, summarise
from twinscrew.hil_sim.sea.sea import SeaSettings
from twinscrew.runtime.errors import ConfigError
from twinscrew.runtime.settings import load, shipped
from twinscrew.runtime.vessel_description import load_vessel


@dataclass(frozen=True, slots=True)
class Trained:
    """A method's score in one set of the training environment (`twinscrew evaluate`)."""

    success_rate: float
    episodes: int
    travel_time_s: float
    """[s] nan if nothing arrived."""


@dataclass(frozen=True)
class Material:
    """An experiment's results, ready to be told."""

    path: Path
    folder: Folder
    records: tuple[EpisodeRecord, ...]
    trained: Mapping[str, tuple[Trained, ...]]
    """By method, one a set."""

    @property
    def experiment(self) -> Experiment:
        """What was asked for."""
        return self.folder.experiment

    @property
    def methods(self) -> list[str]:
        """Names, in the order in which they were given."""
        return [method.name for method in self.experiment.methods]

    @property
    def sets(self) -> list[str]:
        """Names, in the order of the file."""
        return [one.name for one in self.experiment.sets]

    @property
    def variants(self) -> list[str]:
        """Names, the main one first."""
        return [label(switches) for switches in self.experiment.variants]

    @cached_property
    def cells(self) -> dict[tuple[str, str, str], Cell]:
        """The figures by method, set, variant; what was not sailed yet is missing."""
        return {(one.method, one.set, one.variant): one for one in summarise(self.records)}

    @cached_property
    def pooled(self) -> dict[tuple[str, str], Cell]:
        """The figures by method and variant, over all sets."""
        cells = {}
        for method in self.methods:
            for variant in self.variants:
                chosen = [r for r in self.records if (r.method, r.variant) == (method, variant)]
                if chosen:
                    (cells[method, variant],) = summarise(_merged(chosen))
        return cells

    @cached_property
    def published(self) -> dict[tuple[str, str], float]:
        """[s] The paper's travel times by method and set; nan where nothing succeeded."""
        paper = load_sets("paper")
        return {
            (method, one.name): value
            for method, row in paper.published_travel_time_s.items()
            for one, value in zip(paper.set, row, strict=True)
        }

    @property
    def main(self) -> str:
        """The variant that the tables are of: the first, the full simulator unless asked."""
        return self.variants[0]

    def full(self, method: str, set_name: str) -> Cell | None:
        """Give the figures in the main variant."""
        return self.cells.get((method, set_name, self.main))

    def line_of(self, record: EpisodeRecord) -> int:
        """Give the line of results.jsonl that holds an episode."""
        return self.records.index(record) + 1


@dataclass(frozen=True, slots=True)
class Conditions:
    """In what the main variant was sailed: each value once, in the order of the sets."""

    seas: tuple[SeaSettings, ...]
    time_limits_s: tuple[float, ...]
    """[s] A vessel under way longer has failed."""
    goal_radii_m: tuple[float, ...]
    """[m] A vessel whose origin is this near its goal has arrived."""
    hull_radii_m: tuple[float, ...]
    """[m] Of the circles with which contacts are judged."""
    buoy_radii_m: tuple[float, ...]
    """[m] None without a buoy."""


def conditions(experiment: Experiment) -> Conditions:
    """Say in what an experiment's main variant is sailed, from the first episode of each set.

    Raises
    ------
    ConfigError
        A set's scenario, sea or vessel is not there any more.
    """
    switches = experiment.variants[0]
    scenarios = [
        eased(one.draw(episode_seed(experiment.seed, one.name, 0)), switches)
        for one in experiment.sets
    ]
    seas = [calmed(load(shipped("sea", s.sea), SeaSettings), switches) for s in scenarios]
    hulls = [vessel_of(switches, load_vessel(kind)) for s in scenarios for kind in s.types]
    return Conditions(
        seas=tuple(dict.fromkeys(seas)),
        time_limits_s=tuple(dict.fromkeys(s.time_limit_s for s in scenarios)),
        goal_radii_m=tuple(dict.fromkeys(s.goal_radius for s in scenarios)),
        hull_radii_m=tuple(dict.fromkeys(r for hull in hulls for _, r in hull.circles_m)),
        buoy_radii_m=tuple(dict.fromkeys(r for s in scenarios for r in s.buoys[:, 2].tolist())),
    )


def gather(path: Path, evaluations: Iterable[str] = ()) -> Material:
    """Read a results' folder, and training evaluations given as `METHOD=FILE`.

    Raises
    ------
    ConfigError
        It is no results' folder, it is empty, or an evaluation cannot be used.
    RecordingError
        Its results are damaged.
    """
    folder = read_folder(path)
    records = tuple(read_results(path / RESULTS_FILE)) if (path / RESULTS_FILE).is_file() else ()
    if not records:
        raise ConfigError("no episode has been sailed yet", file=path)
    count = len(folder.experiment.sets)
    return Material(path, folder, records, dict(_trained(text, count) for text in evaluations))


def _trained(text: str, sets: int) -> tuple[str, tuple[Trained, ...]]:
    method, equals, name = text.partition("=")
    if not equals:
        raise ConfigError(f"must be METHOD=FILE, got {text!r}", key="--evaluations")
    try:
        rows = json.loads(Path(name).read_text())["settings"]
        scores = tuple(_score(row) for row in rows)
    except OSError as error:
        raise ConfigError(error.strerror or str(error), file=name) from error
    except (ValueError, KeyError, TypeError, RecursionError) as error:
        what = "not what `twinscrew evaluate --all --json` prints"
        raise ConfigError(f"{what} ({error!r})", file=name) from error
    if len(scores) != sets:
        raise ConfigError(f"has {len(scores)} settings, the experiment {sets} sets", file=name)
    return method, scores


def _score(row: Mapping[str, float | None]) -> Trained:
    rate, episodes, time_s = row["success_rate"], row["episodes"], row["travel_time_s"]
    if rate is None or episodes is None:
        raise ValueError(row)
    return Trained(float(rate), int(episodes), math.nan if time_s is None else float(time_s))


def _merged(records: list[EpisodeRecord]) -> list[EpisodeRecord]:
    """Give episodes as of one set, so that they are one cell."""
    from msgspec.structs import replace

    return [replace(record, set="all") for record in records]
