"""`twinscrew doctor`: tells whether this machine, this installation and this boat are fit."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console
from rich.table import Table

if TYPE_CHECKING:
    from twinscrew.runtime.vessel.config import RuntimeConfig

UNFIT = 1
COLOURS = {"OK": "green", "WARN": "yellow", "FAIL": "red"}


def doctor(
    config: Annotated[
        Path | None, typer.Option(help="The vessel's TOML file; the defaults without it.")
    ] = None,
    vessel: Annotated[
        str | None, typer.Option(help="The vessel: a name in config/vessels, or a file.")
    ] = None,
    manifest: Annotated[
        Path | None, typer.Option(help="The manifest that `run` is given, with --config.")
    ] = None,
    public_key: Annotated[
        Path | None, typer.Option(help="The key that `run` is given, with --config.")
    ] = None,
    listen: Annotated[
        float, typer.Option(help="Listen to the boat for so long [s]; check what comes.", min=0)
    ] = 0.0,
    write_params: Annotated[
        bool,
        typer.Option(
            "--write-params", help="With --listen: write autopilot parameters that are wrong."
        ),
    ] = False,
    recording: Annotated[
        list[Path] | None,
        typer.Option(help="Recorded trials: does the vessel's file predict them? Repeatable."),
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
) -> None:
    """Check this machine and this installation, line by line; exit status 1 if a line says FAIL."""
    from twinscrew.runtime.doctor.checks import Sources, Verdict, check_recordings, examine
    from twinscrew.runtime.errors import ConfigError
    from twinscrew.runtime.vessel.config import config_for, load_config
    from twinscrew.runtime.vessel_description import DEFAULT

    settings = (
        load_config(config, vessel)
        if config is not None
        else _at_home(config_for(vessel or DEFAULT))
    )
    folder = Path(settings.recording.folder or "runs")
    sources = None if config is None else Sources(config, manifest, public_key)
    findings = examine(settings, folder, sources)
    if listen > 0:
        from twinscrew.runtime.doctor.listening import listen as listen_to

        findings += listen_to(settings, listen, write_params=write_params)
    elif write_params:
        raise ConfigError("only with --listen", key="--write-params")
    if recording:
        findings += check_recordings(settings, recording)
    fit = all(finding.verdict is not Verdict.FAIL for finding in findings)
    rows = [(f.what, f.verdict.value, f.found, f.advice) for f in findings]
    if as_json:
        keys = ("what", "verdict", "found", "advice")
        checks = [dict(zip(keys, row, strict=True)) for row in rows]
        print(json.dumps({"fit": fit, "checks": checks}))
    else:
        _print(rows)
    if not fit:
        raise typer.Exit(UNFIT)


def _at_home(config: RuntimeConfig) -> RuntimeConfig:
    """Give the defaults without a router to reach: a machine at the desk has none."""
    from msgspec.structs import replace

    return replace(config, bus=replace(config.bus, connect=()))


def _print(rows: list[tuple[str, str, str, str]]) -> None:
    table = Table("", "verdict", "found", "what to do")
    for what, verdict, found, advice in rows:
        colour = COLOURS[verdict]
        table.add_row(what, f"[{colour}]{verdict}[/{colour}]", found, advice)
    Console().print(table)
