"""The kernel in ``runtime/native`` for a sensor: settings in its terms."""

from __future__ import annotations

import math

import numpy as np

from twinscrew.runtime._native import FootprintRule, Gates, Kernel
from twinscrew.runtime.errors import ConfigError
from twinscrew.runtime.perception.sensor import Sensor
from twinscrew.runtime.perception.settings import FootprintSettings, PerceptionSettings

SECTOR_RAD = math.radians(0.5)
"""[rad] Width of a sector of the outline, or of a column if that is wider."""


def make_kernel(sensor: Sensor, settings: PerceptionSettings) -> Kernel:
    """Build the kernel of a sensor.

    Raises
    ------
    ConfigError
        The sensor sees nothing within `max_range_m`.
    """
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
        sector=columns_a_sector(sensor),
    )


def columns_a_sector(sensor: Sensor) -> int:
    """Give how many columns of the range image, side by side, are one sector of the outline."""
    half = sensor.image_shape[1] // 2  # there are two sectors at least
    return max(min(round(SECTOR_RAD / sensor.azimuth_step), half), 1)


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
