"""Scenarios: who starts where and wants to go where, and what can be asked for.

Positions are complex numbers, north + i east [m].
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Annotated, NamedTuple

import numpy as np
from msgspec import Meta
from numpy.typing import NDArray

from twinscrew.runtime.errors import ConfigError
from twinscrew.runtime.settings import Count, NonNegative, Positive, Settings

Points = NDArray[np.complex128]
Mask = NDArray[np.bool_]


class ScenarioSettings(Settings, frozen=True):
    """How crowded an episode is: one row of the paper's schedule (table I)."""

    robots: Count = 3
    """[-] Vessels."""
    buoys: Annotated[int, Meta(ge=0, le=50)] = 0
    """[-] Static obstacles. Of very many, no layout is found in any bearable time."""
    min_distance_m: NonNegative = 30.0
    """[m] At least this far from each start to its goal."""
    weight: NonNegative = 1.0
    """[-] How often this row is drawn, relative to the others of a mixture."""


class MapSettings(Settings, frozen=True):
    """The water (the authors' code)."""

    size_m: Positive = 55.0
    """[m] The map is a square."""
    margin_m: NonNegative = 2.0
    """[m] Starts and goals keep this far from its edge."""
    clearance_m: NonNegative = 10.0
    """[m] Between any two starts, and between any two goals."""
    goals_on_starts: bool = True
    """Whether a start may lie on another vessel's goal; False keeps the clearance there too."""
    buoy_margin_m: NonNegative = 5.0
    """[m] Buoys' centres keep this far from the map's edge."""
    buoy_clearance_m: NonNegative = 10.0
    """[m] From a buoy's edge to any start or goal."""
    buoy_radius_m: Positive = 1.0
    """[m] VRX's light buoys have 0.75."""

    @property
    def side_m(self) -> float:
        """[m] Of the square in which starts and goals lie."""
        return self.size_m - 2 * self.margin_m


class Scenarios(NamedTuple):
    """N episodes with room for V vessels and M buoys each."""

    start: Points
    """(N, V) [m]."""
    goal: Points
    """(N, V) [m]."""
    heading: NDArray[np.float64]
    """(N, V) [rad]."""
    vessel: Mask
    """(N, V) Whether there is such a vessel."""
    buoy: Points
    """(N, M) [m]."""
    buoy_there: Mask
    """(N, M) Whether there is such a buoy."""


def check(rows: Sequence[ScenarioSettings], area: MapSettings) -> None:
    """Refuse what can never be placed; raise `ConfigError` saying what is allowed."""
    if not rows or sum(row.weight for row in rows) <= 0.0:
        raise ConfigError("at least one scenario must have a positive weight", key="scenarios")
    if area.side_m <= 0.0 or area.size_m <= 2 * area.buoy_margin_m:
        raise ConfigError(f"the margins leave nothing of {area.size_m} m", key="map.size_m")
    diagonal = math.sqrt(2.0) * area.side_m
    # Discs of the clearance's diameter cannot be packed denser than pi / sqrt(12) (Thue).
    room = (area.side_m + area.clearance_m) ** 2 * math.pi / math.sqrt(12.0)
    each = math.pi * (area.clearance_m / 2) ** 2
    most = int(room / each) if each > 0.0 else None
    for row in rows:
        if row.min_distance_m > diagonal:
            raise ConfigError(
                f"{row.min_distance_m} m does not fit the map; allowed: up to {diagonal:.1f} m",
                key="min_distance_m",
            )
        if most is not None and row.robots > most:
            raise ConfigError(
                f"{row.robots} vessels {area.clearance_m} m apart do not fit a map of "
                f"{area.size_m} m; allowed: fewer than {most + 1}",
                key="robots",
            )
