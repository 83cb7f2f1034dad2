"""`twinscrew replay`: a recording's decisions, made again."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console
from rich.markup import escape
from rich.table import Table

if TYPE_CHECKING:
    from twinscrew.runtime.vessel.replay import Replay

DIFFERENT = 1
MISSING = {
    "beginning": "its beginning is missing (the oldest files go beyond the quota)",
    "part": "a file in its middle is missing",
}


def replay(
    recording: Annotated[
        Path, typer.Argument(help="A run's folder, a rosbag2 folder, or one .mcap file.")
    ],
    config: Annotated[
        Path | None, typer.Option(help="Use this runtime configuration, not the recorded one.")
    ] = None,
    policy: Annotated[str | None, typer.Option(help="Use this policy instead.")] = None,
    topics: Annotated[
        Path | None, typer.Option(help="TOML that maps a foreign bag's topics to ours.")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
) -> None:
    """Feed a recording to the core again; print the SHA-256 of its decisions."""
    from twinscrew.runtime.recording.recording import find_recordings
    from twinscrew.runtime.vessel.replay import combined_sha256
    from twinscrew.runtime.vessel.replay import replay as replay_one

    replays = [
        replay_one(found, config=config, policy=policy)
        for found in find_recordings(recording, topics)
    ]
    same = all(r.same or r.recorded_decisions == 0 for r in replays)
    if as_json:
        print(json.dumps(_as_dict(replays, combined_sha256(r.sha256 for r in replays), same)))
    else:
        _print(replays, combined_sha256(r.sha256 for r in replays))
    if not same:
        raise typer.Exit(DIFFERENT)


def _as_dict(replays: list[Replay], sha256: str, same: bool) -> dict[str, object]:
    return {
        "decisions_sha256": sha256,
        "same": same,
        "vessels": [
            {
                "name": r.vessel,
                "decisions": r.decisions,
                "decisions_sha256": r.sha256,
                "recorded_decisions": r.recorded_decisions,
                "same": r.same,
                "whole": r.whole,
                "missing": list(r.missing),
                "refused": {name: asdict(what) for name, what in r.refused.items()},
            }
            for r in replays
        ],
    }


def _print(replays: list[Replay], sha256: str) -> None:
    table = Table("vessel", "decisions", "recorded", "SHA-256", "the same")
    for r in replays:
        verdict = "yes" if r.same else ("none recorded" if r.recorded_decisions == 0 else "NO")
        if not r.whole:
            verdict += " (its end is missing)"
        table.add_row(
            escape(r.vessel),
            str(r.decisions),
            str(r.recorded_decisions),
            r.sha256[:16] + "...",
            verdict,
        )
    Console().print(table)
    for r in replays:
        for part in r.missing:
            print(f"{r.vessel}: {MISSING[part]}: the decisions after that need not be the same")
        for name, what in r.refused.items():
            print(f"{r.vessel}: {name} {what.count} times" + (what.first and f": {what.first}"))
    print(f"decisions_sha256 {sha256}")
