"""Fixes as positions in the local frame."""

from __future__ import annotations

import math

from twinscrew.runtime.estimation.sensors import Carriage
from twinscrew.runtime.estimation.wgs84 import LocalFrame, Place
from twinscrew.runtime.link.datum import Datum
from twinscrew.runtime.messages.types import Fix, Float64


class Chart:
    """The local frame: its origin is the datum, or where the first fix was."""

    def __init__(self, datum: Datum | None, carriage: Carriage) -> None:
        self._datum = datum
        self._carriage = carriage
        self.frame: LocalFrame | None = None
        """None before the first fix."""

    def located(self, fix: Fix) -> tuple[Float64, Float64]:
        """Give the antenna's position, (3,) [m], and its covariance; without altitude at 0."""
        frame = self.frame = self.frame or self._first(fix)
        told = math.isfinite(fix.altitude_m)
        place = Place(
            latitude_deg=fix.latitude_deg,
            longitude_deg=fix.longitude_deg,
            altitude_m=fix.altitude_m if told else frame.origin.altitude_m,
        )
        return frame.position_N(place), self._carriage.position_R(fix)

    def _first(self, fix: Fix) -> LocalFrame:
        """Down counts from where the vessel floats now."""
        altitude_m = fix.altitude_m if math.isfinite(fix.altitude_m) else 0.0
        latitude, longitude = fix.latitude_deg, fix.longitude_deg
        if self._datum is not None:
            latitude, longitude = self._datum.latitude_deg, self._datum.longitude_deg
        return LocalFrame(
            Place(
                latitude_deg=latitude,
                longitude_deg=longitude,
                altitude_m=altitude_m + float(self._carriage.antenna_B[2]),
            )
        )
