"""What of a sensor decides how much of a hull it shows: its lowest beam, the gap between rows."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from twinscrew.runtime.messages.types import Float64
from twinscrew.runtime.perception.sensor import Sensor

ABOUT_RAD = (-0.25, 0.05)
"""[rad] Elevations under which other vessels are seen, from 6 m on."""


@dataclass(frozen=True, slots=True)
class View:
    """How a sensor looks at what floats; by default as the one of docs/tracking.md's table."""

    height_m: float = 1.93
    """[m] Over the vessel's origin."""
    lowest_rad: float = 0.186
    """[rad] How far the lowest beam looks down."""
    row_rad: float = 0.0234
    """[rad] Between two rows, there where vessels are."""

    @classmethod
    def of(cls, sensor: Sensor) -> View:
        """Take it from a description."""
        elevations = sensor.elevations
        height = cls().height_m if sensor.mount is None else sensor.mount.z_m
        return cls(height, max(-float(elevations[0]), 1e-3), _usual_step(elevations))

    @property
    def near_scale(self) -> float:
        """[-] How much farther than the default's its lowest beam comes down to some height."""
        usual = View()
        reach = self.height_m / math.tan(self.lowest_rad)
        return max(reach, 0.0) * math.tan(usual.lowest_rad) / usual.height_m

    def row_gap(self, distance: Float64) -> Float64:
        """[m] Give how far apart rows are on an upright side at distances (K,) [m]."""
        gap: Float64 = self.row_rad * distance
        return gap


def _usual_step(elevations: Float64) -> float:
    """[rad] Give the mean gap between rows that see vessels; of all rows, if few do."""
    low, high = ABOUT_RAD
    seen = elevations[(elevations >= low) & (elevations <= high)]
    return float(np.diff(seen if len(seen) >= 3 else elevations).mean())
