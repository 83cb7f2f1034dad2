"""Fences of ArduPilot: items of a MAVLink mission of type FENCE become features of a map.

https://mavlink.io/en/services/mission.html#fences. Corners of a polygon follow each other, each
with their number in param 1; a circle has its radius there. A boat has to be inside of every
inclusion fence and outside of every exclusion fence, as ArduPilot has it without its option of
united inclusion fences. A return point means nothing here.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from twinscrew.runtime.charts.static_map import Area, Disc, Feature, StaticMap
from twinscrew.runtime.errors import ConfigError
from twinscrew.runtime.ground.orders import Fault, GoalFrames
from twinscrew.runtime.messages.types import Float64

FENCE: Final = int(mavlink.MAV_MISSION_TYPE_FENCE)
POLYGONS: Final = {
    int(mavlink.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_INCLUSION): True,
    int(mavlink.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_EXCLUSION): False,
}
"""Whether a corner belongs to an inclusion fence."""
CIRCLES: Final = {
    int(mavlink.MAV_CMD_NAV_FENCE_CIRCLE_INCLUSION): True,
    int(mavlink.MAV_CMD_NAV_FENCE_CIRCLE_EXCLUSION): False,
}
"""Whether a circle is an inclusion fence."""
RETURN_POINT: Final = int(mavlink.MAV_CMD_NAV_FENCE_RETURN_POINT)
LARGEST_M: Final = 100_000.0
"""[m] Of a circle's radius."""


class FenceItem(NamedTuple):
    """What an item says."""

    command: int
    size: float
    """[-] Corners of its polygon, or [m] its circle's radius."""
    place: Float64
    """[m] [N] (2,)"""


class Misfit(NamedTuple):
    """Which item makes fences unusable, and why."""

    seq: int
    fault: Fault


def read_item(command: int, frame: int, param1: float, x: int, y: int,
              frames: GoalFrames) -> FenceItem | Fault:  # fmt: skip
    """Read one item.

    Parameters
    ----------
    command, frame, param1, x, y
        As MISSION_ITEM_INT has them.
    frames
        Where its places lie.
    """
    if command not in (*POLYGONS, *CIRCLES, RETURN_POINT):
        return Fault(mavlink.MAV_MISSION_UNSUPPORTED, "only MAV_CMD_NAV_FENCE_... make a fence")
    if command == RETURN_POINT:
        return FenceItem(command, param1, np.zeros(2))  # its place means nothing
    place = frames.position_of_integers(frame, x, y)
    if isinstance(place, Fault):
        return place
    invalid = int(mavlink.MAV_MISSION_INVALID_PARAM1)
    if command in POLYGONS and not (3.0 <= param1 <= 10_000.0 and param1 == int(param1)):
        return Fault(invalid, f"a polygon of {param1:g} corners (param 1); at least 3")
    if command in CIRCLES and not 0.0 < param1 <= LARGEST_M:
        return Fault(invalid, f"a radius of {param1:g} m (param 1); above 0, at most {LARGEST_M:g}")
    return FenceItem(command, param1, place)


def features_of(items: Sequence[FenceItem]) -> tuple[Feature, ...] | Misfit:
    """Give the fences that items describe, numbered from 1 in their names."""
    features: list[Feature] = []
    seq = 0
    while seq < len(items):
        command, size, place = items[seq]
        name = f"fence {len(features) + 1}"
        if command in POLYGONS:
            corners = items[seq : seq + int(size)]
            if len(corners) < size or {(one.command, one.size) for one in corners} != {
                (command, size)
            }:
                words = f"its polygon needs {size:g} corners in a row, all alike"
                return Misfit(seq, Fault(mavlink.MAV_MISSION_INVALID_PARAM1, words))
            outline = np.array([corner.place for corner in corners])
            area = Area(kind="fence", outline=outline, keep_in=POLYGONS[command], name=name)
            try:
                StaticMap.of([area])
            except ConfigError as error:
                return Misfit(seq, Fault(mavlink.MAV_MISSION_DENIED, str(error)))
            features.append(area)
            seq += int(size)
            continue
        if command in CIRCLES:
            north, east = place.tolist()
            features.append(
                Disc(
                    kind="fence",
                    centre=(north, east),
                    radius_m=size,
                    keep_in=CIRCLES[command],
                    name=name,
                )
            )
        seq += 1
    return tuple(features)
