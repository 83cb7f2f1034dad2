"""Places on the earth, in a local frame: about a datum on a flat earth, and exactly.

An ArduPilot counts LOCAL_POSITION_NED from where its own filter began, another place at each start.
Goals in a chart's frame, or several boats in one frame, need an origin that stays: the datum.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
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


def positions_N(datum: Datum, degrees: Float64) -> Float64:
    """Give the positions, (K, 2) north and east [m], of places (K, 2): latitude, longitude [deg].

    As `from_datum_N` gives them.
    """
    latitude_deg = degrees[:, 0]
    turned_deg = (degrees[:, 1] - datum.longitude_deg + 180.0) % 360.0 - 180.0
    half_way_rad = np.radians((latitude_deg + datum.latitude_deg) / 2.0)
    north_rad = np.radians(latitude_deg - datum.latitude_deg)
    east_rad = np.radians(turned_deg) * np.cos(half_way_rad)
    return EARTH_RADIUS_M * np.stack([north_rad, east_rad], axis=1)


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


# -- Places on the earth (WGS 84) to positions in a local frame and back, exactly.
#
# The local frame N is the tangent plane at its origin: north, east, down. Both ways go through the
# earth-centred, earth-fixed frame E. Source: NIMA TR8350.2 (2000), chapter 4.

FLATTENING = 1.0 / 298.257_223_563
"""[-] WGS 84's f."""
_E2 = FLATTENING * (2.0 - FLATTENING)
_ITERATIONS = 4
"""[-] Each gains three digits: below a micrometre near the ground."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Place:
    """A place on the earth."""

    latitude_deg: float
    """[deg] North of the equator."""
    longitude_deg: float
    """[deg] East of Greenwich."""
    altitude_m: float = 0.0
    """[m] Above the ellipsoid."""


class LocalFrame:
    """The tangent plane at a place."""

    def __init__(self, origin: Place) -> None:
        self.origin = origin
        self._origin_E = _earth_fixed(origin)
        self._R_NE = _rotation(origin)

    def position_N(self, place: Place) -> Float64:
        """Give a place's position, (3,) [m]."""
        offset: Float64 = self._R_NE @ (_earth_fixed(place) - self._origin_E)
        return offset

    def place(self, position_N: Float64) -> Place:
        """Give the place of a position, (3,) [m]."""
        return _geodetic(self._origin_E + self._R_NE.T @ position_N)


def _earth_fixed(place: Place) -> Float64:
    """Give p_E, (3,) [m]. TR8350.2, eq. 4-14."""
    latitude, longitude = math.radians(place.latitude_deg), math.radians(place.longitude_deg)
    across_m = _prime_vertical_m(latitude)
    ring_m = (across_m + place.altitude_m) * math.cos(latitude)
    return np.array(
        [
            ring_m * math.cos(longitude),
            ring_m * math.sin(longitude),
            (across_m * (1.0 - _E2) + place.altitude_m) * math.sin(latitude),
        ]
    )


def _geodetic(p_E: Float64) -> Place:
    """Give the place of p_E, (3,) [m]: its latitude by fixed-point iteration."""
    x, y, z = p_E.tolist()
    ring_m = math.hypot(x, y)
    latitude = math.atan2(z, ring_m * (1.0 - _E2))
    for _ in range(_ITERATIONS):
        sin = math.sin(latitude)
        latitude = math.atan2(z + _E2 * _prime_vertical_m(latitude) * sin, ring_m)
    sin, cos = math.sin(latitude), math.cos(latitude)
    # Holds at the poles too, where ring / cos does not.
    altitude_m = ring_m * cos + z * sin - EARTH_RADIUS_M * math.sqrt(1.0 - _E2 * sin * sin)
    return Place(
        latitude_deg=math.degrees(latitude),
        longitude_deg=math.degrees(math.atan2(y, x)),
        altitude_m=altitude_m,
    )


def _prime_vertical_m(latitude: float) -> float:
    """[m] Radius of curvature in the prime vertical at a latitude [rad]. TR8350.2, eq. 4-15."""
    return EARTH_RADIUS_M / math.sqrt(1.0 - _E2 * math.sin(latitude) ** 2)


def _rotation(place: Place) -> Float64:
    """Give R_NE, (3, 3), at a place: its rows are north, east and down in E."""
    latitude, longitude = math.radians(place.latitude_deg), math.radians(place.longitude_deg)
    sin_lat, cos_lat = math.sin(latitude), math.cos(latitude)
    sin_lon, cos_lon = math.sin(longitude), math.cos(longitude)
    return np.array(
        [
            [-sin_lat * cos_lon, -sin_lat * sin_lon, cos_lat],
            [-sin_lon, cos_lon, 0.0],
            [-cos_lat * cos_lon, -cos_lat * sin_lon, -sin_lat],
        ]
    )
