"""`twinscrew chart`: makes a boat's chart of charts in other formats."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

app = typer.Typer(
    help="Make a boat's chart of GeoJSON, shapefiles and S-57 cells.",
    no_args_is_help=True,
    add_completion=False,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
)


@app.callback()
def _chart() -> None:
    """Make a boat's chart of GeoJSON, shapefiles and S-57 cells."""


@app.command("import")
def import_(
    file: Annotated[Path, typer.Argument(help="GeoJSON, a shapefile, an S-57 cell (.000).")],
    out: Annotated[Path, typer.Option(help="The boat's chart, GeoJSON: [chart] file.")],
    kind: Annotated[
        str,
        typer.Option("--as", help="What all of it is: land, keep_out, depth, hazard, fence."),
    ] = "",
    crs: Annotated[
        str, typer.Option(help="Its coordinate system, where it does not say: EPSG:4326.")
    ] = "",
    simplify_m: Annotated[
        float, typer.Option(min=0.0, help="[m] Outlines may grow by this for fewer places.")
    ] = 0.0,
    repair: Annotated[
        bool, typer.Option(help="Keep what outlines enclose that cross themselves.")
    ] = False,
    picture: Annotated[Path | None, typer.Option(help="Draw it into this file, .png.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
) -> None:
    """Read a chart, and write what forbids a boat to be somewhere."""
    from collections import Counter

    from twinscrew.hil_sim.chart_import import draw_chart, import_chart
    from twinscrew.runtime.errors import ConfigError
    from twinscrew.runtime.files import replace_file

    imported = import_chart(file, kind=kind, crs=crs, simplify_m=simplify_m, repair=repair)
    content = json.dumps(imported.root, separators=(",", ":")).encode()
    try:
        replace_file(out, lambda opened: opened.write(content))
        if picture is not None:
            draw_chart(imported, picture)
    except OSError as error:
        raise ConfigError(error.strerror or str(error), file=error.filename or out) from error
    kinds = Counter(feature.kind for feature in imported.chart.features)
    ignored = {**imported.skipped, **imported.chart.ignored}
    middle = imported.datum
    report = {
        "features": dict(sorted(kinds.items())),
        "places": imported.places,
        "places_before": imported.places_before,
        "repaired": imported.chart.repaired,
        "ignored": ignored,
        "middle": {"latitude_deg": middle.latitude_deg, "longitude_deg": middle.longitude_deg},
        "out": str(out),
    }
    if as_json:
        typer.echo(json.dumps(report))
        return
    words = ", ".join(f"{count} {kind}" for kind, count in sorted(kinds.items()))
    console = Console(highlight=False, soft_wrap=True)
    console.print(f"{out}: {words}; {imported.places} places of {imported.places_before}")
    if imported.chart.repaired:
        console.print(f"repaired: {imported.chart.repaired} outlines that crossed themselves")
    if ignored:
        console.print(f"left out, they forbid nothing: {', '.join(sorted(ignored))}")
    console.print(f"its middle: {middle.latitude_deg:.6f} N, {middle.longitude_deg:.6f} E")
