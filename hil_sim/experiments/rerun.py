"""Sail one episode of an experiment again, alone, with recordings, by its line."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from twinscrew.hil_sim.experiments.ablations import FULL
from twinscrew.hil_sim.experiments.episode import Sailed, sail_episode
from twinscrew.hil_sim.experiments.folder import read_folder
from twinscrew.hil_sim.experiments.plan import Experiment, Task, check
from twinscrew.hil_sim.experiments.record import EpisodeRecord
from twinscrew.hil_sim.experiments.results import FILE, read_results
from twinscrew.hil_sim.figures import draw_trajectories
from twinscrew.runtime.errors import ConfigError


@dataclass(frozen=True, slots=True)
class Rerun:
    """An episode sailed again."""

    before: EpisodeRecord
    sailed: Sailed

    @property
    def same(self) -> bool:
        """True if every decision was the same, bit for bit."""
        return self.sailed.record.decisions_sha256 == self.before.decisions_sha256


def parse_line(text: str) -> tuple[Path, int]:
    """Read `DIR:LINE`; lines count from 1, as editors and grep count them."""
    folder, colon, number = text.rpartition(":")
    if not colon or not number.isdigit() or int(number) < 1:
        raise ConfigError(f"must be DIR:LINE, as out/paper:17, got {text!r}", key="--rerun")
    return Path(folder), int(number)


def find(folder: Path, line: int) -> tuple[Experiment, EpisodeRecord]:
    """Give an experiment, and the episode in a line of its results.

    Raises
    ------
    ConfigError
        It is no results' folder, or has no such line.
    RecordingError
        Its results are damaged.
    """
    experiment = read_folder(folder).experiment
    records = read_results(folder / FILE)
    if line > len(records):
        raise ConfigError(f"there are {len(records)} episodes, none in line {line}", file=folder)
    return experiment, records[line - 1]


def rerun(experiment: Experiment, record: EpisodeRecord, folder: Path | None = None) -> Rerun:
    """Sail an episode again; with a folder, recordings and a figure are left in it.

    Raises
    ------
    PolicyError
        The method's policy is not any more what it was.
    """
    task = task_of(experiment, record)
    check(task.method)
    sailed = sail_episode(task, folder)
    if folder is not None:
        draw(folder / "trajectories.png", sailed)
    return Rerun(record, sailed)


def draw(path: Path, sailed: Sailed) -> None:
    """Draw an episode's trajectories."""
    vessels = sailed.record.vessels
    draw_trajectories(
        path,
        sailed.scenario,
        sailed.voyage.log,
        [vessel.outcome for vessel in vessels],
        [vessel.travel_time_s for vessel in vessels],
    )


def task_of(experiment: Experiment, record: EpisodeRecord) -> Task:
    """Give what an episode was made of."""
    method = next(one for one in experiment.methods if one.name == record.method)
    chosen = next(one for one in experiment.sets if one.name == record.set)
    switches = () if record.variant == FULL else tuple(record.variant.split("+"))
    return Task(method, chosen, switches, record.episode, record.seed, experiment.sensor)
