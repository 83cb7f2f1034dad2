"""`twinscrew trial`: scripted manoeuvres on the boat, from which its vessel can be identified."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from twinscrew.runtime.vessel import one_thread  # noqa: F401  (before anything loads a library)

# isort: split
from msgspec.structs import replace

from twinscrew.runtime.cli.run import ManifestOption, PublicKeyOption, say, serve
from twinscrew.runtime.errors import ConfigError, one_of
from twinscrew.runtime.settings import Settings, convert
from twinscrew.runtime.vessel.approval import load_approved
from twinscrew.runtime.vessel.trial import TRIALS, Trial, TrialSettings
from twinscrew.runtime.vessel_description import load_vessel

if TYPE_CHECKING:
    from twinscrew.runtime.vessel.vessel import Vessel

ENDED_EARLY = 1


def trial(
    name: Annotated[str, typer.Argument(help="straight, zigzag, circle, stop, or all of them.")],
    config: Annotated[Path, typer.Option(help="The vessel's TOML file, as for `run`.")],
    box: Annotated[
        str | None,
        typer.Option(help="The water, local frame [m]: SOUTH,WEST,NORTH,EAST. Or --around."),
    ] = None,
    around: Annotated[
        float, typer.Option(help="The water reaches so far to each side of the start [m].", min=0)
    ] = 0.0,
    speed_limit: Annotated[
        float, typer.Option(help="Faster over ground the trial ends [m/s]; 0: 1.5 top speeds.")
    ] = 0.0,
    clearance: Annotated[
        float, typer.Option(help="No track may come nearer [m]; 0: two lengths.", min=0)
    ] = 0.0,
    max_time: Annotated[float, typer.Option(help="Done after so long [s].")] = 1200.0,
    arm: Annotated[
        bool, typer.Option("--arm", help="Consent to this trial's driving, as autopilot.arm.")
    ] = False,
    manifest: ManifestOption = None,
    public_key: PublicKeyOption = None,
) -> None:
    """Sail a trial: the boat drives by itself, within a box of water, and records.

    It begins when the autopilot is armed and in MANUAL, and ends by itself. Exit status 0 if it was
    sailed to its end, 1 if its guard or somebody else ended it, 2 if it was refused.
    """
    if name not in (*TRIALS, "all"):
        raise ConfigError(one_of(name, (*TRIALS, "all")), key="trial")
    approved = load_approved(config, manifest, public_key)
    wanted = {
        "name": name,
        "around_m": around,
        "speed_limit_mps": speed_limit,
        "clearance_m": clearance,
        "max_time_s": max_time,
        **({} if box is None else {"box_m": _numbers(box)}),
    }
    settings = replace(approved.config, trial=convert({"trial": wanted}, _Wanted).trial)
    Trial(settings.trial, load_vessel(settings.vessel), settings.thrust)  # refuse it right away
    watch = _Watch(settings.name)
    serve(dataclasses.replace(approved, config=settings), config, arm=arm, until=watch)
    if not watch.done:
        raise typer.Exit(ENDED_EARLY)


class _Wanted(Settings, frozen=True):
    """So that a refusal names its key as `trial.key`."""

    trial: TrialSettings


class _Watch:
    """Tells the operator what the trial does, and the loop when it has ended."""

    def __init__(self, name: str) -> None:
        self._name = name
        self._told = ""
        self.done = False

    def __call__(self, vessel: Vessel) -> bool:
        sailed = vessel.pipeline.trial
        if sailed is None:
            return True
        if sailed.words != self._told:
            self._told = sailed.words
            say(self._name, sailed.words)
        self.done = sailed.done
        return sailed.has_ended


def _numbers(box: str) -> list[float]:
    try:
        return [float(word) for word in box.split(",")]
    except ValueError as error:
        raise ConfigError(f"SOUTH,WEST,NORTH,EAST in metres, got {box!r}", key="--box") from error
