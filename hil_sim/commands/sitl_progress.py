"""What `twinscrew sitl` shows under way: a bar, or lines where there is no terminal."""

from __future__ import annotations

from pathlib import Path

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn

from twinscrew.hil_sim.scenario import Scenario
from twinscrew.hil_sim.sitl import SitlReport, SitlSettings, sail
from twinscrew.hil_sim.supervisor import Result


def sail_shown(
    scenario: Scenario, settings: SitlSettings, folder: Path, console: Console, *, quiet: bool
) -> SitlReport:
    """Sail, and show on a console how far the vessels are; quiet: only what the user has to do."""

    def tell(words: str) -> None:
        console.print(words, markup=False, highlight=False, soft_wrap=True)

    if quiet:
        return sail(scenario, settings, folder, tell=tell)
    if not console.is_terminal:
        return sail(scenario, settings, folder, _Lines(console), tell)
    columns = (TextColumn("{task.description}"), BarColumn(), TextColumn("{task.fields[state]}"))
    with Progress(*columns, console=console, transient=True) as bar:
        task = bar.add_task("at the dock", total=scenario.time_limit_s, state="")

        def progress(time_s: float, results: tuple[Result, ...]) -> None:
            bar.update(
                task, completed=time_s, description=f"{time_s:5.1f} s", state=_states(results)
            )

        return sail(scenario, settings, folder, progress, tell)


class _Lines:
    """Progress for a log: a line every few simulated seconds, and when a voyage ends."""

    EVERY_S = 5.0

    def __init__(self, console: Console) -> None:
        self._console = console
        self._next_s = 0.0
        self._told = ""

    def __call__(self, time_s: float, results: tuple[Result, ...]) -> None:
        """Tell, if it is time to or something happened."""
        states = _states(results)
        if time_s < self._next_s and states == self._told:
            return
        self._next_s = time_s + self.EVERY_S
        self._told = states
        self._console.print(f"{time_s:5.1f} s  {states}")


def _states(results: tuple[Result, ...]) -> str:
    return ", ".join(f"{result.name} {_state(result)}" for result in results)


def _state(result: Result) -> str:
    return "under way" if result.outcome is None else result.outcome.value
