"""LiDARs as data: where their rays point, what they measure, where they sit on the vessel.

A description is a TOML file of ``config/sensors``. Angles are typed as the makers and ROS give
them (x forward, y left, z up, counter-clockwise); everything this module computes is forward-
starboard-down, with azimuth clockwise from x and elevation positive upwards.
"""

from __future__ import annotations

import math
from functools import cached_property
from pathlib import Path
from typing import Annotated

import numpy as np
from msgspec import Meta, structs

from twinscrew.runtime.errors import ConfigError
from twinscrew.runtime.geometry import flu_to_frd, quaternion_from_euler, rotation_from_quaternion
from twinscrew.runtime.messages.types import Float32, Float64
from twinscrew.runtime.settings import (
    Fraction,
    NonNegative,
    Positive,
    Settings,
    load,
    shipped,
)

Elevation = Annotated[float, Meta(ge=-90.0, le=90.0)]
Aboard = Annotated[float, Meta(ge=-100.0, le=100.0)]
"""[m] Farther from the vessel's origin nothing is on it: these are millimetres."""
Turn = Annotated[float, Meta(ge=-2 * math.pi, le=2 * math.pi)]
"""[rad] Greater ones are degrees."""

MOST_BEAMS, MOST_COLUMNS = 1024, 65_536
"""[-] Nobody's LiDAR has more: an image of them all still fits the memory."""


class Beams(Settings, frozen=True, kw_only=True):
    """The rows of the range image: evenly spread beams, or a list of them."""

    count: Annotated[int, Meta(ge=2, le=MOST_BEAMS)] | None = None
    """[-] Number of beams, evenly spread from the lowest to the highest, both included."""
    lowest_rad: float | None = None
    """[rad] Elevation of the lowest beam, positive upwards."""
    highest_rad: float | None = None
    """[rad] Elevation of the highest beam, positive upwards."""
    elevations_deg: Annotated[tuple[Elevation, ...], Meta(max_length=MOST_BEAMS)] | None = None
    """[deg] Instead of the three above: every beam's elevation, in any order."""

    def elevations(self) -> Float64:
        """Give the elevations, (M,) [rad], lowest first."""
        listed, count = self.elevations_deg, self.count
        lowest, highest = self.lowest_rad, self.highest_rad
        if listed is None and count is not None and lowest is not None and highest is not None:
            angles = np.linspace(lowest, highest, count)
        elif listed is not None and count is lowest is highest is None:
            angles = np.sort(np.radians(np.array(listed, dtype=np.float64)))
        else:
            raise ConfigError(
                "give either count, lowest_rad and highest_rad, or elevations_deg", key="beams"
            )
        if len(angles) < 2 or np.any(np.diff(angles) <= 1e-6) or abs(angles).max() >= math.pi / 2:
            raise ConfigError(
                "needs at least two distinct elevations, all between -90 and 90 degrees",
                key="beams",
            )
        return angles


class Columns(Settings, frozen=True, kw_only=True):
    """The columns of the range image: azimuths at which every beam is fired, in firing order."""

    count: Annotated[int, Meta(ge=2, le=MOST_COLUMNS)]
    """[-] Number of firings a scan."""
    first_rad: Turn
    """[rad] Azimuth of the first firing, counter-clockwise from x forward."""
    span_rad: Annotated[float, Meta(ge=-2 * math.pi - 1e-9, le=2 * math.pi + 1e-9)]
    """[rad] From the first azimuth to the last; positive counter-clockwise."""
    endpoint: bool
    """True if a firing falls on the span's end: step = span / (count - 1), else span / count."""

    @property
    def step(self) -> float:
        """[rad] From one firing to the next, signed, counter-clockwise."""
        return self.span_rad / (self.count - 1 if self.endpoint else self.count)


class Mount(Settings, frozen=True, kw_only=True):
    """Where the sensor sits, from the vessel's origin (base_link): x forward, y left, z up."""

    x_m: Aboard
    """[m] Forward."""
    y_m: Aboard
    """[m] To port."""
    z_m: Aboard
    """[m] Up."""
    roll_rad: Turn = 0.0
    """[rad] About x."""
    pitch_rad: Turn = 0.0
    """[rad] About y: positive turns the bow-side rays down."""
    yaw_rad: Turn = 0.0
    """[rad] About z: positive turns the forward ray to port."""


