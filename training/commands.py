"""The training commands of `twinscrew`; each imports what it needs when it runs."""

from __future__ import annotations

import dataclasses
import json
import signal
import sys
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, get_args

import typer

if TYPE_CHECKING:  # the command line starts without numpy, torch and ONNX Runtime
    from types import FrameType

    from twinscrew.runtime.policy.hull_units import HullUnits
    from twinscrew.training.environment import EnvironmentSettings
    from twinscrew.training.evaluate import BatchPolicy, Evaluation
    from twinscrew.training.scenarios import ScenarioSettings
    from twinscrew.training.settings import TrainSettings
    from twinscrew.training.traffic import Traffic


def train(
    config: Annotated[str, typer.Argument(help="A TOML file, or a name in config/training.")],
    seeds: Annotated[str, typer.Option(help="As 0,1,2: one run each, one after another.")] = "0",
    device: Annotated[str, typer.Option(help="cpu or cuda.")] = "cpu",
    resume: Annotated[
        Path | None, typer.Option(help="Go on with the runs in this directory.")
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(help="Where the runs go, as seed_0, seed_1, ...; default runs/train/CONFIG."),
    ] = None,
    together: Annotated[
        bool, typer.Option("--together", help="All seeds at once, their parameters stacked.")
    ] = False,
    threads: Annotated[int, typer.Option(min=1, help="Processor threads of torch.")] = 1,
    steps: Annotated[
        int | None,
        typer.Option(min=1, help="Stop after so many environment steps in all; go on later."),
    ] = None,
    changes: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="KEY=VALUE", help="As agent.risk=0.5; may be repeated."),
    ] = None,
    start: Annotated[
        Path | None,
        typer.Option(
            "--from",
            metavar="CHECKPOINT",
            help="Begin with the networks of this run's file, which may know fewer inputs.",
        ),
    ] = None,
    wandb: Annotated[
        str | None, typer.Option(metavar="PROJECT", help="Report to Weights & Biases, too.")
    ] = None,
) -> None:
    """Train policies; a run that was cut off goes on from its last checkpoint."""
    from twinscrew.runtime.errors import ConfigError, TwinscrewError

    try:
        import torch
    except ModuleNotFoundError as error:
        raise TwinscrewError("'train' needs torch: pip install 'twinscrew[train]'") from error
    from twinscrew.runtime.settings import shipped
    from twinscrew.training import runs
    from twinscrew.training.logs import Progress
    from twinscrew.training.settings import load_training, parse_seeds
    from twinscrew.training.train import Training
    from twinscrew.training.train import train as run

    file = shipped("training", config)
    settings = load_training(file, changes or ())
    chosen = parse_seeds(seeds)
    if device not in ("cpu", "cuda") or (device == "cuda" and not torch.cuda.is_available()):
        raise ConfigError(f"{device!r} is not one of the devices of this machine", key="--device")
    folder = resume or out or Path("runs") / "train" / file.stem
    if resume is not None and not list(resume.glob(f"seed_*/{runs.CHECKPOINT}")):
        raise ConfigError("no checkpoint to resume from", file=resume)
    torch.set_num_threads(threads)
    places = {seed: folder / f"seed_{seed}" for seed in chosen}
    with _asked_to_stop() as signals:
        for group in [chosen] if together else [[seed] for seed in chosen]:
            with ExitStack() as held:
                for seed in group:
                    held.enter_context(runs.locked(places[seed]))
                progress = held.enter_context(Progress(file.stem, steps or settings.steps))
                decided = _with_precision(settings, places[group[0]], progress.say)
                told = [
                    Training(decided, seed, places[seed], device, wandb, start) for seed in group
                ]
                run(told, progress, steps=steps, stopped=lambda: bool(signals))
            if signals:
                sys.exit(128 + signals[0])


