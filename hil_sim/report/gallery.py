"""Trajectories for the report: episodes sailed again, since results hold no tracks."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from itertools import zip_longest
from pathlib import Path

from twinscrew.hil_sim.experiments.episode import sail_episode
from twinscrew.hil_sim.experiments.plan import SetSettings, Task, check
from twinscrew.hil_sim.experiments.results import EpisodeRecord
from twinscrew.hil_sim.experiments.runner import draw, rerun
from twinscrew.hil_sim.report.material import Material
from twinscrew.runtime.errors import PolicyError

Told = Callable[[str], None]


@dataclass(frozen=True, slots=True)
class Picture:
    """A figure, and what to say of it."""

    file: str
    caption: str


def open_water(material: Material, folder: Path) -> Picture | None:
    """Draw the first method's first success among the most vessels without a buoy."""
    sizes = {one.name: one.vessels or 0 for one in material.experiment.sets if not one.buoys}
    chosen = [
        record
        for record in material.records
        if record.set in sizes
        and record.success
        and (record.method, record.variant) == (material.methods[0], material.main)
    ]
    if not chosen:
        return None
    record = max(chosen, key=lambda one: sizes[one.set])
    return _again(material, record, folder, "open_water.png")


def passage(material: Material, folder: Path) -> Picture | None:
    """Draw the shipped passage of four buoys, sailed by the first method."""
    method = material.experiment.methods[0]
    chosen = SetSettings(name="passage", scenario="passage")
    experiment = material.experiment
    task = Task(method, chosen, experiment.variants[0], 0, experiment.seed, experiment.sensor)
    try:
        check(method)
    except PolicyError as error:
        return _missing("passage.png", error)
    sailed = sail_episode(task)
    draw(folder / "passage.png", sailed)
    end = "all arrived" if sailed.record.success else f"failed ({sailed.record.cause})"
    how = f"scenario `passage`, seed {task.seed}"
    return Picture("passage.png", f"{method.name} in the {how}: {end}")


def failures(
    material: Material, folder: Path, count: int, told: Told | None = None
) -> list[Picture]:
    """Draw failures, in turn of every method and every cause."""
    pictures = []
    for i, record in enumerate(choose(material, count), start=1):
        if told is not None:
            told(f"failure {i}")
        pictures.append(_again(material, record, folder, f"failure_{i}.png"))
    return pictures


def choose(material: Material, count: int) -> list[EpisodeRecord]:
    """Choose failures: one of every method, then of another cause of each, and so on."""
    kinds: dict[str, dict[str, list[EpisodeRecord]]] = {name: {} for name in material.methods}
    for record in material.records:
        if record.variant == material.main and record.cause is not None:
            kinds[record.method].setdefault(record.cause, []).append(record)
    return _in_turn(_in_turn(causes.values()) for causes in kinds.values())[:count]


def _in_turn(lists: Iterable[list[EpisodeRecord]]) -> list[EpisodeRecord]:
    """Give the first of every list, then the second of every list that has one, and so on."""
    return [one for row in zip_longest(*lists) for one in row if one is not None]


def _again(material: Material, record: EpisodeRecord, folder: Path, file: str) -> Picture:
    try:
        result = rerun(material.experiment, record)
    except PolicyError as error:
        return _missing(file, error)
    draw(folder / file, result.sailed)
    end = "all arrived" if record.success else f"failed: {_why(record)}"
    same = "" if result.same else " (sailed again on this machine, its decisions differ)"
    line = material.line_of(record)
    return Picture(
        file,
        f"{record.method}, {record.set}, episode {record.episode}, seed {record.seed}, "
        f"line {line}: {end}{same}",
    )


def _why(record: EpisodeRecord) -> str:
    return {
        "vessel": "a vessel hit a vessel",
        "buoy": "a vessel hit a buoy",
        "quay": "a vessel hit a quay, or ran aground",
        "fence": "a vessel entered a fence",
        "time": "a vessel ran out of time",
    }[record.cause or "time"]


def _missing(file: str, error: PolicyError) -> Picture:
    return Picture("", f"{file} is missing: {error}")
