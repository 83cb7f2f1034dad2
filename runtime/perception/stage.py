"""Perception: from one scan to the objects around the vessel (paper, sec. III-C, Algorithm 1).

The work is done by the kernel in ``runtime/native``; this is its face. The stages can be called
one by one: `project`, `segment`, `objects`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from msgspec import Meta
from numpy.typing import NDArray

from twinscrew.runtime._native import Counts, FootprintRule, Gates, Kernel, Motion
from twinscrew.runtime.errors import ConfigError, MessageError
from twinscrew.runtime.geometry.frames import euler_from_quaternion
from twinscrew.runtime.messages.types import Float32, Float64, Objects, PointCloud, Strips
from twinscrew.runtime.perception.sensor import Sensor
from twinscrew.runtime.settings import Count, NonNegative, Positive, Settings


class HullSettings(Settings, frozen=True, kw_only=True):
    """The own hull as seen from above, from the vessel's origin: echoes from it are no objects."""

    aft_m: float = -2.9
    """[m] The stern (WAM-V 16: engines end at -2.63)."""
    fore_m: float = 2.7
    """[m] The bow (WAM-V 16: floats end at 2.53)."""
    half_width_m: Positive = 1.35
    """[m] Half of the beam (WAM-V 16: floats end at 1.23)."""

    def __post_init__(self) -> None:
        """Refuse a hull that would mask nothing."""
        if self.aft_m >= self.fore_m:
            raise ValueError("aft_m must be less than fore_m")


class WaterSettings(Settings, frozen=True, kw_only=True):
    """Which echoes come from the water."""

    surface_m: float = 0.11
    """[m] Height of the surface over the vessel's origin, positive upwards (WAM-V 16 at rest)."""
    clearance_m: float = 0.1
    """[m] Echoes lower than this over the surface are water, however strong."""
    weak_clearance_m: float = 0.8
    """[m] Weak echoes lower than this over the surface are water: waves do not rise higher."""


class FootprintSettings(Settings, frozen=True, kw_only=True):
    """Which pieces are put together because they have the footprint of one vessel."""

    length_m: Positive = 5.5
    """[m] Of the vessel (WAM-V 16: 5.2)."""
    beam_m: Positive = 2.9
    """[m] Of the vessel (WAM-V 16: 2.5)."""
    reach_m: NonNegative = 2.2
    """[m] Greatest gap between two pieces: that between a catamaran's hulls and some more."""
    least_m: NonNegative = 2.2
    """[m] One of the two must be this long: two buoys side by side are no vessel."""
    min_points: Count = 3
    """[-] Smaller pieces are left alone."""


class PerceptionSettings(Settings, frozen=True, kw_only=True):
    """How points become objects."""

    theta_rad: Annotated[float, Meta(gt=0.0, lt=math.pi)] = math.radians(60.0)
    """[rad] Threshold of the angle criterion (parameters.md)."""
    max_range_m: Annotated[float, Meta(gt=0.0, le=150.0)] = 20.0
    """[m] Farther echoes are discarded (paper, sec. III-C)."""
    noise_sigmas: NonNegative = 3.0
    """[-] A link may differ by this many sigmas of a range difference beyond the criterion."""
    bridged: Annotated[int, Meta(ge=0, le=16)] = 1
    """[-] Missing echoes that a link may cross; the paper's neighbours are 0."""
    merge_across_m: Annotated[float, Meta(gt=0.0, le=10.0)] = 0.6
    """[m] Fragments no farther apart, seen from above across the line of sight, are one object."""
    merge_along_m: Annotated[float, Meta(gt=0.0, le=10.0)] = 0.9
    """[m] The same along it, where grazing beams and shadows leave gaps too."""
    footprint: FootprintSettings | None = FootprintSettings()
    """The vessels whose pieces are put together; none does not."""
    min_points: Count = 20
    """[-] Objects with fewer echoes, after merging, are dropped (parameters.md)."""
    longest_m: Positive = 6.5
    """[m] Longer objects become several circles; a WAM-V's diagonal is 5.6 m."""
    piece_m: Positive = 4.0
    """[m] Greatest length of the pieces of such an object."""
    strip_gap_m: Positive = 0.3
    """[m] Echoes side by side that are farther apart than this are not of one strip."""
    hull: HullSettings | None = HullSettings()
    """The own hull; none masks nothing."""
    water: WaterSettings | None = WaterSettings()
    """The water; none keeps every echo."""

    def __post_init__(self) -> None:
        """Refuse lengths that contradict each other."""
        if self.piece_m > self.longest_m:
            raise ValueError("piece_m must not be greater than longest_m")


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
        self._kernel = _make_kernel(sensor, self.settings)

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


def _make_kernel(sensor: Sensor, settings: PerceptionSettings) -> Kernel:
    rows, columns = sensor.image_shape
    # The noise of a difference of two ranges is sqrt(2) sigma.
    noise = settings.noise_sigmas * math.sqrt(2.0) * sensor.noise_sigma_m
    return Kernel(
        elevations=sensor.elevations.tolist(),
        first_azimuth=sensor.first_azimuth,
        azimuth_step=sensor.azimuth_step,
        columns=columns,
        wraps=sensor.wraps,
        gates=_gates(sensor, settings),
        theta=settings.theta_rad,
        noise=noise,
        bridged=min(settings.bridged, rows - 1, columns - 1),
        reach=settings.max_range_m + float(np.linalg.norm(sensor.mount_position_B)) + 1.0,
        merge_across=settings.merge_across_m,
        merge_along=settings.merge_along_m,
        footprint=_footprint(settings.footprint),
        least_points=settings.min_points,
        longest=settings.longest_m,
        piece=settings.piece_m,
        strip_gap=settings.strip_gap_m,
    )


def _gates(sensor: Sensor, settings: PerceptionSettings) -> Gates:
    gates = Gates()
    gates.range_min = sensor.range_min_m
    gates.range_max = min(sensor.range_max_m, settings.max_range_m)
    if gates.range_max <= gates.range_min:
        raise ConfigError(f"must be greater than {sensor.range_min_m} m", key="max_range_m")
    if settings.hull is not None:
        gates.mask_hull = True
        gates.hull_aft, gates.hull_fore = settings.hull.aft_m, settings.hull.fore_m
        gates.hull_half_width = settings.hull.half_width_m
    if settings.water is not None:
        gates.drop_water = True
        gates.surface_down = -settings.water.surface_m
        gates.clearance = settings.water.clearance_m
        gates.weak_clearance = settings.water.weak_clearance_m
        if sensor.weak_intensity is not None:
            gates.weak = sensor.weak_intensity
    return gates


def _footprint(settings: FootprintSettings | None) -> FootprintRule:
    s = settings or FootprintSettings(min_points=np.iinfo(np.int32).max)  # no piece is so large
    return FootprintRule(s.length_m, s.beam_m, s.reach_m, s.least_m, s.min_points)


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
