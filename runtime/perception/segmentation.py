"""Perception: from one scan to the objects around the vessel (paper, sec. III-C, Algorithm 1).

The work is done by the kernel in ``runtime/native``, in one call a scan; here are its settings and
its face. Places are given in frame L: the vessel's frame B, levelled by its attitude.
"""

from __future__ import annotations

import math
from typing import Annotated, Any

import numpy as np
from msgspec import Meta
from numpy.typing import NDArray

from twinscrew.runtime._native import Counts, FootprintRule, Gates, Kernel
from twinscrew.runtime.errors import ConfigError, MessageError
from twinscrew.runtime.messages.types import (
    Float32,
    Float64,
    Objects,
    Outline,
    PointCloud,
    Strips,
)
from twinscrew.runtime.perception.sensor import Sensor
from twinscrew.runtime.settings import Count, NonNegative, Positive, Settings
from twinscrew.runtime.vessel_description import load_vessel

SECTOR_RAD = math.radians(0.5)
"""[rad] Width of a sector of the outline, or of a column if that is wider."""


class HullSettings(Settings, frozen=True, kw_only=True):
    """The own hull as seen from above, from the vessel's origin: echoes from it are no objects."""

    aft_m: float = load_vessel().mask.aft_m
    """[m] The stern."""
    fore_m: float = load_vessel().mask.fore_m
    """[m] The bow."""
    half_width_m: Positive = load_vessel().mask.half_width_m
    """[m] Half of the beam."""

    def __post_init__(self) -> None:
        """Refuse a hull that would mask nothing."""
        if self.aft_m >= self.fore_m:
            raise ValueError("aft_m must be less than fore_m")


class WaterSettings(Settings, frozen=True, kw_only=True):
    """Which echoes come from the water."""

    surface_m: float = load_vessel().waterline_m
    """[m] Height of the surface over the vessel's origin, positive upwards, at rest."""
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
    max_range_m: Annotated[float, Meta(gt=0.0, le=150.0)] = 60.0
    """[m] Farther echoes are discarded (paper, sec. III-C: 20 m)."""
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
    """[-] Objects with fewer echoes, after merging, are dropped (parameters.md),"""
    full_range_m: Positive = 22.0
    """[m] up to here; farther off as many fewer as the same thing gives there,"""
    far_points: Count = 6
    """[-] down to this many."""
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


class Perception:
    """One sensor's perception. It keeps the kernel's memory: one serves one thread at a time.

    `step` is what a boat calls. `project`, `segment` and `objects` are its stages one by one, and
    the images show what the last scan became: (M, W), lowest beam first, clockwise.
    """

    def __init__(self, sensor: Sensor, settings: PerceptionSettings | None = None) -> None:
        """Prepare the kernel for the sensor.

        Raises
        ------
        ConfigError
            The sensor has no mount, beams that coincide, or sees nothing within `max_range_m`.
        """
        self.sensor = sensor
        self.settings = settings = settings or PerceptionSettings()
        self.report = Counts()
        """What became of the points of the last scan."""
        self.range_m = min(sensor.range_max_m, settings.max_range_m)
        """[m] Echoes from farther away are not used."""
        self._kernel = make_kernel(sensor, settings)
        water = settings.water
        self._outline: dict[str, Any] = {
            "sector_rad": columns_a_sector(sensor) * sensor.azimuth_step,
            "is_closed": sensor.wraps,
            "elevation_rad": sensor.elevations,
            "least_m": -math.inf if water is None else water.surface_m + water.clearance_m,
        }

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
        self.report, found = self._call(self._kernel.scan, cloud, q_NB, rates_B, velocity_B)
        return self._objects(cloud.stamp_ns, found)

    def project(
        self,
        cloud: PointCloud,
        q_NB: Float64,
        rates_B: Float64 | None = None,
        velocity_B: Float64 | None = None,
    ) -> Counts:
        """Put the points into the range image; see `step`."""
        self.report = self._call(self._kernel.project, cloud, q_NB, rates_B, velocity_B)
        return self.report

    def segment(self) -> int:
        """Label the connected components of the range image; gives their number."""
        return self._kernel.segment()

    def objects(self, stamp_ns: int = 0) -> Objects:
        """Merge the components into objects, and those into circles."""
        return self._objects(stamp_ns, self._kernel.objects())

    def range_image(self) -> Float32:
        """Give the ranges [m]; 0 where there is no echo."""
        return self._kernel.range_image()

    def point_image(self) -> NDArray[np.int32]:
        """Give the number in the cloud of each cell's point; -1 where there is no echo."""
        return self._kernel.point_image()

    def labels(self) -> NDArray[np.int32]:
        """Give each cell's component after `segment`; -1 where there is no echo."""
        return self._kernel.labels()

    def object_image(self) -> NDArray[np.int32]:
        """Give each cell's object after `objects`; -1 where there is none."""
        return self._kernel.object_image()

    @staticmethod
    def _call(
        function: Any,
        cloud: PointCloud,
        q_NB: Float64,
        rates_B: Float64 | None,
        velocity_B: Float64 | None,
    ) -> Any:
        try:
            return function(
                cloud.points_S, cloud.intensity, cloud.time_offset_s, q_NB, rates_B, velocity_B
            )
        except ValueError as error:  # the kernel checks what it is given
            raise MessageError(str(error)) from error

    def _objects(self, stamp_ns: int, found: tuple[Any, ...]) -> Objects:
        (
            p_L,
            radius,
            points,
            cut_from,
            begin,
            rows_L,
            sensor_L,
            down_L,
            boundary_L,
            height_m,
            seen,
        ) = found
        outline = Outline(
            boundary_L=boundary_L,
            height_m=height_m,
            seen=seen,
            cut_from=cut_from,
            sensor_L=sensor_L,
            down_L=down_L,
            **self._outline,
        )
        return Objects(
            stamp_ns=stamp_ns,
            p_L=p_L,
            radius=radius,
            points=points,
            strips=Strips(begin=begin, rows_L=rows_L),
            outline=outline,
        )


