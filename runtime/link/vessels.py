"""Vessels that are seen but have no AIS, shown to ground stations as if they had: AIS_VESSEL.

Mission Planner and MAVProxy draw them on the map; ArduPilot hands the messages on.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from twinscrew.runtime.link.datum import EARTH_RADIUS_M, Datum, to_degrees
from twinscrew.runtime.link.wire import Message
from twinscrew.runtime.messages.types import Tracks

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
