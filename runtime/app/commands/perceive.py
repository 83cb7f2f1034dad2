"""`twinscrew perceive`: what perception makes of a point cloud file from elsewhere."""

from __future__ import annotations

import json
import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
import typer
from rich.console import Console
from rich.table import Table

if TYPE_CHECKING:
    from twinscrew.runtime.messages.types import Objects
    from twinscrew.runtime.perception.stage import Perception

LEVEL = np.array([1.0, 0.0, 0.0, 0.0])
FEW = 0.8
"""[-] Below this share of points in range on a beam, the sensor is probably another."""


def perceive(
    file: Annotated[
        Path,
        typer.Argument(help="A cloud: .bin (KITTI, nuScenes), .pcd or .npy; x forward, y left."),
    ],
    sensor: Annotated[
        str, typer.Option(help="vrx16, vrx32, vlp16, hdl32e, os1_64, or the path of a description.")
    ],
    height_m: Annotated[
        float | None,
        typer.Option(help="The sensor's height over the water; echoes from the water are dropped."),
    ] = None,
    max_range_m: Annotated[float, typer.Option(help="Farther echoes are not used.")] = 20.0,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
    plot: Annotated[Path | None, typer.Option(help="Draw a picture into this file.")] = None,
) -> None:
    """Segment one point cloud file and print its objects."""
    from twinscrew.runtime.messages.types import PointCloud
    from twinscrew.runtime.perception.files import read_cloud

    points = read_cloud(file) * np.array([1, -1, -1], np.float32)
    cloud = PointCloud(stamp_ns=0, frame_id=str(file), points_S=points)
    perception = _perception(sensor, height_m, max_range_m)
    perception.step(cloud, LEVEL)  # the first scan also pays for touching the memory
    begin = time.perf_counter()
    objects = perception.step(cloud, LEVEL)
    result = _as_dict(perception, objects, 1e3 * (time.perf_counter() - begin))
    if plot is not None:
        from twinscrew.runtime.perception.picture import draw

        draw(perception, cloud, objects, plot)
    if as_json:
        print(json.dumps(result))
    else:
        _print(Console(), result)


def _perception(name: str, height_m: float | None, max_range_m: float) -> Perception:
    """Make a perception whose vessel is the sensor itself: no hull, and no water unless asked."""
    from twinscrew.runtime.perception.sensor import Mount, load_sensor
    from twinscrew.runtime.perception.stage import Perception, PerceptionSettings
    from twinscrew.runtime.settings import convert

    values: dict[str, Any] = {"max_range_m": max_range_m, "hull": None, "water": None}
    if height_m is not None:
        values["water"] = {"surface_m": -height_m}
    settings = convert(values, PerceptionSettings, file="command line")
    return Perception(load_sensor(name).mounted(Mount(x_m=0.0, y_m=0.0, z_m=0.0)), settings)


def _as_dict(perception: Perception, objects: Objects, time_ms: float) -> dict[str, Any]:
    report = perception.report
    rows = zip(objects.p_B, objects.radius, objects.points, strict=True)
    return {
        "objects": [
            {
                "x_m": round(float(p[0]), 3),
                "y_m": round(-float(p[1]), 3),  # the file's y is to the left
                "radius_m": round(float(radius), 3),
                "points": int(count),
            }
            for p, radius, count in rows
        ],
        "points": report.points,
        "used_points": report.used,
        "time_ms": round(time_ms, 4),
        "left_out": {
            name: getattr(report, name) for name in ("empty", "range", "no_beam", "water", "hidden")
        },
    }


def _print(console: Console, result: dict[str, Any]) -> None:
    table = Table("x_m", "y_m", "radius_m", "points")
    for item in result["objects"]:
        table.add_row(
            f"{item['x_m']:.2f}",
            f"{item['y_m']:.2f}",
            f"{item['radius_m']:.2f}",
            str(item["points"]),
        )
    console.print(table)
    left_out = ", ".join(f"{count} {name}" for name, count in result["left_out"].items() if count)
    console.print(
        f"{result['used_points']} of {result['points']} points used in {result['time_ms']:.2f} ms"
        + (f"; left out: {left_out}" if left_out else "")
    )
    in_range = result["points"] - result["left_out"]["empty"] - result["left_out"]["range"]
    if in_range and result["left_out"]["no_beam"] > (1 - FEW) * in_range:
        console.print("many points fit no beam: is this scan from that sensor?", style="yellow")
