"""What a sensor reports to the tracker: detections of one look, and the sensor's own properties.

Every sensor speaks to the tracker in the same terms: a linear measurement z = H x + w of the state
x = (north, east, v_north, v_east, b_along, b_across), where b is the offset of the visible centroid
of an object from its centre (see `kalman`). A look of one source is a chance to be detected by that
source only; how good a chance is told by its `SourceSettings`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, Literal

import numpy as np

from twinscrew.runtime.messages.types import Float64
from twinscrew.runtime.settings import Fraction, NonNegative, Positive, Settings
from twinscrew.runtime.tracking.kalman import STATES


class SourceSettings(Settings, frozen=True, kw_only=True):
    """What a source can detect, and how often it is wrong."""

    measures: Literal["position", "bearing"] = "position"
    """Bearings start no tracks: one direction does not say where something is."""
    delay_s: NonNegative = 0.0
    """[s] The scene was like this so long before the stamp."""
    correlation_s: NonNegative = 0.0
    """[s] Errors of looks closer together are the same error: only one of them is used."""
    range_m: tuple[NonNegative, ...] = (0.0, 100.0)
    """[m] At these distances"""
    detection: tuple[Fraction, ...] = (0.9, 0.9)
    """[-] a look detects a visible target with this probability; linear in between."""
    max_range_m: Positive = 1e4
    """[m] Detections beyond are not used, and no look reaches farther."""
    sector_rad: tuple[float, float] = (-math.pi, math.pi)
    """[rad] [B] The bearings that a look covers, clockwise from ahead."""
    clutter: Positive = 1e-6
    """[1/m2 or 1/rad] Density of detections of nothing, as expected beforehand;"""
    near_clutter: NonNegative = 0.0
    """[1/m2] this much more nearer than"""
    near_m: NonNegative = 0.0
    """[m] this: returns of the water and the wake."""
    clutter_memory_s: NonNegative = 0.0
    """[s] The density is learnt by range from what belonged to no track for so long; 0: never."""
    visible: Fraction = 0.9
    """[-] Share of the time for which a target is visible to the source at all."""
    visible_s: Positive = 10.0
    """[s] How long it typically stays visible, or hidden."""
    sees_land: bool = False
    """Whether returns may be land or moored things: then a track that this source alone has seen is
    reported once it has moved."""
    steady_s: NonNegative = 0.0
    """[s] Or once it has been there for so long; 0: never."""
    identifies: bool = False
    """Whether each detection names its vessel, as AIS does: then a look says nothing of others
    (tracking.named), and what detection, clutter and visibility say is not used."""
    acceleration_psd: NonNegative | None = None
    """[m2/s3] Density of the white acceleration of what only such sources have seen; none: as of
    everything else. Ships that report themselves every 10 s manoeuvre less than boats."""
    radius_m: Positive = 3.0
    """[m] Radius of a target whose size no source has told."""
    shape_m: tuple[NonNegative, NonNegative] = (0.0, 0.0)
    """[m] How far the detected place of an object may be off its centre, along and across the line
    of sight, for as long as the aspect stays the same."""

    def __post_init__(self) -> None:
        """Refuse a table that is none."""
        if len(self.range_m) != len(self.detection) or not self.range_m:
            raise ValueError("range_m and detection must be as long as each other, and not empty")
        if any(low >= high for low, high in pairwise(self.range_m)):
            raise ValueError("range_m must rise")

    def detection_probability(self, distance: Float64) -> Float64:
        """Give how likely a look detects visible targets at distances (K,) [m]."""
        chance: Float64 = np.interp(distance, self.range_m, self.detection)
        return np.where(distance <= self.max_range_m, chance, 0.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Detection:
    """One thing that a source has detected."""

    stamp_ns: int
    """[ns] When the look was taken."""
    z: Float64
    """[m] (d,) What was measured, d = 1 or 2."""
    H: Float64
    """(d, 6) What it says of the state."""
    R: Float64
    """[m2] (d, d) Its noise,"""
    R_rad2: float = 0.0
    """[rad2] and what is added for each squared metre between origin and target."""
    source: str = ""
    """Name of the source."""
    extras: Any = None
    """What only this source knows of it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Look:
    """All detections of one look of one source; there may be none."""

    stamp_ns: int
    """[ns] When it was taken."""
    source: str
    """Name of the source."""
    origin_N: Float64
    """[m] [N] (2,) Where the sensor was."""
    heading: float = 0.0
    """[rad] [N] The vessel's heading, from which the sector is measured."""
    z: Float64
    """[m] (M, d)"""
    H: Float64
    """(M, d, 6)"""
    R: Float64
    """[m2] (M, d, d)"""
    R_rad2: Float64
    """[rad2] (M,)"""
    extras: Sequence[Any] = ()
    """(M,) or empty."""

    @classmethod
    def of(
        cls, detections: Sequence[Detection], stamp_ns: int, source: str, origin_N: Float64
    ) -> Look:
        """Collect the detections of a look, all of the same kind."""
        d = len(detections[0].z) if detections else 2
        return cls(
            stamp_ns=stamp_ns,
            source=source,
            origin_N=origin_N,
            z=np.array([item.z for item in detections]).reshape(-1, d),
            H=np.array([item.H for item in detections]).reshape(-1, d, STATES),
            R=np.array([item.R for item in detections]).reshape(-1, d, d),
            R_rad2=np.array([item.R_rad2 for item in detections], np.float64),
            extras=[item.extras for item in detections],
        )


