"""`twinscrew run`: one vessel's runtime, as it is deployed on the boat."""

from __future__ import annotations

import signal
import sys
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from msgspec.structs import replace

from twinscrew.runtime.vessel import one_thread  # noqa: F401  (before anything loads a library)

# isort: split

from twinscrew.runtime.vessel.approval import Approved, load_approved
from twinscrew.runtime.vessel.consent import place_of, take
from twinscrew.runtime.vessel.process import StopRequest, at_end_of_input, take_priority

if TYPE_CHECKING:
    from twinscrew.runtime.vessel.vessel import Vessel


ManifestOption = Annotated[
    Path | None, typer.Option(help="Read only files that agree with this manifest.")
]
PublicKeyOption = Annotated[
    Path | None, typer.Option(help="The minisign key that must have signed the manifest.")
]


def run(
    config: Annotated[Path, typer.Option(help="The vessel's TOML file; see config/runtime.toml.")],
    manifest: ManifestOption = None,
    public_key: PublicKeyOption = None,
    arm: Annotated[
        bool,
        typer.Option(
            "--arm",
            help="autopilot.arm and `twinscrew consent` in one, for this start. No service's.",
        ),
    ] = False,
    tethered: Annotated[
        bool, typer.Option("--tethered", help="Stop, too, when standard input ends.")
    ] = False,
) -> None:
    """Run one vessel's runtime until it is told to stop (SIGINT or SIGTERM).

    With `autopilot.arm = true` it arms, or drives thrusters by topic, only after `twinscrew
    consent`, once; or with --arm.
    """
    serve(load_approved(config, manifest, public_key), config, arm=arm, tethered=tethered)


def serve(
    approved: Approved,
    source: Path,
    *,
    arm: bool = False,
    tethered: bool = False,
    until: Callable[[Vessel], bool] = lambda _vessel: False,
) -> None:
    """Run a vessel's runtime until a signal, or `until` says that it has done what it was for."""
    stop = StopRequest()
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, stop.make)
    if tethered:
        at_end_of_input(stop.make)
    settings = approved.config
    if arm:
        settings = replace(settings, autopilot=replace(settings.autopilot, arm=True))
    refused = take_priority(settings.priority)
    for words in refused:
        say(settings.name, f"ordinary priority: {words}")
    withheld = None
    if settings.autopilot.arm and not arm:
        withheld = take(place_of(source, settings.autopilot.consent_file))
    if withheld is not None:
        settings = replace(settings, autopilot=replace(settings.autopilot, arm=False))
        say(settings.name, f"asks for no arming: {withheld}")
    from twinscrew.runtime.vessel.realtime import run_vessel  # Zenoh, after the priority

    summary = run_vessel(
        settings,
        source=source,
        stop=stop,
        until=until,
        refused=refused,
        approval=str(approved.approval or ""),
        withheld=withheld or "",
        ready=lambda: say(settings.name, "running"),
    )
    say(settings.name, f"{summary.decisions} decisions, stopped")


def say(name: str, words: str) -> None:
    """Tell the operator, at once."""
    print(f"{name}: {words}", file=sys.stderr, flush=True)
