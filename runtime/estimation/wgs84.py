"""Places on the earth (WGS 84) to positions in a local frame and back, exactly.

The local frame N is the tangent plane at its origin: north, east, down. Both ways go through the
earth-centred, earth-fixed frame E. Source: NIMA TR8350.2 (2000), chapter 4.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from twinscrew.runtime.messages.types import Float64

SEMI_MAJOR_M = 6_378_137.0
"""[m] WGS 84's a."""
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
    altitude_m = ring_m * cos + z * sin - SEMI_MAJOR_M * math.sqrt(1.0 - _E2 * sin * sin)
    return Place(
        latitude_deg=math.degrees(latitude),
        longitude_deg=math.degrees(math.atan2(y, x)),
        altitude_m=altitude_m,
    )


def _prime_vertical_m(latitude: float) -> float:
    """[m] Radius of curvature in the prime vertical at a latitude [rad]. TR8350.2, eq. 4-15."""
    return SEMI_MAJOR_M / math.sqrt(1.0 - _E2 * math.sin(latitude) ** 2)


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
