"""What a ground station is shown beside the boat: obstacles around it, and how quick we are.

OBSTACLE_DISTANCE is seen by Mission Planner and QGroundControl, and by ArduPilot's own avoidance;
NAMED_VALUE_FLOAT by every station that draws values.
"""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from twinscrew.runtime.link.wire import Message
from twinscrew.runtime.messages.types import Float64

SECTORS = 72
"""[-] What the message holds: a whole turn in sectors of 5 degrees, the first one ahead."""
SECTOR_RAD = 2.0 * math.pi / SECTORS
GREATEST_M = 655.0
"""[m] What 16 bits of centimetres can say."""
_NAME_LENGTH = 10


def sector_distances_cm(p_L: Float64, radius: Float64, range_m: float) -> NDArray[np.uint16]:
    """Give the distance to the nearest surface in each sector.

    Parameters
    ----------
    p_L : (K, 2) float64
        Circles' centres [m]: forward, starboard.
    radius : (K,) float64
        Their radii [m].
    range_m
        [m] How far we see.

    Returns
    -------
    distances : (72,) uint16
        [cm] Clockwise from ahead; at least 1 (0 is ignored by ArduPilot), and `range_m` + 1 cm
        where nothing is.
    """
    free_cm = round(100.0 * min(range_m, GREATEST_M)) + 1
    if not len(radius):
        return np.full(SECTORS, free_cm, dtype=np.uint16)
    distance = np.hypot(p_L[:, 0], p_L[:, 1])[:, None]
    bearing = np.arctan2(p_L[:, 1], p_L[:, 0])[:, None]
    middle = SECTOR_RAD * np.arange(SECTORS)
    off = np.abs((bearing - middle + math.pi) % (2.0 * math.pi) - math.pi)
    off = np.maximum(0.0, off - SECTOR_RAD / 2.0)  # from the sector's nearer edge
    # a ray at an angle to the centre meets the circle at d cos - sqrt(r^2 - (d sin)^2)
    chord = radius[:, None] ** 2 - (distance * np.sin(off)) ** 2
    reach = distance * np.cos(off) - np.sqrt(np.maximum(0.0, chord))
    seen = (chord >= 0.0) & (off < math.pi / 2.0)
    inside = distance <= radius[:, None]
    surface_m = np.where(inside, 0.0, np.where(seen, reach, np.inf)).min(axis=0)
    surface_cm = np.minimum(100.0 * surface_m, free_cm)
    distances: NDArray[np.uint16] = np.clip(np.floor(surface_cm), 1, free_cm).astype(np.uint16)
    return distances


def obstacle_distance(distances_cm: Iterable[int], range_m: float, time_s: float) -> Message:
    """Make OBSTACLE_DISTANCE of `sector_distances_cm`."""
    return mavlink.MAVLink_obstacle_distance_message(
        round(time_s * 1e6),
        mavlink.MAV_DISTANCE_SENSOR_LASER,
        [int(distance) for distance in distances_cm],
        round(360.0 / SECTORS),  # [deg]; the exact one below replaces it
        1,
        round(100.0 * min(range_m, GREATEST_M)),
        360.0 / SECTORS,
        0.0,
        mavlink.MAV_FRAME_BODY_FRD,
    )


def named_value(name: str, value: float, time_s: float) -> Message:
    """Make NAMED_VALUE_FLOAT; names have up to 10 letters."""
    boot_ms = round(time_s * 1000.0) & 0xFFFFFFFF
    return mavlink.MAVLink_named_value_float_message(
        boot_ms, name.encode("ascii")[:_NAME_LENGTH], value
    )
