"""What the LiDAR has learnt around the vessel: walls that stand, free water, and since when.

A square of cells goes along with the vessel. A cell becomes a wall when several scans have shown an
echo in it of a long object that stands, as the tracker judges it (`tracking.lidar_motion`); it is
water again when as many scans have looked through it, by the same free water that the tracker asks.
So a basin that no chart knows is learnt wall by wall, and is remembered when the LiDAR does not see
it any more. What moves, and what is no longer than a vessel, is the tracker's alone.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Annotated

import numpy as np
from msgspec import Meta

from twinscrew.runtime._native import FreeWater
from twinscrew.runtime._native import LearntMap as Kernel
from twinscrew.runtime.messages.types import NANOSECONDS_PER_SECOND, Float64, Odometry, Outline
from twinscrew.runtime.settings import Count, NonNegative, Positive, Settings


class LearntSettings(Settings, frozen=True, kw_only=True):
    """What is taken for a wall, and for how long."""

    enabled: bool = True
    """Whether walls are learnt."""
    cell_m: Positive = 0.5
    """[m] Side of a cell. A wall lies where its echoes in a cell are on average, not in the middle
    of the cell."""
    cells: Annotated[int, Meta(ge=8, le=4096)] = 256
    """[-] Along a side of the square: 128 m with these cells, in 3 MB."""
    certain: Count = 3
    """[-] So many scans must have shown an echo."""
    most: Count = 10
    """[-] So many scans must show water in the place of a wall that was seen for long."""
    margin_m: NonNegative = 0.5
    """[m] How deep in free water a wall must lie to be gone, and"""
    height_m: NonNegative = 0.2
    """[m] how far below its top a beam must have passed: as the tracker asks."""
    keep_s: Positive = 900.0
    """[s] What has not been seen for longer is forgotten."""

    def __post_init__(self) -> None:
        """Refuse what no wall could become."""
        if self.most < self.certain:
            raise ValueError("most must be at least certain")


class LearntMap:
    """Walls and free water around one vessel: what leaves the square is forgotten."""

    def __init__(self, settings: LearntSettings | None = None) -> None:
        self.settings = settings = settings or LearntSettings()
        self._kernel = Kernel(
            cell=settings.cell_m,
            size=settings.cells,
            certain=settings.certain,
            most=settings.most,
            margin=settings.margin_m,
            height=settings.height_m,
            keep_s=settings.keep_s,
        )
        self.reset()

    def reset(self) -> None:
        """Forget everything."""
        self._kernel.reset()
        self._walls: Float64 = np.empty((0, 2, 2))
        self._version = self._kernel.version
        self._now_s = 0.0

    def step(
        self,
        odometry: Odometry,
        outline: Outline,
        water: Callable[[], FreeWater],
        stands: Mapping[int, bool],
    ) -> None:
        """Take in a scan.

        Parameters
        ----------
        odometry
            The vessel's state at the scan's stamp.
        outline
            Where the nearest echoes are.
        water
            Gives what the tracker asks: what the scan has shown of places, in frame L.
        stands
            By the numbers of the outline's long objects whether they stand; those that nothing is
            known of yet are missing.
        """
        count = max(stands, default=-1) + 1
        flags = np.array([stands.get(number, False) for number in range(count)], np.uint8)
        north, east = odometry.position_N[:2].tolist()
        self._now_s = odometry.stamp_ns / NANOSECONDS_PER_SECOND
        self._kernel.see(
            water=water() if self._kernel.known else None,
            boundary=outline.boundary_L,
            heights=outline.height_m,
            seen=outline.seen,
            stands=flags,
            sensor=(float(outline.sensor_L[0]), float(outline.sensor_L[1])),
            own=(north, east),
            heading=odometry.heading,
            time=self._now_s,
        )

    @property
    def walls(self) -> Float64:
        """[m] [N] (S, 2, 2) The walls as segments; the same array until one comes or goes."""
        if self._version != self._kernel.version:
            self._version = self._kernel.version
            self._walls = self._kernel.segments()
        return self._walls

    @property
    def version(self) -> int:
        """[-] Changes whenever a wall comes or goes."""
        return self._kernel.version

    def edges_near(self, place_N: Float64, radius_m: float) -> Float64:
        """Give the walls of which a part is within a distance of a place, (K, 2, 2) [m] [N]."""
        walls = self.walls
        if not len(walls):
            return walls
        way = walls[:, 1] - walls[:, 0]
        length2 = np.maximum((way**2).sum(axis=1), 1e-12)
        share = np.clip(((place_N[:2] - walls[:, 0]) * way).sum(axis=1) / length2, 0.0, 1.0)
        off = walls[:, 0] + share[:, None] * way - place_N[:2]
        near: Float64 = walls[np.hypot(off[:, 0], off[:, 1]) <= radius_m]
        return near

    def wall_age_s(self, place_N: Float64) -> float:
        """[s] Give how long ago the wall at a place was last seen; NaN if there is none."""
        return self._now_s - self._kernel.wall_at((float(place_N[0]), float(place_N[1])))

    def free_age_s(self, place_N: Float64) -> float:
        """[s] Give how long ago a beam last passed over a place; NaN: none, or it is a wall."""
        return self._now_s - self._kernel.free_at((float(place_N[0]), float(place_N[1])))

    def is_known(self, place_N: Float64) -> bool:
        """Tell whether a place is a wall, or water that was seen."""
        return not math.isnan(self.wall_age_s(place_N)) or not math.isnan(self.free_age_s(place_N))
