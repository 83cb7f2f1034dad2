"""Perception: from one scan to the objects around the vessel (paper, sec. III-C, Algorithm 1).

The work is done by the kernel in ``runtime/native``; this is its face. The stages can be called
one by one: `project`, `segment`, `objects`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from twinscrew.runtime._native import Counts, Motion
from twinscrew.runtime.errors import MessageError
from twinscrew.runtime.geometry.frames import euler_from_quaternion
from twinscrew.runtime.messages.types import (
    Float32,
    Float64,
    Objects,
    Outline,
    PointCloud,
    Strips,
)
from twinscrew.runtime.perception.kernel import columns_a_sector, make_kernel
from twinscrew.runtime.perception.sensor import Sensor
from twinscrew.runtime.perception.settings import PerceptionSettings


@dataclass(frozen=True, slots=True, kw_only=True)
class Report:
    """What became of the points of a scan; the counts add up to `points`."""

    points: int
    """[-] All points of the cloud."""
    empty: int
    """[-] Without an echo: NaN, infinite, or at the sensor's origin."""
    range: int
    """[-] Nearer or farther than of use."""
    no_beam: int
    """[-] In a direction in which the described sensor fires no beam."""
    hull: int
    """[-] On the own hull."""
    water: int
    """[-] From the water."""
    hidden: int
    """[-] In one cell of the image with a nearer one."""
    used: int
    """[-] In the range image."""


class Perception:
    """One sensor's perception. It keeps the kernel's memory: one serves one thread at a time."""

    def __init__(self, sensor: Sensor, settings: PerceptionSettings | None = None) -> None:
        """Prepare the kernel for the sensor.

        Raises
        ------
        ConfigError
            The sensor has no mount.
        """
        self.sensor = sensor
        self.settings = settings or PerceptionSettings()
        self._counts: Counts | None = None
        self._R_BS = _flat(sensor.R_BS)
        self._p_BS = sensor.mount_position_B.tolist()
        self._sector_rad = columns_a_sector(sensor) * sensor.azimuth_step
        water = self.settings.water
        self._least_m = -math.inf if water is None else water.surface_m + water.clearance_m
        self._kernel = make_kernel(sensor, self.settings)

    def step(
        self,
        cloud: PointCloud,
        q_NB: Float64,
        rates_B: Float64 | None = None,
        velocity_B: Float64 | None = None,
    ) -> Objects:
        """Find the objects of a scan.

        Parameters
        ----------
        cloud
            The scan.
        q_NB : (4,) float64
            The vessel's attitude at the cloud's stamp, a unit quaternion, w first.
        rates_B, velocity_B : (3,) float64
            The vessel's rates [rad/s] and velocity over ground [m/s] during the scan; with them a
            scan that takes time is put as it would be seen from the vessel at the stamp.

        Raises
        ------
        MessageError
            An attitude, rates or a velocity that are not finite.
        """
        self._project(cloud, q_NB, rates_B, velocity_B)
        self.segment()
        return self.objects(cloud.stamp_ns)

    def project(
        self,
        cloud: PointCloud,
        q_NB: Float64,
        rates_B: Float64 | None = None,
        velocity_B: Float64 | None = None,
    ) -> Report:
        """Put the points into the range image; see `step`."""
        self._project(cloud, q_NB, rates_B, velocity_B)
        return self.report

    @property
    def report(self) -> Report:
        """What became of the points of the last scan."""
        return Report(**{name: getattr(self._counts, name, 0) for name in Report.__slots__})

    def _project(
        self,
        cloud: PointCloud,
        q_NB: Float64,
        rates_B: Float64 | None,
        velocity_B: Float64 | None,
    ) -> None:
        roll, pitch, _ = euler_from_quaternion(_finite(q_NB, "attitude"))
        motion = self._motion(rates_B, velocity_B)
        self._counts = self._kernel.project(
            np.ascontiguousarray(cloud.points_S, np.float32),
            cloud.intensity,
            cloud.time_offset_s,
            self._R_BS,
            self._p_BS,
            _levelling(roll, pitch),
            motion,
        )

    def segment(self) -> int:
        """Label the connected components of the range image; gives their number."""
        return self._kernel.segment()

    def objects(self, stamp_ns: int = 0) -> Objects:
        """Merge the components into objects, and those into circles."""
        table = self._kernel.objects()
        begin, rows_B = self._kernel.strips()
        return Objects(
            stamp_ns=stamp_ns,
            p_B=np.ascontiguousarray(table[:, :2]),
            radius=table[:, 2].copy(),
            points=table[:, 3].astype(np.int64),
            strips=Strips(begin=begin, rows_B=rows_B),
            outline=self._outline(table[:, 4].astype(np.int64)),
        )

    def _outline(self, cut_from: NDArray[np.int64]) -> Outline:
        """Give what tells whether long objects move."""
        sensor_B, down_B, sights_B, height_m, seen = self._kernel.outline()
        return Outline(
            sights_B=sights_B,
            height_m=height_m,
            seen=seen,
            cut_from=cut_from,
            sector_rad=self._sector_rad,
            is_closed=self.sensor.wraps,
            sensor_B=sensor_B,
            down_B=down_B,
            elevation_rad=self.sensor.elevations,
            least_m=self._least_m,
        )

    def range_image(self) -> Float32:
        """Give the ranges, (M, W) [m], lowest beam first, clockwise; 0 where there is no echo."""
        return self._kernel.range_image()

    def point_image(self) -> NDArray[np.int32]:
        """Give the number in the cloud of each cell's point, (M, W); -1 where there is no echo."""
        return self._kernel.point_image()

    def labels(self) -> NDArray[np.int32]:
        """Give each cell's component after `segment`, (M, W); -1 where there is no echo."""
        return self._kernel.labels()

    def object_image(self) -> NDArray[np.int32]:
        """Give each cell's object after `objects`, (M, W); -1 where there is none."""
        return self._kernel.object_image()

    def _motion(self, rates_B: Float64 | None, velocity_B: Float64 | None) -> Motion | None:
        """Give the motion to take out of the scan; none if it was taken at once."""
        if self.sensor.scan_duration_s == 0.0 or (rates_B is None and velocity_B is None):
            return None
        still = np.zeros(3)
        times = self.sensor.time_offsets
        clockwise = self.sensor.columns.step < 0
        first, last = (times[0], times[-1]) if clockwise else (times[-1], times[0])
        return Motion(
            _finite(still if rates_B is None else rates_B, "rates").tolist(),
            _finite(still if velocity_B is None else velocity_B, "velocity").tolist(),
            first,
            (last - first) / (self.sensor.columns.count - 1),
        )


def _levelling(roll: float, pitch: float) -> list[float]:
    """Give R_LB, row by row: R_y(pitch) R_x(roll). Fossen (2021), eq. 2.31 without heading."""
    cr, sr, cp, sp = math.cos(roll), math.sin(roll), math.cos(pitch), math.sin(pitch)
    return [cp, sp * sr, sp * cr, 0.0, cr, -sr, -sp, cp * sr, cp * cr]


def _flat(matrix: Float64) -> list[float]:
    return [float(value) for value in matrix.reshape(-1)]


def _finite(values: Float64, what: str) -> Float64:
    if not np.isfinite(values).all():
        raise MessageError(f"perception: the vessel's {what} is not finite: {values.tolist()}")
    return values
