"""`twinscrew identify`: a vessel's file from recorded trials."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import tomli_w
import typer
from rich.console import Console
from rich.table import Table

from twinscrew.hil_sim.identification.figure import draw
from twinscrew.hil_sim.identification.identify import Identification, identify
from twinscrew.hil_sim.identification.recorded import SOURCES
from twinscrew.runtime.errors import ConfigError, one_of

WRONG = 1


def identify_command(
    recordings: Annotated[
        list[Path], typer.Argument(help="Recorded trials of one vessel: folders or files.")
    ],
    vessel: Annotated[
        str, typer.Option(help="What is known of it: a name in config/vessels, or a file.")
    ],
    out: Annotated[
        Path | None, typer.Option(help="The vessel's file to write; its figure lies beside it.")
    ] = None,
    thrust: Annotated[
        str, typer.Option(help="Thrust to believe: commanded, measured (PWM), or auto.")
    ] = "auto",
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
) -> None:
    """Identify mass, drag, thrust curve, lag, wind and current from recorded trials.

    Exit status 0 if the vessel's file agrees with the trials, 1 if they contradict it, 2 if the
    recordings cannot be used.
    """
    if thrust not in SOURCES:
        raise ConfigError(one_of(thrust, SOURCES), key="--thrust")
    if out is not None and out.suffix != ".toml":
        raise ConfigError(f"must end in .toml, got {out.name!r}", key="--out")
    found = identify(recordings, vessel, source=thrust)
    if out is not None:
        _write(found, recordings, vessel, out)
        draw(found, out.with_suffix(".png"))
    if as_json:
        print(json.dumps(found.as_dict()))
    else:
        _tell(found, out)
    if found.contradiction:
        raise typer.Exit(WRONG)


def _write(found: Identification, recordings: list[Path], vessel: str, out: Path) -> None:
    names = ", ".join(path.name for path in recordings)
    rmse = found.validation
    lines = [
        f"# Identified from {found.seconds:.0f} s of {names}, beginning with {vessel}.",
        f"# Held out: {rmse.position_rmse_5s_m:.3f} m after 5 s, {rmse.speed_rmse_mps:.3f} m/s, "
        f"{rmse.yaw_rate_rmse_rad_s:.4f} rad/s (RMS).",
        *(f"# {words}" for words in found.warnings),
        "",
    ]
    out.parent.mkdir(parents=True, exist_ok=True)
    out.write_text("\n".join(lines) + "\n" + tomli_w.dumps({"vessel": found.table}))


def _tell(found: Identification, out: Path | None) -> None:
    console = Console()
    table = Table("", "identified", "95 %", "", "told by the trials")
    for name, estimate in found.estimates.items():
        interval = f"{estimate.low:.4g} to {estimate.high:.4g}"
        told = "yes" if estimate.told else "no: as the file says"
        table.add_row(name, f"{estimate.value:.4g}", interval, estimate.unit, told)
    console.print(table)
    rows = Table("held out", "position after 5 s", "speed", "yaw rate")
    for name, rmse in (("identified", found.validation), ("as given", found.given)):
        rows.add_row(
            name,
            f"{rmse.position_rmse_5s_m:.3f} m",
            f"{rmse.speed_rmse_mps:.3f} m/s",
            f"{rmse.yaw_rate_rmse_rad_s:.4f} rad/s",
        )
    console.print(rows)
    for words in found.warnings:
        console.print(words, markup=False, highlight=False, soft_wrap=True)
    if found.contradiction:
        console.print("[red]the file is wrong[/red]:", end=" ")
        console.print(found.contradiction, markup=False, highlight=False, soft_wrap=True)
    if out is not None:
        console.print(f"{out}, {out.with_suffix('.png').name}, {out.with_suffix('.svg').name}")
