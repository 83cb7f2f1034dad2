"""How points become objects: the settings of perception."""

from __future__ import annotations

import math
from typing import Annotated

from msgspec import Meta

from twinscrew.runtime.settings import Count, NonNegative, Positive, Settings
from twinscrew.runtime.vessel_description import load_vessel


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
