"""`twinscrew experiment`: the paper's experiments, and any one of their episodes again."""

from __future__ import annotations

import json
import os
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated, Any

import typer
from msgspec.structs import replace
from rich.console import Console
from rich.markup import escape
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from twinscrew.hil_sim.commands.experiment_answer import tell
from twinscrew.hil_sim.experiments.plan import (
    ABLATIONS,
    Experiment,
    SetSettings,
    Switches,
    load_sets,
    parse_ablations,
    parse_methods,
    variants,
)
from twinscrew.hil_sim.experiments.results import EXPERIMENT_FILE, begin, go_on
from twinscrew.hil_sim.experiments.runner import check_engine, find, parse_line, rerun, run
from twinscrew.hil_sim.experiments.suites import SUITES, find_suite
from twinscrew.runtime.errors import ConfigError
from twinscrew.runtime.perception.sensor import load_sensor
from twinscrew.runtime.progress import ProgressLines
from twinscrew.runtime.vessel_description import load_vessel

NOT_THE_SAME = 1
SMOOTHING_S = 300.0
"""[s] The ETA follows the speed of the last five minutes."""


def experiment(
    methods: Annotated[
        str | None,
        typer.Option(
            help="With commas: apf, mpc, orca, sbmpc, random, a shipped policy, or NAME=FILE.onnx."
        ),
    ] = None,
    suite: Annotated[
        str | None,
        typer.Option(help=f"Its sets, methods, episodes and figures: {', '.join(SUITES)}."),
    ] = None,
    sets: Annotated[
        str | None,
        typer.Option(help="paper (six sets), or a TOML file.", show_default="paper"),
    ] = None,
    episodes: Annotated[
        int | None, typer.Option(help="A set and a method.", min=1, show_default="100")
    ] = None,
    seed: Annotated[
        int | None,
        typer.Option(help="What all episodes are drawn from.", min=0, show_default="0"),
    ] = None,
    jobs: Annotated[
        int | None, typer.Option(help="Processes.", show_default="one a core", min=1)
    ] = None,
    engine: Annotated[
        str, typer.Option(help="local, or ray (the cluster that RAY_ADDRESS names).")
    ] = "local",
    ablate: Annotated[
        str | None,
        typer.Option(help=f"Sail simpler variants too: {', '.join(ABLATIONS)}; gap: most."),
    ] = None,
    base: Annotated[
        str | None,
        typer.Option(
            help="Switches that hold throughout, as no_assurance for the bare methods.",
            show_default="none",
        ),
    ] = None,
    sensor: Annotated[
        str | None,
        typer.Option(help="A name in config/sensors, or a file.", show_default="vrx32"),
    ] = None,
    vessel: Annotated[
        list[str] | None,
        typer.Option(help="What sails: a name in config/vessels, or a file. Several: in turn."),
    ] = None,
    out: Annotated[Path | None, typer.Option(help="Folder of the results.")] = None,
    resume: Annotated[
        Path | None,
        typer.Option(help="Go on with the experiment in this folder; it may grow."),
    ] = None,
    again: Annotated[
        str | None,
        typer.Option("--rerun", help="DIR:LINE: sail that one episode again, recorded."),
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
) -> None:
    """Sail the same episodes with several methods, in lock-step, and keep every result."""
    if again is not None:
        _rerun(again, out, as_json=as_json)
        return
    if suite is not None:
        chosen_suite = find_suite(suite)
        if sets is not None:
            raise ConfigError("a suite has its own sets", key="--sets")
        if resume is None:
            methods = methods or chosen_suite.methods
            episodes = episodes or chosen_suite.episodes
            base = ",".join(chosen_suite.base) if base is None else base
            now = datetime.now(UTC).strftime("%Y%m%d-%H%M%S-%f")
            out = out or Path("runs") / f"suite-{suite}-{now}"
    asked: dict[str, Any] = {
        "suite": suite,
        "methods": None if methods is None else parse_methods(methods),
        "sets": _sets(sets, suite, vessel, resume),
        "episodes": episodes,
        "seed": seed,
        "sensor": sensor,
        "variants": _variants(ablate, base),
    }
    asked = {key: value for key, value in asked.items() if value is not None}
    engine_ = check_engine(engine)
    folder, chosen = _folder(asked, out, resume)
    workers = jobs or len(os.sched_getaffinity(0))
    begin_s = time.monotonic()
    console = Console(stderr=True)
    with _progress(console, quiet=as_json) as progress:
        finished = run(chosen, folder, workers, engine_, progress)
    tell(finished, folder, time.monotonic() - begin_s, chosen.suite, as_json=as_json)


def _sets(
    sets: str | None, suite: str | None, vessel: list[str] | None, resume: Path | None
) -> tuple[SetSettings, ...] | None:
    """Give the sets asked for, with the vessels asked for; None if nothing was said of them."""
    if vessel is None and suite is None:
        return None if sets is None else load_sets(sets).set
    if vessel is not None and resume is not None and sets is None and suite is None:
        raise ConfigError("name the sets too: --sets", key="--vessel")
    chosen = load_sets(sets or "paper").set if suite is None else find_suite(suite).sets
    if vessel is None:
        return chosen
    types = tuple(load_vessel(kind).key for kind in vessel)
    return tuple(replace(one, types=types) for one in chosen)


def _variants(ablate: str | None, base: str | None) -> tuple[Switches, ...] | None:
    """Give the variants asked for; None if nothing was said of them."""
    if ablate is None and base is None:
        return None
    return variants(parse_ablations(ablate or ""), parse_ablations(base or "", "--base"))


def _folder(
    asked: Mapping[str, Any], out: Path | None, resume: Path | None
) -> tuple[Path, Experiment]:
    """Give the results' folder, new or gone on with, and what is to be sailed."""
    if resume is not None:
        if out is not None and out.resolve() != resume.resolve():
            raise ConfigError(f"--resume goes on in {resume}, not in {out}", key="--out")
        return resume, go_on(resume, asked).experiment
    if "methods" not in asked:
        raise ConfigError("name at least one, as ac_iqn,apf", key="--methods")
    if out is None:
        raise ConfigError("name a folder for the results", key="--out")
    if (out / EXPERIMENT_FILE).is_file():
        raise ConfigError(f"holds results already; --resume {out} goes on with them", file=out)
    chosen = Experiment(**{"sets": load_sets("paper").set, **asked})
    load_sensor(chosen.sensor)
    return out, begin(out, chosen).experiment


@contextmanager
def _progress(console: Console, *, quiet: bool) -> Iterator[Callable[[int, int], None]]:
    """Give what is told how many episodes are done, of how many: a bar, or lines for a log."""
    if not console.is_terminal:
        yield (lambda _done, _total: None) if quiet else ProgressLines("episodes").update
        return
    bar = Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn("left"),
        TimeRemainingColumn(),
        console=console,
        disable=quiet,
        transient=True,
        speed_estimate_period=SMOOTHING_S,
    )
    with bar:
        task = bar.add_task("episodes", total=None)
        yield lambda done, total: bar.update(task, completed=done, total=total)


