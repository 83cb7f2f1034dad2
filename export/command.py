"""`twinscrew export`: a training run's best actor as an ONNX file, with its card beside it."""

from __future__ import annotations

import json
import subprocess
from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated

import torch
import typer
from rich.console import Console
from rich.markup import escape

from twinscrew.export.card import scores, write_card
from twinscrew.export.onnx_file import (
    FORMAT,
    DeployedPolicy,
    inputs_of,
    onnx_bytes,
)
from twinscrew.export.parity import check_parity
from twinscrew.export.run_dir import load_run, which_checkpoint
from twinscrew.training import runs
from twinscrew.training.agents import algorithm
from twinscrew.training.environment import RATE_LIMIT
from twinscrew.training.evaluate import open_policy, validate
from twinscrew.training.settings import TrainSettings, phase_settings


def export(
    run_dir: Annotated[Path, typer.Argument(help="A training run's directory (of one seed).")],
    out: Annotated[Path, typer.Option(help="The ONNX file; its card goes beside it.")],
    margin: Annotated[
        float | None,
        typer.Option(
            min=0.5,
            max=2.0,
            help="Factor on observed radii, in the graph.",
            show_default="the configuration's radius_margin",
        ),
    ] = None,
    risk: Annotated[
        float | None,
        typer.Option(
            min=1e-3,
            max=1.0,
            help="Risk level that holds where a user gives none.",
            show_default="the configuration's, in the checkpoint's phase",
        ),
    ] = None,
    open_water: Annotated[
        Path | None,
        typer.Option(
            metavar="RUN_DIR",
            help="Where no edge is near, act as the last actor of this run does.",
        ),
    ] = None,
    episodes: Annotated[
        int, typer.Option(min=1, help="For the card, in each of the six settings.")
    ] = 1000,
    seed: Annotated[int, typer.Option(min=0, help="Of the card's episodes.")] = 90_210,
    last: Annotated[bool, typer.Option(help="The last checkpoint instead of the best.")] = False,
    json_: Annotated[bool, typer.Option("--json", help="Print the card.")] = False,
) -> None:
    """Turn a training run's actor into a self-contained ONNX file."""
    console = Console(stderr=True)
    checkpoint = which_checkpoint(run_dir, last=last)
    policy, settings, trained = load_run(run_dir, checkpoint, margin, risk, open_water)
    if checkpoint != (runs.CHECKPOINT if last else runs.BEST):
        console.print(
            f"{checkpoint} is all that there is yet: step {trained['checkpoint']['step']}"
        )
    deployed = DeployedPolicy(policy, RATE_LIMIT)
    metadata = describe(settings, "/".join(run_dir.resolve().parts[-2:]), deployed.risk)
    data = onnx_bytes(deployed, metadata, settings.environment.layout)
    runs.replace_file(out, lambda file: file.write(data))
    parity = check_parity(deployed, out, settings.environment.layout)
    console.print(
        f"{escape(str(out))}: {parity.max_difference_n_per_s:.2g} N/s from the network over "
        f"{parity.observations} observations, {parity.decision_ms:.3f} ms a decision"
    )
    with console.status(f"{episodes} episodes in each of the six settings"):
        rough = phase_settings(settings, settings.phases[-1]).rough
        asked = rough if settings.rough_share > 0.0 else None
        scored = scores(validate(open_policy(str(out)), episodes, seed, asked), episodes, seed)
    card = write_card(out, metadata, trained, parity, scored)
    for row in scored["settings"]:
        console.print(
            f"{row['robots']} vessels, {row['buoys']} buoys: {row['success_rate']:.1%} "
            f"in {row['travel_time_s']} s"
        )
    if json_:
        print(card.read_text(encoding="utf-8"), end="")


def describe(settings: TrainSettings, run: str, risk: float | None = None) -> dict[str, str]:
    """Give the metadata of a policy file: strings, as ONNX wants them."""
    environment, layout = settings.environment, settings.environment.layout
    inputs = inputs_of(layout, risk, any_hull=layout.extended)
    vessel = environment.vessel
    ranges = {"perception_range_m": str(environment.range_m)}
    if layout.extended:
        ranges = {
            "perception_range_m": str(environment.strangers.far_range_m),
            "perception_range_min_m": str(environment.range_m),
            "vessel": "any",
        }
    return {
        "twinscrew_format": FORMAT,
        "algorithm": algorithm(settings.agent),
        "decision_period_s": str(environment.period_s),
        "thrust_min_n": str(vessel.thrust_min_n),
        "thrust_max_n": str(vessel.thrust_max_n),
        "thrust_rate_max_n_per_s": str(RATE_LIMIT),
        "observed_objects": str(layout.objects),
        **ranges,
        "radius_margin": str(settings.radius_margin),
        "inputs": json.dumps(inputs),
        "training_run": run,
        "commit": _commit(),
        "created": datetime.now(UTC).isoformat(timespec="seconds"),
        "torch": torch.__version__,
    }


def _commit() -> str:
    """Name the source's commit; "unknown" outside a checkout."""
    try:
        words = ["git", "rev-parse", "--short=12", "HEAD"]
        found = subprocess.run(
            words, capture_output=True, text=True, check=True, cwd=Path(__file__).parent
        )
    except (OSError, subprocess.CalledProcessError):
        return "unknown"
    return found.stdout.strip()
