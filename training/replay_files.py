"""The replay beside a checkpoint: files of the transitions that came since the one before.

A file, once written, never changes: so a run that is killed, or a disk that is full, leaves the
last checkpoint with all its files. A checkpoint lists the files that it needs; others are removed
when it has taken its place.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import torch

from twinscrew.runtime.errors import ConfigError
from twinscrew.training.buffer import ReplayBuffer
from twinscrew.training.runs import replace_file

PATTERN = "replay_*.npy"


class ReplayFiles:
    """The files of one run directory.

    Parameters
    ----------
    folder
        The run directory.
    replay
        What is kept.
    """

    def __init__(self, folder: Path, replay: ReplayBuffer) -> None:
        self._folder, self._replay = folder, replay
        self._cleared = 0
        self._parts: list[
            tuple[int, int]
        ] = []  # numbers of the first transition, and past the last

    def save(self) -> dict[str, Any]:
        """Write what is new, and give what a checkpoint has to hold.

        Raises
        ------
        TwinscrewError
            It cannot be written; what was there before is untouched.
        """
        replay = self._replay
        if replay.cleared != self._cleared:
            self._cleared, self._parts = replay.cleared, []
        capacity, written = len(replay.rows), self._parts[-1][1] if self._parts else 0
        first = max(written, replay.added - capacity)
        parts = [part for part in self._parts if part[1] > replay.added - capacity]
        if replay.added > first:
            rows = replay.rows[torch.arange(first, replay.added) % capacity].numpy()
            replace_file(self._file(first), lambda out: np.save(out, rows))
            parts.append((first, replay.added))
        self._parts = parts
        return {"state": replay.state(), "parts": [list(part) for part in parts]}

    def drop(self) -> None:
        """Need no file any more: `tidy` removes them all."""
        self._parts = []

    def restore(self, kept: dict[str, Any]) -> None:
        """Fill the replay with what a checkpoint kept.

        Raises
        ------
        ConfigError
            A file is missing or is not what was written.
        """
        replay = self._replay
        self._cleared = int(kept["state"]["cleared"])
        self._parts = [(int(first), int(end)) for first, end in kept["parts"]]
        for first, end in self._parts:
            file = self._file(first)
            try:
                rows = torch.from_numpy(np.load(file, allow_pickle=False))
                replay.rows[torch.arange(first, end) % len(replay.rows)] = rows
            except (OSError, ValueError, RuntimeError, IndexError) as error:
                raise ConfigError(f"replay cannot be read: {error}", file=file) from error
        replay.restore(kept["state"])

    def tidy(self) -> None:
        """Remove the files that the checkpoint, now in its place, does not need."""
        needed = {self._file(first) for first, _ in self._parts}
        for file in set(self._folder.glob(PATTERN)) - needed:
            file.unlink()

    def _file(self, first: int) -> Path:
        return self._folder / f"replay_{self._cleared}_{first}.npy"