@contextmanager
def _asked_to_stop() -> Iterator[list[int]]:
    """Collect the first Ctrl-C or SIGTERM instead of ending at once; a second one ends."""
    signals: list[int] = []
    numbers = (signal.SIGINT, signal.SIGTERM)
    before = {number: signal.getsignal(number) for number in numbers}

    def take(number: int, _frame: FrameType | None) -> None:
        signals.append(number)
        for one, handler in before.items():
            signal.signal(one, handler)

    try:
        for number in numbers:
            signal.signal(number, take)
        yield signals
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def _with_precision(settings: TrainSettings, folder: Path, say: Any) -> TrainSettings:
    """Settle `precision = "auto"`: as the run was begun, or by trying both for a second."""
    import msgspec

    from twinscrew.training import runs
    from twinscrew.training.bench import faster_precision
    from twinscrew.training.train import complete

    agent = settings.agent
    if agent.precision != "auto" or agent.bfloat16 is not None:
        return settings
    if (folder / runs.CONFIG).exists():
        file = folder / runs.CONFIG
        with runs.understood(file):
            begun = complete(runs.read_told(folder)["settings"])["agent"]
            mine = {key: begun[key] for key in ("precision", "bfloat16")}
            return msgspec.structs.replace(settings, agent=msgspec.structs.replace(agent, **mine))
    precision, times = faster_precision(settings)
    figures = ", ".join(f"{name} {seconds * 1e3:.1f} ms" for name, seconds in times.items())
    say(f"precision: {precision} (an update takes: {figures})")
    agent = msgspec.structs.replace(agent, precision=precision)
    return msgspec.structs.replace(settings, agent=agent)


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
    traffic: Annotated[
        str | None,
        typer.Option(
            help="One own vessel among others that hold course and speed: a JSON file, or a set to "
            "be drawn: slow, fast, large, anchored, imazu.",
            metavar="FILE|SET",
        ),
    ] = None,
    coriolis: Annotated[
        str,
        typer.Option(help="once: the paper's equation; twice: the authors' public environment."),
    ] = "once",
    vessel: Annotated[
        str | None,
        typer.Option(
            help="Whose hull it drives, a shipped vessel or a file; distances are as many lengths. "
            "any: each vessel has a hull drawn at random.",
            show_default="wam_v",
            metavar="NAME|FILE|any",
        ),
    ] = None,
    unknown: Annotated[
        str | None,
        typer.Option(
            help="What it is not told of its hull and the water: mass, drag, propeller, lag, "
            "current, or several, as mass,lag.",
            show_default="nothing",
        ),
    ] = None,
    harbours: Annotated[
        str | None,
        typer.Option(
            help="Among edges instead: harbours of these kinds, as gap,channel, or all.",
            metavar="KINDS",
        ),
    ] = None,
    current: Annotated[
        float | None,
        typer.Option(
            min=0.0,
            help="Greatest speed [m/s] of a current that is steady, sheared, a vortex or a tide.",
        ),
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
) -> None:
    """Score a policy in the training environment."""
    from twinscrew.runtime.errors import ConfigError, one_of
    from twinscrew.runtime.policy.hull_units import units_of
    from twinscrew.runtime.policy.risk import parse_risk
    from twinscrew.runtime.settings import convert
    from twinscrew.runtime.vessel_description import DEFAULT, load_vessel
    from twinscrew.training.environment import EnvironmentSettings
    from twinscrew.training.evaluate import (
        harbour_rows,
        in_current,
        in_fresh_harbours,
        open_policy,
        sailed_by,
        sailed_by_any,
        unknown_to_policy,
    )
    from twinscrew.training.harbours import Kind
    from twinscrew.training.scenarios import ScenarioSettings, published_distance_m, six_settings
    from twinscrew.training.traffic import draw_traffic, read_traffic

    hull = load_vessel() if vessel in (None, "any") else load_vessel(vessel)
    environment = sailed_by(hull, convert({"coriolis": coriolis}, EnvironmentSettings))
    if vessel == "any":
        environment = sailed_by_any(environment)
    if unknown is not None:
        environment = unknown_to_policy(environment, unknown.split(","))
    units = units_of(hull, load_vessel())
    if current is not None:
        environment = in_current(environment, current / units.speed)
    if harbours is not None:
        known: tuple[Kind, ...] = get_args(Kind)
        named = known if harbours == "all" else harbours.split(",")
        for word in set(named) - set(known):
            raise ConfigError(one_of(word, (*known, "all")), key="--harbours")
        kinds = tuple(kind for kind in known if kind in named)
        if every or on is not None or traffic is not None:
            raise ConfigError("harbours are scored alone", key="--harbours")
        environment = in_fresh_harbours(environment, seed)
    if on is not None or traffic is not None:
        if risks is not None or every or (on is not None and traffic is not None):
            key = "--on" if on is not None else "--traffic"
            raise ConfigError("given episodes are scored alone, at one level", key=key)
        if on is not None and hull.key != DEFAULT:
            raise ConfigError("an experiment's episodes have vessels of their own", key="--vessel")
        asked = open_policy(policy, parse_risk(risk), hull)
        if on is not None:
            _evaluate_on(on, asked, seed, environment, as_json=as_json)
        elif traffic is not None:
            path = Path(traffic)
            drawn = "." not in traffic and not path.exists()
            met = draw_traffic(traffic, episodes, seed) if drawn else read_traffic(path)
            _evaluate_traffic(met, asked, seed, environment, units, as_json=as_json)
        return
    distance = published_distance_m(robots) if min_distance is None else min_distance
    one = {"robots": robots, "buoys": buoys, "min_distance_m": distance}
    rows = six_settings() if every else (convert(one, ScenarioSettings),)
    if harbours is not None:
        rows = harbour_rows(kinds, robots)
    if risk is not None and risks is not None:
        raise ConfigError("give either one level or several", key="--risk, --risks")
    curve = {}
    for level in [risk] if risks is None else risks.split(","):
        asked = open_policy(policy, parse_risk(level), hull)
        results = _evaluate(asked, rows, episodes, seed, environment)
        results = tuple(in_seconds(result, units.time) for result in results)
        if not as_json:
            _print_table(rows, results, "" if level is None else f"risk {level}")
        records = [result.record() for result in results]
        if harbours is not None:
            rows_of = zip(kinds, results, strict=True)
            records = [{"harbour": kind} | one.record(land=True) for kind, one in rows_of]
        curve[level] = {"settings": records} if every or harbours is not None else records[0]
    if as_json:
        print(json.dumps(curve[risk] if risks is None else {"risks": curve}))


