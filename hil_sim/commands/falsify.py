"""`twinscrew falsify`: a search for motions of another vessel against which the assurance fails."""

from __future__ import annotations

import json
from typing import Annotated

import typer
from rich.console import Console

from twinscrew.hil_sim.falsify import Bounds, search

FOUND = 1


def falsify(
    tries: Annotated[int, typer.Option(help="How many motions are sailed.", min=1)] = 1000,
    seed: Annotated[int, typer.Option(help="What the search begins from.", min=0)] = 0,
    speed: Annotated[
        tuple[float, float], typer.Option(help="The other's least and greatest speed [m/s].")
    ] = Bounds().speed_mps,
    radius: Annotated[
        tuple[float, float], typer.Option(help="Its least and greatest radius [m].")
    ] = Bounds().radius_m,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
) -> None:
    """Look for avoidable contacts that the assurance does not avoid; exit status 1 if there are."""
    bounds = Bounds(speed_mps=speed, radius_m=radius)
    with Console(stderr=True, quiet=as_json).status("searching") as status:
        found = search(
            tries, seed, bounds, progress=lambda done: status.update(f"{done} of {tries} tries")
        )
    if as_json:
        print(json.dumps(found.record(bounds)))
    else:
        p50, p99, most = found.check_ms
        console = Console()
        console.print(
            f"{found.tries} tries: {found.contacts} contacts, {len(found.avoidable)} of them "
            f"avoidable; nearest {found.nearest_m:.2f} m; a check took {p50:.3f} ms (p99 {p99:.3f},"
            f" most {most:.3f})"
        )
        for one in found.avoidable[:5]:
            console.print(f"- {one.gap_m:.2f} m: {one.motion}")
    if found.avoidable:
        raise typer.Exit(FOUND)