def _rerun(text: str, out: Path | None, *, as_json: bool) -> None:
    folder, line = parse_line(text)
    chosen, record = find(folder, line)
    if out is None:
        raise ConfigError("name a folder for the recordings", key="--out")
    if out.exists() and (not out.is_dir() or any(out.iterdir())):
        raise ConfigError("not an empty folder", file=out)
    out.mkdir(parents=True, exist_ok=True)
    result = rerun(chosen, record, out)
    now = result.sailed.record
    if as_json:
        print(
            json.dumps(
                {
                    "same": result.same,
                    "method": now.method,
                    "set": now.set,
                    "variant": now.variant,
                    "episode": now.episode,
                    "seed": now.seed,
                    "success": now.success,
                    "decisions_sha256": now.decisions_sha256,
                    "recorded_sha256": record.decisions_sha256,
                    "out": str(out),
                }
            )
        )
    else:
        verdict = "[green]the same, bit for bit[/green]" if result.same else "[red]differs[/red]"
        what = escape(f"{now.method}, {now.set}, episode {now.episode}, seed {now.seed}")
        Console().print(f"{what}: {verdict}")
        Console().print(f"[bold]{escape(str(out))}[/bold]: <vessel>/recording, trajectories.png")
    if not result.same:
        raise typer.Exit(NOT_THE_SAME)
