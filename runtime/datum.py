"""Where the local frame's origin lies on the earth.

An ArduPilot counts LOCAL_POSITION_NED from where its own filter began, another place at each start.
Goals in a chart's frame, or several boats in one frame, need an origin that stays: the datum.
"""

from __future__ import annotations

import math
from typing import Annotated

import numpy as np
from msgspec import Meta

from twinscrew.runtime.messages.types import Float64
from twinscrew.runtime.settings import Settings

EARTH_RADIUS_M = 6_378_137.0
"""[m] WGS 84's semi-major axis. ArduPilot's flat earth is 6 ppm smaller: 6 mm a kilometre."""


class Datum(Settings, frozen=True):
    """A place on the earth."""

    latitude_deg: Annotated[float, Meta(ge=-89.0, le=89.0)]
    """[deg] North of the equator."""
    longitude_deg: Annotated[float, Meta(ge=-180.0, le=180.0)]
    """[deg] East of Greenwich."""


def from_datum_N(datum: Datum, latitude_deg: float, longitude_deg: float) -> Float64:
    """Give a place's position, (3,) [m], in the frame of a datum, its third component zero.

    Flat earth with the parallel half way between: within a centimetre up to 5 km.
    """
    north_rad = math.radians(latitude_deg - datum.latitude_deg)
    turned_deg = _wrapped(longitude_deg - datum.longitude_deg)
    half_way_rad = math.radians((latitude_deg + datum.latitude_deg) / 2.0)
    east_m = EARTH_RADIUS_M * math.radians(turned_deg) * math.cos(half_way_rad)
    return np.array([EARTH_RADIUS_M * north_rad, east_m, 0.0])


def to_degrees(datum: Datum, p_N: Float64) -> tuple[float, float]:
    """Give latitude and longitude [deg] of a position, north and east [m], in a datum's frame.

    The inverse of `from_datum_N`.
    """
    latitude_deg = datum.latitude_deg + math.degrees(float(p_N[0]) / EARTH_RADIUS_M)
    half_way_rad = math.radians((latitude_deg + datum.latitude_deg) / 2.0)
    turned_deg = math.degrees(float(p_N[1]) / (EARTH_RADIUS_M * math.cos(half_way_rad)))
    return latitude_deg, _wrapped(datum.longitude_deg + turned_deg)


def _wrapped(longitude_deg: float) -> float:
    return (longitude_deg + 180.0) % 360.0 - 180.0
