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
    from twinscrew.runtime.messages.types import Objects, PointCloud
    from twinscrew.runtime.perception.foreign import Chosen
    from twinscrew.runtime.perception.settings import PerceptionSettings
    from twinscrew.runtime.perception.surface import Surface


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
        typer.Option(
            help="The sensor's height, about, over the water or the ground, which is dropped.",
            min=0,
            max=100,
        ),
    ] = None,
    ground_m: Annotated[
        float,
        typer.Option(
            help="With --height-m: lower echoes are dropped; on land 0.3 is better.", min=0, max=100
        ),
    ] = 0.1,
    max_range_m: Annotated[float, typer.Option(help="Farther echoes are not used.")] = 20.0,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
    plot: Annotated[Path | None, typer.Option(help="Draw a picture into this file.")] = None,
) -> None:
    """Segment one point cloud file and print its objects."""
    from twinscrew.runtime.messages.types import PointCloud
    from twinscrew.runtime.perception.files import read_cloud
    from twinscrew.runtime.perception.foreign import LEVEL, choose, objects_S
    from twinscrew.runtime.perception.sensor import load_sensor
    from twinscrew.runtime.perception.surface import find_surface

    described = load_sensor(sensor)
    points, ring = read_cloud(file)
    with np.errstate(invalid="ignore"):  # signalling NaNs
        points_S = points * np.array([1, -1, -1], np.float32)
    cloud = PointCloud(stamp_ns=0, frame_id=str(file), points_S=points_S)
    surface = None if height_m is None else find_surface(cloud.points_S, height_m)
    height_m = height_m if surface is None else surface.height_m
    attitude = LEVEL if surface is None else surface.q_NS
    chosen = choose(cloud, ring, described, _settings(height_m, ground_m, max_range_m))
    chosen.perception.step(cloud, attitude)  # the first scan also pays for touching the memory
    begin = time.perf_counter()
    chosen.perception.step(cloud, attitude)
    time_ms = 1e3 * (time.perf_counter() - begin)
    objects = objects_S(chosen.perception, cloud, attitude)
    result = _as_dict(chosen, objects, time_ms, _notes(chosen, cloud, sensor))
    result["surface"] = _surface(surface)
    if plot is not None:
        from twinscrew.runtime.perception.picture import draw

        draw(chosen.perception, cloud, objects, plot)
    if as_json:
        print(json.dumps(result))
    else:
        _print(Console(), result)


def _surface(surface: Surface | None) -> dict[str, float] | None:
    """Tell what the surface was found to be, if it was looked for and found."""
    if surface is None:
        return None
    return {
        "height_m": round(surface.height_m, 3),
        "tilt_deg": round(float(np.degrees(surface.tilt_rad)), 2),
    }


def _settings(height_m: float | None, ground_m: float, max_range_m: float) -> PerceptionSettings:
    """Give settings for a vessel that is the sensor itself: no hull, and no water unless asked."""
    from twinscrew.runtime.perception.settings import PerceptionSettings
    from twinscrew.runtime.settings import convert

    values: dict[str, Any] = {"max_range_m": max_range_m, "hull": None, "water": None}
    if height_m is not None:
        values["water"] = {"surface_m": -height_m, "clearance_m": ground_m}
    return convert(values, PerceptionSettings, file="command line")


def _as_dict(chosen: Chosen, objects: Objects, time_ms: float, notes: list[str]) -> dict[str, Any]:
    report = chosen.perception.report
    rows, columns = chosen.perception.sensor.image_shape
    return {
        "objects": [
            {
                "x_m": round(float(p[0]), 3),
                "y_m": round(-float(p[1]), 3),  # the file's y is to the left
                "radius_m": round(float(radius), 3),
                "points": int(count),
            }
            for p, radius, count in zip(objects.p_B, objects.radius, objects.points, strict=True)
        ],
        "points": report.points,
        "used_points": report.used,
        "time_ms": round(time_ms, 4),
        "left_out": {
            name: getattr(report, name) for name in ("empty", "range", "no_beam", "water", "hidden")
        },
        "image": {
            "rows": rows,
            "columns": columns,
            "from": "sensor" if chosen.fits else "points",
        },
        "notes": notes,
    }


def _notes(chosen: Chosen, cloud: PointCloud, sensor: str) -> list[str]:
    """Tell what the user may want to change."""
    from twinscrew.runtime.perception.foreign import KEPT, ground_below

    perception, notes = chosen.perception, []
    if chosen.kept < KEPT:
        rows, columns = perception.sensor.image_shape
        notes.append(
            f"{sensor} has cells for only {chosen.kept:.0%} of the points in range: is this scan "
            "from that sensor?"
            + ("" if chosen.fits else f" The image ({rows} x {columns}) is derived from the points")
        )
    image = perception.point_image()
    ground = ground_below(cloud.points_S[image[image >= 0]])
    if perception.settings.water is None and ground is not None:
        notes.append(
            f"much lies {ground:.2f} m below the sensor: if that is the ground or the water, drop "
            f"it with --height-m {ground:.2f}, on land also --ground-m 0.3"
        )
    return notes


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
    if result["surface"] is not None:
        told = result["surface"]
        console.print(f"surface {told['height_m']} m below, tilted by {told['tilt_deg']} degrees")
    for note in result["notes"]:
        console.print(note, style="yellow")
