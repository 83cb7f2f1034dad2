"""What a run reports: JSON lines to keep, TensorBoard or W&B to look at, progress to wait with."""

from __future__ import annotations

import time
from collections.abc import Mapping
from pathlib import Path
from types import TracebackType
from typing import Any, Self, SupportsFloat

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeRemainingColumn
from rich.progress import Progress as RichProgress
from torch.utils.tensorboard import SummaryWriter
from torch.utils.tensorboard.summary import hparams

from twinscrew.runtime.errors import ConfigError
from twinscrew.training import runs
from twinscrew.training.evaluate import Score

EVERY_S = 10.0
"""[s] Between two lines of progress where there is no terminal."""


class Logs:
    """The log of one run directory.

    Parameters
    ----------
    folder
        The run directory.
    settings
        The run's, as plain values: the hyper-parameters.
    step
        The environment step that the run goes on from.
    wandb
        A project of Weights & Biases to report to as well.
    """

    def __init__(
        self, folder: Path, settings: Mapping[str, Any], step: int = 0, wandb: str | None = None
    ) -> None:
        self._file = folder / runs.LOG
        self._board = SummaryWriter(str(folder / "tensorboard"), purge_step=step + 1)
        flat = _flat(settings)
        summaries = hparams(flat, {"evaluation/success": 0.0})  # type: ignore[no-untyped-call]
        writer: Any = self._board.file_writer
        for summary in summaries:
            writer.add_summary(summary)
        self._wandb = None if wandb is None else _wandb_run(wandb, folder, flat)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._board.close()
        if self._wandb is not None:
            self._wandb.finish()

    def write(self, event: str, **values: Any) -> None:
        """Add a record; its numbers also go to TensorBoard, over environment steps."""
        runs.append_record(self._file, {"event": event, **values})
        step = values.pop("step", None)
        if step is None:
            return
        numbers = {f"{event}/{k}": v for k, v in values.items() if isinstance(v, int | float)}
        for name, value in numbers.items():
            self._board.add_scalar(name, value, step)
        if self._wandb is not None:
            self._wandb.log(numbers, step=step)


def _flat(values: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    """Give nested settings as one level of numbers and words."""
    flat: dict[str, Any] = {}
    for key, value in values.items():
        if isinstance(value, Mapping):
            flat |= _flat(value, f"{prefix}{key}.")
        else:
            plain = isinstance(value, bool | int | float | str)
            flat[prefix + key] = value if plain else str(value)
    return flat


def _wandb_run(project: str, folder: Path, settings: dict[str, Any]) -> Any:
    try:
        import wandb
    except ModuleNotFoundError as error:
        raise ConfigError("not installed: pip install wandb", key="--wandb") from error
    name = "/".join(folder.resolve().parts[-2:])
    return wandb.init(project=project, name=name, dir=str(folder), config=settings)


class Progress:
    """A bar over the whole run with the time left; lines where there is no terminal."""

    def __init__(self, title: str, steps: int) -> None:
        self._console = Console(stderr=True, soft_wrap=True)
        self._bar = RichProgress(
            TextColumn("{task.description}"),
            BarColumn(),
            MofNCompleteColumn(),
            TimeRemainingColumn(),
            TextColumn("{task.fields[score]}"),
            console=self._console,
            disable=not self._console.is_terminal,
        )
        self._title, self._steps = title, steps
        self._task = self._bar.add_task(title, total=steps, score="")
        self._first: tuple[float, int] | None = None
        self._next = 0.0

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

    def say(self, text: str) -> None:
        """Print a line of its own, on standard error."""
        self._console.print(text, highlight=False, markup=False)

    def advance(self, step: int, transitions: int, loss: SupportsFloat | None = None) -> None:
        """Take note of how far the run is; now and then a line, where there is no terminal."""
        self._bar.update(self._task, completed=step)
        now = time.monotonic()
        if self._first is None:
            self._first, self._next = (now, step), now + EVERY_S / 2
            return
        if self._console.is_terminal or now < self._next:
            return
        self._next = now + EVERY_S
        rate = (step - self._first[1]) / (now - self._first[0])
        left = (self._steps - step) / rate / 60.0 if rate > 0.0 else float("inf")
        learning = "gathering" if loss is None else f"loss {float(loss):.3g}"
        self.say(
            f"{self._title}: step {step} of {self._steps}, {transitions} transitions, "
            f"{rate:.1f} steps/s, {learning}, {left:.0f} min left"
        )

    def report(self, seed: int, step: int, score: Score) -> None:
        """Show how good the policy is; as a line of its own where there is no terminal."""
        words = f"{score.success:.1%} in {score.travel_time_s:.1f} s"
        self._bar.update(self._task, score=words)
        if not self._console.is_terminal:
            self.say(f"{self._title} seed {seed}: step {step}: {words}")
