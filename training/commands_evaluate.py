"""`twinscrew evaluate`: a policy's score in the training environment."""

from __future__ import annotations

import json
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:  # the command line starts without numpy and ONNX Runtime
    from twinscrew.training.batch_policy import BatchPolicy
    from twinscrew.training.evaluate import Evaluation
    from twinscrew.training.scenarios import ScenarioSettings


def evaluate(
    policy: Annotated[str, typer.Argument(help="An ONNX file, a shipped policy, apf or mpc.")],
    robots: Annotated[int, typer.Option(help="Vessels.")] = 3,
    buoys: Annotated[int, typer.Option(help="Static obstacles.")] = 0,
    min_distance: Annotated[
        float | None,
        typer.Option(help="Least distance from start to goal [m].", show_default="the paper's"),
    ] = None,
    episodes: Annotated[int, typer.Option(help="How many.")] = 500,
    seed: Annotated[int, typer.Option(help="Of the episodes.")] = 0,
    risk: Annotated[
        str | None,
        typer.Option(
            help="Risk level: the share of the worst outcomes to weigh, (0, 1], or adaptive.",
            show_default="the policy file's own",
        ),
    ] = None,
    risks: Annotated[
        str | None, typer.Option(help="One score at each level, as 0.125,0.5,1,adaptive.")
    ] = None,
    every: Annotated[bool, typer.Option("--all", help="The paper's six settings.")] = False,
    on: Annotated[
        Path | None,
        typer.Option(help="Folder of an experiment: its episodes, set by set.", metavar="DIR"),
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
) -> None:
    """Score a policy in the training environment."""
    from twinscrew.runtime.errors import ConfigError
    from twinscrew.runtime.policy.risk import parse_risk
    from twinscrew.runtime.settings import convert
    from twinscrew.training.batch_policy import open_policy
    from twinscrew.training.scenarios import ScenarioSettings
    from twinscrew.training.settings_table import published_distance_m, six_settings

    if on is not None:
        if risks is not None or every:
            raise ConfigError("an experiment's episodes are scored at one level", key="--on")
        _evaluate_on(on, open_policy(policy, parse_risk(risk)), seed, as_json=as_json)
        return
    distance = published_distance_m(robots) if min_distance is None else min_distance
    one = {"robots": robots, "buoys": buoys, "min_distance_m": distance}
    rows = six_settings() if every else (convert(one, ScenarioSettings),)
    if risk is not None and risks is not None:
        raise ConfigError("give either one level or several", key="--risk, --risks")
    curve = {}
    for level in [risk] if risks is None else risks.split(","):
        asked = open_policy(policy, parse_risk(level))
        results = _evaluate(asked, rows, episodes, seed)
        if not as_json:
            _print_table(rows, results, "" if level is None else f"risk {level}")
        records = [result.record() for result in results]
        curve[level] = {"settings": records} if every else records[0]
    if as_json:
        print(json.dumps(curve[risk] if risks is None else {"risks": curve}))


def _evaluate_on(folder: Path, policy: BatchPolicy, seed: int, *, as_json: bool) -> None:
    """Score a policy on an experiment's episodes."""
    from twinscrew.training.given import evaluate_given, read_given
    from twinscrew.training.scenarios import ScenarioSettings

    sets = read_given(folder)
    results = [evaluate_given(policy, given, seed) for given in sets.values()]
    if as_json:
        rows = zip(sets, results, strict=True)
        print(json.dumps({"settings": [{"name": name} | one.record() for name, one in rows]}))
        return
    shapes = [
        ScenarioSettings(robots=one.start.shape[1], buoys=one.buoy.shape[1], min_distance_m=0.0)
        for one in sets.values()
    ]
    _print_table(shapes, results, f"on {folder}")


def _evaluate(
    policy: BatchPolicy, rows: Sequence[ScenarioSettings], episodes: int, seed: int
) -> tuple[Evaluation, ...]:
    """Evaluate row by row, with a progress bar on standard error, or lines for a log."""
    from rich.console import Console
    from rich.progress import Progress

    from twinscrew.runtime.progress import ProgressLines
    from twinscrew.training.evaluate import evaluate_all

    console, total = Console(file=sys.stderr), episodes * len(rows)
    if not console.is_terminal:
        lines, done = ProgressLines(policy.name), 0

        def told(count: int) -> None:
            nonlocal done
            done += count
            lines.update(done, total)

        return evaluate_all(policy, rows, episodes, seed, progress=told)
    with Progress(console=console, transient=True) as bar:
        task = bar.add_task(policy.name, total=total)
        return evaluate_all(
            policy, rows, episodes, seed, progress=lambda count: bar.advance(task, count)
        )


def _print_table(
    rows: Sequence[ScenarioSettings], results: Sequence[Evaluation], title: str
) -> None:
    """Print the scores, one line a setting."""
    from rich.console import Console
    from rich.table import Table

    table = Table(
        "robots",
        "buoys",
        "distance",
        "success",
        "95 %",
        "time",
        "hits",
        "late",
        title=title or None,
    )
    for row, result in zip(rows, results, strict=True):
        low, high = result.wilson95
        time = result.travel_time_s
        table.add_row(
            str(row.robots),
            str(row.buoys),
            f"{row.min_distance_m:g} m",
            f"{result.success_rate:.1%}",
            f"{low:.1%} .. {high:.1%}",
            "-" if time is None else f"{time:.2f} s",
            str(result.collisions),
            str(result.timeouts),
        )
    Console().print(table)
