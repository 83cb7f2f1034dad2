"""`twinscrew run`: one vessel's runtime, as it is deployed on the boat."""

from __future__ import annotations

import signal
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Annotated

import typer

from twinscrew.runtime.vessel import one_thread  # noqa: F401  (before anything loads a library)

# isort: split
from twinscrew.runtime.app.approval import Approved, load_approved
from twinscrew.runtime.vessel.process import StopRequest, at_end_of_input


def run(
    config: Annotated[Path, typer.Option(help="The vessel's TOML file; see config/runtime.toml.")],
    manifest: Annotated[
        Path | None, typer.Option(help="Read only files that agree with this manifest.")
    ] = None,
    public_key: Annotated[
        Path | None, typer.Option(help="The minisign key that must have signed the manifest.")
    ] = None,
    tethered: Annotated[
        bool, typer.Option("--tethered", help="Stop, too, when standard input ends.")
    ] = False,
) -> None:
    """Run one vessel's runtime until it is told to stop (SIGINT or SIGTERM)."""
    approved = load_approved(config, manifest, public_key)
    stop = StopRequest()
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, stop.make)
    if tethered:
        at_end_of_input(stop.make)
    sail(approved, stop, source=config)


def sail(approved: Approved, stop: Callable[[], bool], *, source: Path) -> None:
    """Open everything, loop until `stop` says so, close everything, and write the summary."""
    from twinscrew.runtime.vessel.process import take
    from twinscrew.runtime.vessel.realtime import Session

    config = approved.config
    refused = take(config.priority)
    for words in refused:
        print(f"{config.name}: ordinary priority: {words}", file=sys.stderr, flush=True)
    approval = str(approved.approval or "")
    session = Session(config, source=source, stop=stop, refused=refused, approval=approval)
    with only_approved(approved.contents), session:
        print(f"{config.name}: running", file=sys.stderr, flush=True)
        session.loop.run(stop)
    summary = session.write_summary()
    print(f"{config.name}: {summary.decisions} decisions, stopped", file=sys.stderr, flush=True)