class Sensor(Settings, frozen=True, kw_only=True, dict=True):
    """A LiDAR: its rays, its range, its noise, its place on the vessel."""

    name: str
    """What people call it."""
    beams: Beams
    columns: Columns
    rate_hz: Positive
    """[Hz] Scans a second."""
    scan_duration_s: Annotated[float, Meta(ge=0.0, le=10.0)]
    """[s] From the first firing to the last; 0 if all rays are taken at once (simulators)."""
    stamp_fraction: Fraction = 0.0
    """[-] When in the scan its stamp is taken: 0 at the first firing, 1 at the last."""
    range_min_m: NonNegative
    """[m] Nearer echoes are not given."""
    range_max_m: Positive
    """[m] Farther echoes are not given."""
    noise_sigma_m: NonNegative
    """[m] Standard deviation of a range."""
    weak_intensity: float | None = None
    """[sensor's own] Echoes of at most this strength may be water; none tells nothing."""
    mount: Mount | None = None
    """Its pose on the vessel; a sensor without one cannot serve on a vessel."""
    gives_misses: bool = True
    """True if rays without an echo are in the cloud (as infinities), False if left out."""

    def __post_init__(self) -> None:
        """Refuse a description that no scan can fit."""
        if self.range_max_m <= self.range_min_m:
            raise ValueError("range_max_m must be greater than range_min_m")
        if abs(self.columns.step) < 1e-6:
            raise ValueError("columns.span_rad must not be zero")

    @cached_property
    def elevations(self) -> Float64:
        """[rad] (M,) Elevations of the beams, lowest first, positive upwards."""
        return self.beams.elevations()

    @cached_property
    def azimuths(self) -> Float64:
        """[rad] [S, FRD] (C,) Azimuths in firing order, clockwise from x forward (may pass pi)."""
        columns = self.columns
        return -(columns.first_rad + columns.step * np.arange(columns.count, dtype=np.float64))

    @property
    def azimuth_step(self) -> float:
        """[rad] From one column of the range image to the next, positive."""
        return abs(self.columns.step)

    @property
    def wraps(self) -> bool:
        """True if the last column of the range image is a neighbour of its first."""
        turn = abs(self.columns.span_rad) + (0.0 if self.columns.endpoint else 1e-9)
        return turn >= 2 * math.pi - 1e-6

    @property
    def image_shape(self) -> tuple[int, int]:
        """Rows (beams) and columns of the range image.

        Columns are distinct azimuths: a full turn with an endpoint fires twice at its end, into
        one column.
        """
        distinct = self.columns.count - (self.wraps and self.columns.endpoint)
        return len(self.elevations), distinct

    @property
    def first_azimuth(self) -> float:
        """[rad] [S, FRD] Azimuth of the range image's column 0; the next is clockwise of it."""
        return float(self.azimuths[0] if self.columns.step < 0 else self.azimuths[-1])

    def directions_S(self) -> Float32:
        """Give the rays: unit vectors, (M, C, 3), frame S (FRD), lowest beam first, as fired."""
        elevation, azimuth = self.elevations[:, None], self.azimuths[None, :]
        x = np.cos(elevation) * np.cos(azimuth)
        y = np.cos(elevation) * np.sin(azimuth)
        z = np.broadcast_to(-np.sin(elevation), x.shape)
        return np.stack([x, y, z], axis=-1).astype(np.float32)

    @property
    def time_offsets(self) -> Float64:
        """[s] (C,) Time of each firing after the scan's stamp."""
        count = self.columns.count
        fraction = np.arange(count, dtype=np.float64) / (count - 1)
        return (fraction - self.stamp_fraction) * self.scan_duration_s

    def mounted(self, mount: Mount) -> Sensor:
        """Give the same sensor at another place."""
        return structs.replace(self, mount=mount)

    @property
    def mount_position_B(self) -> Float64:
        """[m] [B, FRD] (3,) The sensor's place from the vessel's origin."""
        mount = self._mount()
        return flu_to_frd(np.array([mount.x_m, mount.y_m, mount.z_m]))

    @property
    def q_BS(self) -> Float64:
        """(4,) The sensor's attitude on the vessel, a unit quaternion, w first."""
        mount = self._mount()
        # FLU to FRD is half a turn about x: roll stays, pitch and yaw change their sign.
        return quaternion_from_euler(mount.roll_rad, -mount.pitch_rad, -mount.yaw_rad)

    @property
    def R_BS(self) -> Float64:
        """(3, 3) Turns a vector of S (FRD) into B (FRD)."""
        return rotation_from_quaternion(self.q_BS)

    def _mount(self) -> Mount:
        if self.mount is None:
            raise ConfigError(
                f"sensor {self.name!r} has no mount: give it a [mount] with x_m, y_m, z_m",
                key="mount",
            )
        return self.mount


def load_sensor(name: str | Path) -> Sensor:
    """Read a sensor: the name of a shipped one, or the path of a description.

    Raises
    ------
    ConfigError
        No such sensor, or a description that cannot be used.
    """
    path = shipped("sensors", name)
    sensor = load(path, Sensor)
    try:
        _ = sensor.elevations
    except ConfigError as error:
        raise ConfigError(str(error), file=path) from error
    return sensor