def columns_a_sector(sensor: Sensor) -> int:
    """Give how many columns of the range image, side by side, are one sector of the outline."""
    half = sensor.image_shape[1] // 2  # there are two sectors at least
    return max(min(round(SECTOR_RAD / sensor.azimuth_step), half), 1)


def make_kernel(sensor: Sensor, settings: PerceptionSettings, *, wide: bool = True) -> Kernel:
    """Make the kernel of a sensor; see `Perception`.

    `wide` lets it take eight points at once where the processor can; the results are the same.
    """
    rows, columns = sensor.image_shape
    footprint = settings.footprint or FootprintSettings(min_points=np.iinfo(np.int32).max)
    try:
        return Kernel(
            elevations=sensor.elevations.tolist(),
            first_azimuth=sensor.first_azimuth,
            azimuth_step=sensor.azimuth_step,
            columns=columns,
            wraps=sensor.wraps,
            gates=_gates(sensor, settings),
            theta=settings.theta_rad,
            # The noise of a difference of two ranges is sqrt(2) sigma.
            noise=settings.noise_sigmas * math.sqrt(2.0) * sensor.noise_sigma_m,
            bridged=min(settings.bridged, rows - 1, columns - 1),
            reach=settings.max_range_m + float(np.linalg.norm(sensor.mount_position_B)) + 1.0,
            merge_across=settings.merge_across_m,
            merge_along=settings.merge_along_m,
            footprint=FootprintRule(
                footprint.length_m,
                footprint.beam_m,
                footprint.reach_m,
                footprint.least_m,
                footprint.min_points,
            ),
            least_points=settings.min_points,
            full_range=settings.full_range_m,
            far_points=settings.far_points,
            longest=settings.longest_m,
            piece=settings.piece_m,
            strip_gap=settings.strip_gap_m,
            sector=columns_a_sector(sensor),
            R_BS=sensor.R_BS.reshape(-1).tolist(),
            p_BS=sensor.mount_position_B.tolist(),
            column_times=_column_times(sensor),
            wide=wide,
        )
    except ValueError as error:
        raise ConfigError(f"sensor {sensor.name!r}: {error}", key="beams") from error


def _column_times(sensor: Sensor) -> tuple[float, float] | None:
    """[s] Give when column 0 is fired, and how long after it the next; None if all at once."""
    if sensor.scan_duration_s == 0.0:
        return None
    times = sensor.time_offsets
    first, last = (times[0], times[-1]) if sensor.columns.step < 0 else (times[-1], times[0])
    return float(first), float((last - first) / (sensor.columns.count - 1))


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
