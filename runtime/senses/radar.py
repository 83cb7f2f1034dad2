"""Radar: the returns of one turn become plots, one for each thing that is seen.

A thing gives returns in several range cells and at several bearings, because cells and beam are
narrower than it. Returns that touch are one plot, at their mean weighted by strength. Which plots
are vessels and which are sea is left to the tracker: its model of clutter learns by range.
"""

from __future__ import annotations

from dataclasses import replace
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from twinscrew.runtime.messages.marine import RadarScan, decode_radar_scan
from twinscrew.runtime.messages.types import Float64, Tracks
from twinscrew.runtime.safety.events import ODOMETRY_MISSING
from twinscrew.runtime.senses.sense import NOTHING, Heard, OwnAt, Rarely, Sense, SenseSettings
from twinscrew.runtime.settings import Count, NonNegative, Positive
from twinscrew.runtime.tracking.detections import Look, SourceSettings, positions

SOURCE = SourceSettings(
    range_m=(0.0, 15.0, 30.0, 600.0, 1500.0),
    detection=(0.0, 0.2, 0.85, 0.85, 0.3),
    max_range_m=2000.0,
    clutter=2e-6,
    near_clutter=2e-5,
    near_m=200.0,
    clutter_memory_s=30.0,
    visible=0.9,
    visible_s=20.0,
    radius_m=4.0,
)
"""What such a radar detects of vessels of 5 to 30 m, and what it sees of the sea."""


class RadarSettings(SenseSettings, frozen=True, kw_only=True):
    """How a radar measures. The defaults are those of a small pulse-compression radar."""

    topic: ClassVar[str] = "radar"
    source: ClassVar[SourceSettings] = SOURCE

    range_sigma_m: Positive = 2.0
    """[m] Standard deviation of a plot's range: a third of a range cell of 6 m."""
    bearing_sigma_rad: Positive = 0.015
    """[rad] Standard deviation of its bearing: a fifth of a beam of 4.5 degrees."""
    cell_m: Positive = 9.0
    """[m] Returns nearer to each other than this in range,"""
    beam_rad: Positive = 0.06
    """[rad] and than this in bearing, are of one thing."""
    least_range_m: NonNegative = 10.0
    """[m] Nearer returns are those of the own vessel."""
    max_range_m: Positive = 2000.0
    """[m] Farther ones are not used."""
    least_amplitude: float = -1e9
    """[radar's own] Weaker ones are not used."""
    offset_rad: float = 0.0
    """[rad] Added to each bearing, clockwise: how the radar is mounted."""
    most_plots: Count = 300
    """[-] Of one turn; the strongest are kept."""

    def make(self, name: str) -> Sense:
        """See `SenseSettings`."""
        return Radar(self, name)


class Radar:
    """Plots of a radar; a `Sense`."""

    def __init__(self, settings: RadarSettings, name: str = "radar") -> None:
        self._settings = settings
        self._name = name
        self._rarely = Rarely(10.0)

    def take(self, payload: bytes, latest_ns: int, own_at: OwnAt) -> Heard:
        """See `Sense`; a turn without odometry at its time is not used."""
        scan = decode_radar_scan(payload)
        stamp_ns = scan.stamp_ns or latest_ns
        own = own_at(stamp_ns)
        if own is None:
            if not self._rarely.allows("odometry", stamp_ns):
                return NOTHING
            return Heard(events=(ODOMETRY_MISSING.at(stamp_ns, f"{self._name} scan"),))
        settings = self._settings
        distance, bearing = plots(scan, settings)
        towards = bearing + settings.offset_rad + own.heading
        own_N = own.position_N[:2]
        p_N = own_N + distance[:, None] * np.column_stack([np.cos(towards), np.sin(towards)])
        look = positions(
            p_N,
            own_N,
            sigma_m=settings.range_sigma_m,
            sigma_rad=settings.bearing_sigma_rad,
            stamp_ns=stamp_ns,
            source=self._name,
        )
        return Heard((with_heading(look, own.heading),))

    def step(self, stamp_ns: int, *, forgotten: bool) -> Heard:  # noqa: ARG002
        """See `Sense`; a radar keeps nothing."""
        return NOTHING

    def targets(self, stamp_ns: int) -> Tracks | None:  # noqa: ARG002
        """See `Sense`."""
        return None


def with_heading(look: Look, heading: float) -> Look:
    """Give a look with the heading from which its sector is measured."""
    return replace(look, heading=heading)


def plots(scan: RadarScan, settings: RadarSettings) -> tuple[Float64, Float64]:
    """Join returns that touch; give range [m] and bearing [rad] of each plot, (M,), (M,)."""
    keep = (
        (scan.range_m >= settings.least_range_m)
        & (scan.range_m <= settings.max_range_m)
        & (scan.amplitude >= settings.least_amplitude)
    )
    distance = (scan.range_m * np.cos(scan.elevation_rad))[keep]
    bearing, amplitude = scan.bearing_rad[keep], scan.amplitude[keep]
    group = groups(distance, bearing, settings)
    count = int(group.max(initial=-1)) + 1
    weight = 1e-3 + amplitude - amplitude.min(initial=0.0)
    total = np.bincount(group, weight, count)
    mean = np.bincount(group, weight * distance, count) / total
    ahead = np.bincount(group, weight * np.cos(bearing), count)
    abeam = np.bincount(group, weight * np.sin(bearing), count)
    strongest = np.sort(np.argsort(-total, kind="stable")[: settings.most_plots])
    return mean[strongest], np.arctan2(abeam, ahead)[strongest]


def groups(distance: Float64, bearing: Float64, settings: RadarSettings) -> NDArray[np.intp]:
    """Give each return's group, (N,): those joined by steps of at most a cell and a beam."""
    count = len(distance)
    group = np.full(count, -1, np.intp)
    order = np.argsort(distance, kind="stable")
    d, b = distance[order], bearing[order]
    first = np.searchsorted(d, d - settings.cell_m)
    parent = list(range(count))

    def root(i: int) -> int:
        while parent[i] != i:
            parent[i] = parent[parent[i]]
            i = parent[i]
        return i

    for i in range(count):
        near = np.arange(first[i], i)
        turned = np.abs((b[near] - b[i] + np.pi) % (2 * np.pi) - np.pi)
        for j in near[turned <= settings.beam_rad].tolist():
            parent[root(j)] = root(i)
    names: dict[int, int] = {}
    for place, i in enumerate(order.tolist()):
        group[i] = names.setdefault(root(place), len(names))
    return group