def in_seconds(result: Evaluation, unit: float) -> Evaluation:
    """Give a score with its travel time in seconds, found in a hull's own unit of time."""
    time = result.travel_time_s
    return dataclasses.replace(result, travel_time_s=None if time is None else time * unit)


def _evaluate_on(
    folder: Path, policy: BatchPolicy, seed: int, where: EnvironmentSettings, *, as_json: bool
) -> None:
    """Score a policy on an experiment's episodes."""
    from twinscrew.training.scenarios import ScenarioSettings
    from twinscrew.training.traffic import evaluate_given, read_given

    sets = read_given(folder)
    results = [evaluate_given(policy, given, seed, where) for given in sets.values()]
    if as_json:
        rows = zip(sets, results, strict=True)
        print(json.dumps({"settings": [{"name": name} | one.record() for name, one in rows]}))
        return
    shapes = [
        ScenarioSettings(robots=one.start.shape[1], buoys=one.buoy.shape[1], min_distance_m=0.0)
        for one in sets.values()
    ]
    _print_table(shapes, results, f"on {folder}")


def _evaluate_traffic(
    traffic: Traffic,
    policy: BatchPolicy,
    seed: int,
    where: EnvironmentSettings,
    units: HullUnits,
    *,
    as_json: bool,
) -> None:
    """Score a policy on one own vessel among scripted others."""
    from rich.console import Console
    from rich.table import Table

    from twinscrew.training.traffic import evaluate_traffic

    answer = evaluate_traffic(policy, traffic, seed, where, units)
    if as_json:
        print(json.dumps(answer))
        return
    table = Table("episode", "outcome", "time", "closest approach")
    for number, one in enumerate(answer["episodes"]):
        gap = one["closest_approach_m"]
        near = "-" if gap is None else f"{gap:.2f} m"
        table.add_row(str(number), one["outcome"], f"{one['time_s']:.1f} s", near)
    console = Console()
    console.print(table)
    console.print(
        f"{answer['success_rate']:.1%} arrived, {answer['contacts']} contacts, "
        f"{answer['timeouts']} timeouts"
    )


def _evaluate(
    policy: BatchPolicy,
    rows: Sequence[ScenarioSettings],
    episodes: int,
    seed: int,
    where: EnvironmentSettings,
) -> tuple[Evaluation, ...]:
    """Evaluate row by row, with a progress bar on standard error, or lines for a log."""
    from rich.console import Console
    from rich.progress import Progress

    from twinscrew.runtime.progress import ProgressLines
    from twinscrew.training.evaluate import evaluate_all

    console, total = Console(file=sys.stderr), episodes * len(rows)
    with Progress(console=console, transient=True, disable=not console.is_terminal) as bar:
        task, lines, done = bar.add_task(policy.name, total=total), ProgressLines(policy.name), 0

        def ended(count: int) -> None:
            nonlocal done
            done += count
            bar.advance(task, count)
            if not console.is_terminal:
                lines.update(done, total)

        return evaluate_all(policy, rows, episodes, seed, environment=where, progress=ended)


def _print_table(
    rows: Sequence[ScenarioSettings], results: Sequence[Evaluation], title: str
) -> None:
    """Print the scores, one line a setting."""
    from rich.console import Console
    from rich.table import Table

    heads = ("robots", "buoys", "distance", "success", "95 %", "time", "hits", "late")
    table = Table(*heads, title=title or None)
    for row, result in zip(rows, results, strict=True):
        low, high = result.wilson95
        time = result.travel_time_s
        table.add_row(
            str(row.robots),
            "piles" if row.harbour else str(row.buoys),
            ", ".join(row.harbour) or f"{row.min_distance_m:g} m",
            f"{result.success_rate:.1%}",
            f"{low:.1%} .. {high:.1%}",
            "-" if time is None else f"{time:.2f} s",
            str(result.collisions),
            str(result.timeouts),
        )
    Console().print(table)


def train_report(
    runs: Annotated[list[Path], typer.Argument(help="Run directories, or folders of them.")],
    out: Annotated[Path, typer.Option(help="Where the figure goes.")] = Path(),
    by: Annotated[
        Literal["algorithm", "folder"],
        typer.Option(help="What makes runs seeds of one; train names folders by configuration."),
    ] = "algorithm",
    table: Annotated[
        bool, typer.Option("--table", help="Print a table in Markdown instead, by folder.")
    ] = False,
    which: Annotated[
        Literal["last", "best"],
        typer.Option(help="The table's evaluations: at the end, or of the best checkpoint."),
    ] = "last",
) -> None:
    """Draw the learning curves of training runs, mean and standard error over seeds."""
    from twinscrew.training.report import draw_learning_curves, find_runs, seeds_table

    if table:
        print(seeds_table(find_runs(runs, "folder"), which), end="")
        return
    import matplotlib as mpl

    mpl.use("Agg")
    out.mkdir(parents=True, exist_ok=True)
    file = out / "learning_curves.png"
    draw_learning_curves(find_runs(runs, by), file)
    print(file)
