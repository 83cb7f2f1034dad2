"""What ground stations are shown: obstacles, other vessels, texts and figures."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator

import numpy as np
from numpy.typing import NDArray
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from twinscrew.runtime.datum import EARTH_RADIUS_M, Datum, to_degrees
from twinscrew.runtime.mavlink import Message
from twinscrew.runtime.messages.types import Float64, Tracks

# -- What a ground station is shown beside the boat: obstacles around it, and how quick we are.
#
# OBSTACLE_DISTANCE is seen by Mission Planner and QGroundControl, and by ArduPilot's own avoidance;
# NAMED_VALUE_FLOAT by every station that draws values.


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


# -- Vessels that are seen but have no AIS, shown to ground stations as if they had: AIS_VESSEL.
#
# Mission Planner and MAVProxy draw them on the map; ArduPilot hands the messages on.

MMSI_BASE = 100_000_000
"""[-] Nine digits that begin with 100, which are nobody's: ships have 2 to 7 there, coast stations
00, groups 0, aircraft 111, handhelds 8, beacons and buoys 9 (ITU-R M.585)."""
MMSI_SYSTEM, MMSI_TRACKS = 1000, 1000
"""[-] Then come three digits of our system id, and three of the track's id."""
STALE_S = 2.0
"""[s] A track that was not seen for so long is told no more."""
_KNOWN = (
    mavlink.AIS_FLAGS_VALID_COG
    | mavlink.AIS_FLAGS_VALID_VELOCITY
    | mavlink.AIS_FLAGS_VALID_DIMENSIONS
    | mavlink.AIS_FLAGS_VALID_NAME
    | mavlink.AIS_FLAGS_POSITION_ACCURACY  # better than 10 m
)
_LARGEST_M = 255
_FASTEST_CMPS = 65_535


def mmsi(system_id: int, track_id: int) -> int:
    """Give a track's number: 100, our system id, the track's id, three digits each.

    A thousand tracks later a number comes back; ids are never used twice in a run.
    """
    return MMSI_BASE + system_id * MMSI_SYSTEM + track_id % MMSI_TRACKS


def ais_vessels(
    tracks: Tracks, datum: Datum, system_id: int, least_speed_mps: float
) -> Iterator[Message]:
    """Give AIS_VESSEL for each track that moves as a vessel does.

    Parameters
    ----------
    tracks
        What is believed to be around.
    datum
        Where the origin of N lies on the earth.
    least_speed_mps
        [m/s] Slower tracks are buoys, quays, or vessels that cannot be told from them.

    Yields
    ------
    Message
        One a vessel; a track whose place is none on earth, or whose numbers are not finite, is left
        out: the message cannot say it.
    """
    speed = np.hypot(tracks.v_N[:, 0], tracks.v_N[:, 1])
    for k in np.flatnonzero((speed >= least_speed_mps) & (tracks.age_s <= STALE_S)).tolist():
        north, east = tracks.v_N[k].tolist()
        if not _can_be_said(tracks, k):
            continue
        course_cdeg = round(100.0 * math.degrees(math.atan2(east, north))) % 36_000
        latitude_deg, longitude_deg = to_degrees(datum, tracks.p_N[k])
        if abs(latitude_deg) > 90.0:
            continue
        radius_m = math.ceil(min(_LARGEST_M, tracks.radius[k]))
        yield mavlink.MAVLink_ais_vessel_message(
            mmsi(system_id, int(tracks.id[k])),
            round(latitude_deg * 1e7),
            round(longitude_deg * 1e7),
            course_cdeg,
            course_cdeg,  # its heading is not seen; it is drawn along its course
            min(_FASTEST_CMPS, round(100.0 * float(speed[k]))),
            0,
            mavlink.AIS_NAV_STATUS_UNKNOWN,
            mavlink.AIS_TYPE_UNKNOWN,
            radius_m,
            radius_m,
            radius_m,
            radius_m,
            b"",
            f"track {int(tracks.id[k])}".encode("ascii"),
            round(float(tracks.age_s[k])),
            _KNOWN,
        )


def _can_be_said(tracks: Tracks, k: int) -> bool:
    numbers = (*tracks.v_N[k], tracks.radius[k])
    on_earth = math.hypot(*tracks.p_N[k]) <= math.pi * EARTH_RADIUS_M  # half-way round it
    return on_earth and all(math.isfinite(number) for number in numbers)
