"""Run directories: one run at a time in each, logs that grow, checkpoints that are never half.

A checkpoint is written beside the old one and then takes its place, so that a full disk or a
killed process leaves the last one readable. It holds tensors, numbers, strings and containers of
them only, and is read as such (nothing in it can run).
"""

from __future__ import annotations

import fcntl
import json
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, BinaryIO

import torch

from twinscrew.runtime import files
from twinscrew.runtime.errors import NOT_THE_FORMAT, ConfigError, TwinscrewError

CHECKPOINT = "checkpoint.pt"
BEST = "best.pt"
LATEST = "latest.pt"
"""The newest networks, where they are newer than the checkpoint: to be exported."""
CONFIG = "config.json"
LOG = "log.jsonl"
FORMAT = 1
"""[-] Version of what a checkpoint holds."""


@contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Hold a run directory, made if need be; the lock goes with the process, however it ends.

    Raises
    ------
    ConfigError
        Another process trains there, or nothing can be written there.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        lock = (folder / "lock").open("w")
    except OSError as error:
        raise ConfigError(f"cannot be written: {error.strerror}", file=folder) from error
    with lock:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            raise ConfigError("run directory in use by another process", file=folder) from error
        yield


def claim(
    folder: Path,
    told: Mapping[str, Any],
    algorithm: str,
    complete: Callable[[dict[str, Any]], dict[str, Any]],
) -> None:
    """Write what a run is told into its directory, or see that it is what it was told before.

    Phases that the run has not come to may be changed, or added: so a finished run can be
    fine-tuned.

    Parameters
    ----------
    folder
        The run directory.
    told
        Plain values: `seed`, and `settings` with a list of `phases`.
    algorithm
        Of the learner.
    complete
        Fills in what settings of an older version do not have yet.

    Raises
    ------
    ConfigError
        The directory holds a run of another configuration or seed.
    """
    file, checkpoint = folder / CONFIG, folder / CHECKPOINT
    text = json.dumps(told, indent=1)
    if file.exists():
        begun = 0
        if checkpoint.exists():
            content = load_checkpoint(checkpoint, algorithm)
            with understood(checkpoint):
                begun = int(content["phase"]) + 1
        before, now = read_told(folder), json.loads(text)
        with understood(file):
            before["settings"] = complete(before["settings"])
            same = _up_to(before, begun) == _up_to(now, begun)
        if not same:
            raise ConfigError("holds a run of another configuration or seed", file=folder)
    replace_file(file, lambda out: out.write(text.encode()))


def read_told(folder: Path) -> dict[str, Any]:
    """Give what a run was told: `seed`, and `settings` as plain values.

    Raises
    ------
    ConfigError
        There is no such file, or it holds something else.
    """
    file = folder / CONFIG
    try:
        data = file.read_bytes()
    except OSError as error:
        raise ConfigError(error.strerror or str(error), file=file) from error
    with understood(file):
        told = json.loads(data)
        return {**told, "settings": {**told["settings"]}}


@contextmanager
def understood(file: Path) -> Iterator[None]:
    """Turn what a file's content raises where it is used, if it is another's, into a `ConfigError`.

    Files of a run are written by `train` alone: what is odd in them is damage, or another version.
    """
    try:
        yield
    except (LookupError, TypeError, ValueError, AttributeError, RuntimeError) as error:
        what = f"{type(error).__name__}: {error}".splitlines()[0]
        raise ConfigError(f"damaged, or of another version ({what})", file=file) from error


def _up_to(told: dict[str, Any], phases: int) -> dict[str, Any]:
    settings = told["settings"]
    return {**told, "settings": {**settings, "phases": settings["phases"][:phases]}}


def save_checkpoint(file: Path, algorithm: str, content: Mapping[str, Any]) -> None:
    """Write a checkpoint atomically.

    Raises
    ------
    TwinscrewError
        It cannot be written; what was there before is untouched.
    """
    whole = {"format": FORMAT, "algorithm": algorithm, **content}
    replace_file(file, lambda out: torch.save(whole, out))


def replace_file(file: Path, write: Callable[[BinaryIO], object]) -> None:
    """Write beside a file, then take its place.

    Raises
    ------
    TwinscrewError
        It cannot be written; what was there before is untouched.
    """
    try:
        files.replace_file(file, write)
    except (OSError, RuntimeError) as error:
        raise TwinscrewError(
            f"{file}: cannot be written ({error}); the last one is kept"
        ) from error


def load_checkpoint(file: Path, algorithm: str) -> dict[str, Any]:
    """Read a checkpoint of a learner.

    Raises
    ------
    ConfigError
        There is none, it is no checkpoint, or it is of another algorithm or version.
    """
    try:
        content = torch.load(file, map_location="cpu", weights_only=True)
    except OSError as error:
        raise ConfigError(error.strerror or str(error), file=file) from error
    except Exception as error:  # damage: whatever the parts of zip, pickle and torch notice
        raise ConfigError("not a readable checkpoint", file=file) from error
    if not isinstance(content, dict) or content.get("format") != FORMAT:
        found = content.get("format") if isinstance(content, dict) else type(content).__name__
        raise ConfigError(f"checkpoint of version {found!r}, this reads {FORMAT}", file=file)
    if content.get("algorithm") != algorithm:
        raise ConfigError(
            f"checkpoint of {content.get('algorithm')!r}, the configuration is of {algorithm!r}",
            file=file,
        )
    return content


def append_record(file: Path, record: Mapping[str, Any]) -> None:
    """Add one line of JSON to a log, with the time.

    Raises
    ------
    TwinscrewError
        It cannot be written.
    """
    line = json.dumps({"time": round(time.time(), 3), **record}, allow_nan=True)
    try:
        with file.open("a", encoding="utf-8") as log:
            log.write(line + "\n")
    except OSError as error:
        raise TwinscrewError(f"{file}: cannot be written: {error.strerror}") from error


def trim_log(file: Path, step: int) -> None:
    """Drop the records of a log that lie beyond a step: a run goes on from there."""
    kept = [record for record in read_records(file) if record.get("step", 0) <= step]
    text = "".join(json.dumps(record, allow_nan=True) + "\n" for record in kept)
    replace_file(file, lambda out: out.write(text.encode()))


def read_records(file: Path) -> list[dict[str, Any]]:
    """Read a log; a last line that a killed process left half is dropped.

    Raises
    ------
    ConfigError
        There is no log, or it has a line that is no record.
    """
    try:
        lines = file.read_bytes().splitlines()
    except OSError as error:
        raise ConfigError(error.strerror or str(error), file=file) from error
    records = []
    for number, line in enumerate(lines):
        try:
            record = json.loads(line)
        except NOT_THE_FORMAT as error:
            if number + 1 < len(lines):
                raise ConfigError(f"line {number + 1} is not JSON", file=file) from error
            break
        if not isinstance(record, dict):
            raise ConfigError(f"line {number + 1} is no record", file=file)
        records.append(record)
    return records
