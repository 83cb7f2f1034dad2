"""results.jsonl: one line an episode, appended so that neither a crash nor a full disk loses one.

A line counts once its newline is on the disk. Only the parent writes; it holds a lock, so that two
experiments cannot write into one file.
"""

from __future__ import annotations

import fcntl
import hashlib
import os
from collections.abc import Iterable
from pathlib import Path
from types import TracebackType
from typing import Self

import msgspec

from twinscrew.hil_sim.experiments.plan import Key
from twinscrew.hil_sim.experiments.record import EpisodeRecord
from twinscrew.runtime.errors import NOT_THE_FORMAT, RecordingError

FILE = "results.jsonl"
_ENCODER = msgspec.json.Encoder()
_DECODER = msgspec.json.Decoder(EpisodeRecord)


def read_results(path: Path) -> list[EpisodeRecord]:
    """Give the episodes in a file; a half-written last line is not one.

    Raises
    ------
    RecordingError
        The file cannot be read, a whole line is no episode, or an episode is there twice.
    """
    return _parse(path, _read(path))[0]


def results_sha256(records: Iterable[EpisodeRecord]) -> str:
    """Give one hash of all that the episodes gave, in any order, without what clocks measured."""
    plain = sorted((record.key, _ENCODER.encode(_timeless(record))) for record in records)
    digest = hashlib.sha256()
    for _, line in plain:
        digest.update(line + b"\n")
    return digest.hexdigest()


class ResultsFile:
    """A context that holds the file open, locked, and ready to be appended to."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.records: list[EpisodeRecord] = []
        self._descriptor = -1
        self._size = 0

    def __enter__(self) -> Self:
        """Open, lock, read, and cut off a half-written last line.

        Raises
        ------
        RecordingError
            The file cannot be used, or another experiment writes into it.
        """
        try:
            self._descriptor = os.open(self.path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o644)
            fcntl.flock(self._descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
            self.records, self._size = _parse(self.path, _read(self.path))
            os.ftruncate(self._descriptor, self._size)
            os.lseek(self._descriptor, 0, os.SEEK_END)
        except BlockingIOError as error:
            self._close()
            raise RecordingError(f"{self.path}: another experiment writes into it") from error
        except OSError as error:
            self._close()
            raise RecordingError(f"{self.path}: {error.strerror or error}") from error
        except RecordingError:
            self._close()
            raise
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self._close()

    def append(self, record: EpisodeRecord) -> None:
        """Add an episode; it is on the disk when this returns.

        Raises
        ------
        RecordingError
            The disk is full, or failed: the file is as it was before.
        """
        line = _ENCODER.encode(record) + b"\n"
        try:
            _write_all(self._descriptor, line)
            os.fsync(self._descriptor)
        except OSError as error:
            self._take_back()
            raise RecordingError(
                f"{self.path}: {error.strerror or error}; {len(self.records)} episodes are kept: "
                "make room, then go on with --resume"
            ) from error
        self._size += len(line)
        self.records.append(record)

    def _take_back(self) -> None:
        """Remove what was written of a line; what cannot be removed is ignored when read."""
        try:
            os.ftruncate(self._descriptor, self._size)
            os.lseek(self._descriptor, 0, os.SEEK_END)
        except OSError:
            return

    def _close(self) -> None:
        if self._descriptor >= 0:
            os.close(self._descriptor)
            self._descriptor = -1


def _write_all(descriptor: int, data: bytes) -> None:
    while data:
        data = data[os.write(descriptor, data) :]


def _read(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except OSError as error:
        raise RecordingError(f"{path}: {error.strerror or error}") from error


def _parse(path: Path, data: bytes) -> tuple[list[EpisodeRecord], int]:
    """Give the episodes, and how many bytes hold whole lines."""
    whole = data.rfind(b"\n") + 1
    records: list[EpisodeRecord] = []
    lines: dict[Key, int] = {}
    for number, line in enumerate(data[:whole].splitlines(), start=1):
        try:
            record = _DECODER.decode(line)
        except NOT_THE_FORMAT as error:
            raise RecordingError(f"{path}:{number}: not an episode: {error}") from error
        if record.key in lines:
            raise RecordingError(f"{path}:{number}: line {lines[record.key]} again: {record.key}")
        lines[record.key] = number
        records.append(record)
    return records, whole


def _timeless(record: EpisodeRecord) -> dict[str, object]:
    plain: dict[str, object] = msgspec.to_builtins(record)
    del plain["timing"]
    return plain