def no_detections(source: str, origin_N: Float64, heading: float) -> Look:
    """Make a look of a source that has detected nothing."""
    return Look(
        stamp_ns=0,
        source=source,
        origin_N=origin_N,
        heading=heading,
        z=np.empty((0, 2)),
        H=np.empty((0, 2, STATES)),
        R=np.empty((0, 2, 2)),
        R_rad2=np.empty(0),
    )


def positions(
    p_N: Float64,
    origin_N: Float64,
    *,
    sigma_m: float,
    sigma_rad: float,
    stamp_ns: int,
    source: str,
    shape_bias: bool = False,
) -> Look:
    """Make a look of measured positions with polar noise.

    Parameters
    ----------
    p_N : (M, 2) float64
        Measured positions [m], frame N.
    origin_N : (2,) float64
        Where the sensor was [m].
    sigma_m, sigma_rad
        Standard deviation of range [m] and bearing [rad].
    stamp_ns, source
        When, and by whom.
    shape_bias
        Whether the visible centroid is measured, not the centre: the state's b enters.
    """
    count = len(p_N)
    offset = p_N - origin_N
    distance = np.hypot(offset[:, 0], offset[:, 1])
    u = offset / np.maximum(distance, 1e-6)[:, None]
    n = np.stack([-u[:, 1], u[:, 0]], axis=1)
    across = sigma_m**2 + (sigma_rad * distance) ** 2
    R = sigma_m**2 * u[:, :, None] * u[:, None, :]
    R += across[:, None, None] * n[:, :, None] * n[:, None, :]
    H = np.zeros((count, 2, STATES))
    H[:, 0, 0] = H[:, 1, 1] = 1.0
    if shape_bias:
        H[:, :, 4], H[:, :, 5] = -u, -n
    return Look(
        stamp_ns=stamp_ns,
        source=source,
        origin_N=origin_N,
        z=p_N,
        H=H,
        R=R,
        R_rad2=np.zeros(count),
    )


def bearings(
    bearing: Float64,
    origin_N: Float64,
    *,
    sigma_m: float,
    sigma_rad: float,
    stamp_ns: int,
    source: str,
) -> Look:
    """Make a look of measured directions.

    A bearing theta from o says n . (p - o) = 0 with n = (-sin theta, cos theta), off by the range
    times the bearing's error: linear in the state, with noise that depends on the target's range.

    Parameters
    ----------
    bearing : (M,) float64
        Directions [rad], clockwise from north.
    origin_N : (2,) float64
        Where the sensor was [m].
    sigma_m, sigma_rad
        How far the seen middle is off the centre [m], and the bearing's noise [rad].
    stamp_ns, source
        When, and by whom.
    """
    count = len(bearing)
    H = np.zeros((count, 1, STATES))
    H[:, 0, 0], H[:, 0, 1] = -np.sin(bearing), np.cos(bearing)
    return Look(
        stamp_ns=stamp_ns,
        source=source,
        origin_N=origin_N,
        z=H[:, :, :2] @ origin_N,
        H=H,
        R=np.full((count, 1, 1), sigma_m**2),
        R_rad2=np.full(count, sigma_rad**2),
    )
