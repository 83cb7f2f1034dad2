"""A results' folder: it carries its experiment, and takes no other one's episodes."""

from __future__ import annotations

import os
import shutil
import subprocess
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import msgspec

from twinscrew.hil_sim.experiments.plan import Experiment
from twinscrew.runtime.app.recorder import software
from twinscrew.runtime.errors import NOT_THE_FORMAT, ConfigError
from twinscrew.runtime.settings import CONFIG_DIR, Settings, convert

FILE = "experiment.json"


class Origin(Settings, frozen=True, kw_only=True):
    """By what the results were made."""

    commit: str
    """Of the checkout; "-dirty" if it was not clean, "unknown" outside of one."""
    software: dict[str, str]
    machine: str


class Folder(Settings, frozen=True, kw_only=True):
    """What experiment.json holds."""

    experiment: Experiment
    origins: tuple[Origin, ...]
    """The first, and every different one that went on with it."""


def read_folder(path: Path) -> Folder:
    """Read what a folder's results are of.

    Raises
    ------
    ConfigError
        It is no results' folder.
    """
    file = path / FILE
    try:
        values = msgspec.json.decode(file.read_bytes())
    except OSError as error:
        what = "not a folder of results" if path.is_dir() else "no such folder"
        raise ConfigError(f"{what} ({error.strerror})", file=path) from error
    except NOT_THE_FORMAT as error:
        raise ConfigError(f"damaged: {error}", file=file) from error
    return convert(values, Folder, file=file)


def begin(path: Path, experiment: Experiment) -> Folder:
    """Make a new results' folder; an empty one will do.

    Raises
    ------
    ConfigError
        The folder holds something already, or cannot be made.
    """
    try:
        path.mkdir(parents=True, exist_ok=True)
        if any(path.iterdir()):
            raise ConfigError("the folder is not empty", file=path)
    except OSError as error:
        raise ConfigError(error.strerror or str(error), file=path) from error
    return _write(path, Folder(experiment=experiment, origins=(origin(),)))


def go_on(path: Path, asked: Mapping[str, Any]) -> Folder:
    """Open a results' folder to go on with its experiment, or to add episodes, methods or variants.

    Parameters
    ----------
    asked
        What the user said, by names of `Experiment`; what was not said stays as it is.

    Raises
    ------
    ConfigError
        It is of another experiment: which setting differs, and how.
    """
    there = read_folder(path)
    differences = list(_differences(there.experiment, asked))
    if differences:
        raise ConfigError(
            f"these are results of another experiment: {'; '.join(differences)}", file=path
        )
    now, grown = origin(), _grown(there.experiment, asked)
    origins = there.origins if now in there.origins else (*there.origins, now)
    folder = Folder(experiment=grown, origins=origins)
    return folder if folder == there else _write(path, folder)


def origin() -> Origin:
    """Tell by what results would be made now."""
    return Origin(commit=_commit(), software=software(), machine=_cpu_model())


def _differences(there: Experiment, asked: Mapping[str, Any]) -> Iterator[str]:
    """Tell what was asked for that the results are not of; they may grow."""
    for key in ("sets", "seed", "sensor"):
        before = getattr(there, key)
        if key in asked and asked[key] != before:
            yield f"{key} {_plain(before)}, not {_plain(asked[key])}"
    if asked.get("episodes", there.episodes) < there.episodes:
        yield f"episodes {there.episodes}, not {asked['episodes']}"
    known = {method.name: method for method in there.methods}
    for method in asked.get("methods", ()):
        if known.get(method.name, method) != method:
            yield f"{method.name} is another policy: {_plain(known[method.name])}"


def _grown(there: Experiment, asked: Mapping[str, Any]) -> Experiment:
    new = [method for method in asked.get("methods", ()) if method not in there.methods]
    return msgspec.structs.replace(
        there,
        methods=(*there.methods, *new),
        variants=tuple(dict.fromkeys((*there.variants, *asked.get("variants", ())))),
        episodes=asked.get("episodes", there.episodes),
    )


def _plain(value: object) -> str:
    return msgspec.json.encode(value).decode()


def _write(path: Path, folder: Folder) -> Folder:
    """Write experiment.json whole or not at all."""
    data = msgspec.json.format(msgspec.json.encode(folder), indent=2) + b"\n"
    scratch = path / f"{FILE}.part"
    try:
        with scratch.open("wb") as file:
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
        scratch.replace(path / FILE)
    except OSError as error:
        raise ConfigError(error.strerror or str(error), file=path / FILE) from error
    return folder


def _commit() -> str:
    git = shutil.which("git")
    if git is None:
        return "unknown"
    words = [git, "-C", str(CONFIG_DIR), "describe", "--always", "--dirty", "--abbrev=12"]
    answer = subprocess.run(words, capture_output=True, text=True, check=False)
    return answer.stdout.strip() or "unknown"


def _cpu_model() -> str:
    for line in Path("/proc/cpuinfo").read_text().splitlines():
        if line.startswith("model name"):
            return f"{line.partition(':')[2].strip()}, {len(os.sched_getaffinity(0))} cores"
    return "unknown"
