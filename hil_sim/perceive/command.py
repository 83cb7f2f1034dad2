"""`twinscrew perceive`: what perception makes of a point cloud file from elsewhere."""

from __future__ import annotations

import json
import time
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import numpy as np
import typer
from msgspec import structs
from rich.console import Console
from rich.table import Table

from twinscrew.hil_sim.perceive.files import read_cloud
from twinscrew.hil_sim.perceive.foreign import (
    HERE,
    KEPT,
    Chosen,
    Surface,
    attitude_of_vessel,
    choose,
    find_surface,
    ground_below,
    objects_S,
)
from twinscrew.runtime.messages.types import Objects, PointCloud
from twinscrew.runtime.perception.segmentation import HullSettings, PerceptionSettings
from twinscrew.runtime.perception.sensor import Mount, Sensor, load_sensor
from twinscrew.runtime.settings import convert
from twinscrew.runtime.vessel.config import load_config, sensor_of


def perceive(
    file: Annotated[
        Path,
        typer.Argument(help="A cloud: .bin (KITTI, nuScenes), .pcd or .npy; x forward, y left."),
    ],
    sensor: Annotated[
        str | None,
        typer.Option(
            help="vrx16, vrx32, vlp16, hdl32e, os1_64, or the path of a description. Needed unless "
            "--config names it."
        ),
    ] = None,
    config: Annotated[
        Path | None,
        typer.Option(
            help="The configuration of the boat that took the scan, as `run` reads it: its sensor, "
            "where it sits, its hull, which is masked, and --height-m follow from it."
        ),
    ] = None,
    hull_m: Annotated[
        tuple[float, float, float] | None,
        typer.Option(
            metavar="AFT FORE HALF_WIDTH",
            help="Echoes from the own hull are dropped: from AFT (negative) to FORE of the sensor, "
            "and HALF_WIDTH to either side.",
        ),
    ] = None,
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
            help="With a height: lower echoes are dropped; on land 0.3 is better.", min=0, max=100
        ),
    ] = 0.1,
    max_range_m: Annotated[float, typer.Option(help="Farther echoes are not used.")] = 60.0,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
    plot: Annotated[Path | None, typer.Option(help="Draw a picture into this file.")] = None,
) -> None:
    """Segment one point cloud file and print its objects."""
    boat = _boat(sensor, config, hull_m)
    height_m = boat.height_m if height_m is None else height_m
    points, ring = read_cloud(file)
    with np.errstate(invalid="ignore"):  # signalling NaNs
        points_S = points * np.array([1, -1, -1], np.float32)
    cloud = PointCloud(stamp_ns=0, frame_id=str(file), points_S=points_S)
    surface = None if height_m is None else find_surface(cloud.points_S, height_m)
    height_m = height_m if surface is None else surface.height_m
    q_NS = None if surface is None else surface.q_NS
    settings = _settings(boat, height_m, ground_m, max_range_m)
    chosen = choose(cloud, ring, boat.sensor, settings, boat.mount)
    q_NB = attitude_of_vessel(chosen.perception.sensor, q_NS)
    chosen.perception.step(cloud, q_NB)  # the first scan also pays for touching the memory
    begin = time.perf_counter()
    chosen.perception.step(cloud, q_NB)
    time_ms = 1e3 * (time.perf_counter() - begin)
    objects = objects_S(chosen.perception, cloud, q_NS)
    result = _as_dict(chosen, objects, time_ms, _notes(chosen, cloud, boat.sensor.name))
    result["surface"] = _surface(surface)
    if plot is not None:
        from twinscrew.hil_sim.perceive.picture import draw

        draw(chosen.perception, cloud, objects, plot)
    if as_json:
        print(json.dumps(result))
    else:
        _print(Console(), result)


class Boat(NamedTuple):
    """What took the scan."""

    sensor: Sensor
    mount: Mount
    hull: HullSettings | None
    """Echoes from it are dropped; from the vessel's origin."""
    height_m: float | None
    """[m] The sensor's over the water at rest; None if not known."""


def _boat(
    sensor: str | None, config: Path | None, hull_m: tuple[float, float, float] | None
) -> Boat:
    """Give the sensor and its vessel; without a configuration the vessel is the sensor itself."""
    if hull_m is not None:
        names = ("aft_m", "fore_m", "half_width_m")
        hull = convert(
            dict(zip(names, hull_m, strict=True)), HullSettings, file="command line: --hull-m"
        )
    if config is None:
        if sensor is None:
            raise typer.BadParameter("give --sensor, or --config", param_hint="--sensor")
        return Boat(load_sensor(sensor), HERE, None if hull_m is None else hull, None)
    told = load_config(config)
    mounted = sensor_of(told)
    mount, water = mounted.mount or HERE, told.perception.water
    if hull_m is not None:  # it counts from the sensor
        hull = structs.replace(hull, aft_m=hull.aft_m + mount.x_m, fore_m=hull.fore_m + mount.x_m)
    return Boat(
        sensor=mounted if sensor is None else load_sensor(sensor),
        mount=mount,
        hull=told.perception.hull if hull_m is None else hull,
        height_m=None if water is None else mount.z_m - water.surface_m,
    )


def _surface(surface: Surface | None) -> dict[str, float] | None:
    """Tell what the surface was found to be, if it was looked for and found."""
    if surface is None:
        return None
    return {
        "height_m": round(surface.height_m, 3),
        "tilt_deg": round(float(np.degrees(surface.tilt_rad)), 2),
    }


def _settings(
    boat: Boat, height_m: float | None, ground_m: float, max_range_m: float
) -> PerceptionSettings:
    """Give settings for the vessel: its hull, and no water unless its height is known."""
    values: dict[str, Any] = {"max_range_m": max_range_m, "hull": None, "water": None}
    if height_m is not None:
        surface_m = boat.mount.z_m - height_m
        values["water"] = {"surface_m": surface_m, "clearance_m": ground_m}
    return structs.replace(convert(values, PerceptionSettings, file="command line"), hull=boat.hull)


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
            for p, radius, count in zip(objects.p_L, objects.radius, objects.points, strict=True)
        ],
        "points": report.points,
        "used_points": report.used,
        "time_ms": round(time_ms, 4),
        "left_out": {
            name: getattr(report, name)
            for name in ("empty", "range", "no_beam", "hull", "water", "hidden")
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
    perception = chosen.perception
    notes = []
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
