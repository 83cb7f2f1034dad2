"""What things look like to a LiDAR: boxes, cylinders, and land (config/shapes, config/vessels)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from twinscrew.runtime.errors import ConfigError
from twinscrew.runtime.geometry import quaternion_from_euler, rotation_from_quaternion
from twinscrew.runtime.messages.types import Float64
from twinscrew.runtime.settings import Settings, load, shipped
from twinscrew.runtime.vessel_description import BoxPart, CylinderPart, VesselDescription

BOX, CYLINDER = 0, 1
MIRROR = np.array([1.0, -1.0, 1.0])


class ShapeFile(Settings, frozen=True, kw_only=True):
    """A shape as people write it."""

    box: tuple[BoxPart, ...] = ()
    cylinder: tuple[CylinderPart, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class Shape:
    """A body's solids, in its own frame B (FRD)."""

    kinds: NDArray[np.int32]
    """(P,) `BOX` or `CYLINDER`."""
    centres: Float64
    """[m] [B] (P, 3)"""
    rotations: Float64
    """(P, 3, 3) R_BP: a solid's own axes in B; a cylinder lies along its x."""
    halves: Float64
    """[m] (P, 3) Half lengths along a solid's own axes; cylinder: half length, radius, radius."""
    plates: tuple[tuple[float, Float64], ...] = ()
    """[m] [B] Level polygons seen from above: how far down, and corners (M, 2)."""


Solid = tuple[int, Float64, Float64, Float64]


def load_shape(name: str | Path) -> Shape:
    """Read a shape: the name of a shipped one, as "light_buoy", or the path of a file."""
    path = shipped("shapes", name)
    return make_shape(load(path, ShapeFile), file=path)


def vessel_shape(vessel: VesselDescription) -> Shape:
    """Give what a vessel looks like."""
    return make_shape(ShapeFile(box=vessel.boxes, cylinder=vessel.cylinders))


def make_shape(parts: ShapeFile, *, file: Path | None = None) -> Shape:
    """Turn a shape as people write it into arrays.

    Raises
    ------
    ConfigError
        It has no parts, or an axis of length zero.
    """
    solids = [solid for part in parts.box for solid in _sides(part, _box(part))]
    for part in parts.cylinder:
        if not any(part.axis):
            raise ConfigError("must not be the zero vector", file=file, key=f"{part.name}.axis")
        solids += _sides(part, _cylinder(part))
    if not solids:
        raise ConfigError("a shape needs at least one box or cylinder", file=file)
    kinds, centres, rotations, halves = zip(*solids, strict=True)
    return Shape(
        kinds=np.array(kinds, dtype=np.int32),
        centres=np.array(centres),
        rotations=np.array(rotations),
        halves=np.array(halves),
    )


def boxes_shape(centres: Float64, sizes: Float64, yaws: Float64) -> Shape:
    """Give fixed boxes, as quays, as one shape.

    Parameters
    ----------
    centres : (Q, 3) float64
        Centres [m].
    sizes : (Q, 3) float64
        Whole lengths [m] along their own axes.
    yaws : (Q,) float64
        Turned clockwise as seen from above [rad].
    """
    turns = [rotation_from_quaternion(quaternion_from_euler(0.0, 0.0, float(yaw))) for yaw in yaws]
    return Shape(
        kinds=np.full(len(centres), BOX, dtype=np.int32),
        centres=np.array(centres, dtype=np.float64),
        rotations=np.array(turns).reshape(-1, 3, 3),
        halves=np.array(sizes, dtype=np.float64) / 2,
    )


def posts_shape(posts: Float64, depth_m: float) -> Shape:
    """Give upright cylinders, (P, 4) [m]: x, y, radius, height; they reach `depth_m` down."""
    upright = _frame_along(np.array([0.0, 0.0, 1.0]))
    x, y, radius, height = posts.T
    return Shape(
        kinds=np.full(len(posts), CYLINDER, dtype=np.int32),
        centres=np.column_stack([x, y, (depth_m - height) / 2]),
        rotations=np.tile(upright, (len(posts), 1, 1)),
        halves=np.column_stack([(depth_m + height) / 2, radius, radius]),
    )


def walls_shape(outline: Float64, height_m: float, depth_m: float) -> Shape:
    """Give land: a wall, a box of no thickness, along each edge of a polygon, and a plate on top.

    Parameters
    ----------
    outline : (M, 2) float64
        Its corners [m], x and y.
    height_m, depth_m
        How far the walls reach up and down.
    """
    ends = np.roll(outline, -1, axis=0)
    along, count = ends - outline, len(outline)
    walls = boxes_shape(
        np.column_stack([(outline + ends) / 2, np.full(count, (depth_m - height_m) / 2)]),
        np.column_stack([np.hypot(*along.T), np.zeros(count), np.full(count, depth_m + height_m)]),
        np.arctan2(along[:, 1], along[:, 0]),
    )
    return replace(walls, plates=((-height_m, np.ascontiguousarray(outline)),))


def joined(shapes: Sequence[Shape]) -> Shape:
    """Give one shape of several."""
    return Shape(
        kinds=np.concatenate([shape.kinds for shape in shapes]),
        centres=np.concatenate([shape.centres for shape in shapes]),
        rotations=np.concatenate([shape.rotations for shape in shapes]),
        halves=np.concatenate([shape.halves for shape in shapes]),
        plates=tuple(plate for shape in shapes for plate in shape.plates),
    )


def _box(part: BoxPart) -> Solid:
    rotation = rotation_from_quaternion(quaternion_from_euler(*part.rpy_rad))
    return BOX, np.array(part.centre_m), rotation, np.array(part.size_m) / 2


def _cylinder(part: CylinderPart) -> Solid:
    half = np.array([part.length_m / 2, part.radius_m, part.radius_m])
    return CYLINDER, np.array(part.centre_m), _frame_along(np.array(part.axis)), half


def _frame_along(axis: Float64) -> Float64:
    """Give a rotation whose x axis, its first column, points along `axis`."""
    x = axis / np.linalg.norm(axis)
    y = np.cross(x, np.eye(3)[np.argmin(np.abs(x))])
    y /= np.linalg.norm(y)
    return np.stack([x, y, np.cross(x, y)], axis=1)


def _sides(part: BoxPart | CylinderPart, solid: Solid) -> Iterator[Solid]:
    """Give the solid, and its mirror image if the part has one.

    With F the reflection of y, the mirrored axes are F R; F R F is a rotation again, and differs
    only by the sign of the solid's own y, under which a box and a cylinder do not change.
    """
    yield solid
    if part.mirrored:
        kind, centre, rotation, half = solid
        yield kind, MIRROR * centre, MIRROR[:, None] * rotation * MIRROR, half
