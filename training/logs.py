"""What a run tells: JSON lines to keep, TensorBoard to look at, a progress bar to wait with."""

from __future__ import annotations

from pathlib import Path
from types import TracebackType
from typing import Any, Self

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeRemainingColumn
from rich.progress import Progress as RichProgress
from torch.utils.tensorboard import SummaryWriter

from twinscrew.training import runs
from twinscrew.training.validate import Score


class Logs:
    """The log of one run directory."""

    def __init__(self, folder: Path, step: int = 0) -> None:
        """Log a run that goes on from an environment step."""
        self._file = folder / runs.LOG
        self._board = SummaryWriter(str(folder / "tensorboard"), purge_step=step + 1)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._board.close()

    def write(self, event: str, **values: Any) -> None:
        """Add a record; its numbers also go to TensorBoard, over environment steps."""
        runs.append_record(self._file, {"event": event, **values})
        step = values.get("step")
        if step is None:
            return
        for name, value in values.items():
            if isinstance(value, int | float) and name != "step":
                self._board.add_scalar(f"{event}/{name}", value, step)


class Progress:
    """A bar over the whole run with the time left; silent where there is no terminal."""

    def __init__(self, title: str, steps: int) -> None:
        self._console = Console(stderr=True)
        self._bar = RichProgress(
            TextColumn("{task.description}"),
            BarColumn(),
            MofNCompleteColumn(),
            TimeRemainingColumn(),
            TextColumn("{task.fields[score]}"),
            console=self._console,
            disable=not self._console.is_terminal,
        )
        self._title = title
        self._task = self._bar.add_task(title, total=steps, score="")

    def __enter__(self) -> Self:
        self._bar.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._bar.stop()

    def advance(self, step: int) -> None:
        """Say how far the run is."""
        self._bar.update(self._task, completed=step)

    def report(self, seed: int, step: int, score: Score) -> None:
        """Say how good the policy is; as a line of its own where there is no terminal."""
        words = f"{score.success:.1%} in {score.travel_time_s:.1f} s"
        self._bar.update(self._task, score=words)
        if not self._console.is_terminal:
            self._console.print(f"{self._title} seed {seed}: step {step}: {words}", highlight=False)
