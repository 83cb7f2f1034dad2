"""Whether a track is something: existence, visibility to each source, clutter, occlusion, vessels.

A track exists with a probability r; if it does, each source can see it at all with a probability v
(Markov, two states), and a look then detects it with the probability that the source's settings
give. What a look has not detected is thus evidence against existence only as far as that source
should have seen it: joint integrated probabilistic data association with visibility.

Sources: Musicki, Evans (2004), Joint integrated probabilistic data association: JIPDA, IEEE Trans.
AES 40(3); Brekke, Hem, Tokle (2021), Multitarget tracking with multiple models and visibility:
derivation and verification on maritime radar data, IEEE J. Oceanic Eng. 46(4).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from twinscrew.runtime.messages.types import Float64
from twinscrew.runtime.settings import Count, Fraction, NonNegative, Positive, Settings
from twinscrew.runtime.tracking.detections import SourceSettings

RINGS_M = np.array([0.0, 25.0, 50.0, 100.0, 200.0, 400.0, 800.0, 1600.0])
"""[m] Between these distances clutter is learnt as one density."""


class ExistenceSettings(Settings, frozen=True, kw_only=True):
    """When a track is reported and when it is dropped."""

    birth: Positive = 2e-6
    """[1/m2] Density of new targets in a look."""
    lifetime_s: Positive = 60.0
    """[s] How long a target typically stays in the area."""
    confirm: Fraction = 0.999
    """[-] A track that exists with this probability is reported,"""
    report: Fraction = 0.4
    """[-] for as long as it exists with this one."""
    drop: Fraction = 0.05
    """[-] Below this it is dropped."""
    drop_tentative: Fraction = 0.0007
    """[-] The same for one that has never been reported."""
    known_m: Positive = 9.0
    """[m] A track whose position is less certain than this (standard deviation) is not reported;"""
    tentative_known_m: Positive = 10.0
    """[m] and one that has never been reported, and is less certain than this, is dropped."""
    moved_m: NonNegative = 6.0
    """[m] A track has moved if it is so far from where it began,"""
    moved_sigma: Positive = 3.0
    """[-] by so many standard deviations,"""
    moved_hits: Count = 4
    """[-] and has been detected so often."""
    settled_hits: Count = 20
    """[-] Detections of a track detected so often do not count as clutter."""
    shadow_m: NonNegative = 10.0
    """[m] A reported target hides what is behind it to this far on either side:"""
    shadow: Fraction = 0.1
    """[-] that is detected this much more seldom."""
    report_range_m: Positive = 1e4
    """[m] Tracks farther from the vessel are not reported."""


class VesselSettings(Settings, frozen=True, kw_only=True):
    """Which tracks are parts of one vessel: its hull, its wake, what it tows.

    Parts keep their places relative to one another. The foremost is reported, under the identity
    that the vessel had first; the others only keep their detections from disturbing it.
    """

    length_m: NonNegative = 0.0
    """[m] Parts are at most this far apart along the course; 0: every track is a vessel."""
    beam_m: NonNegative = 3.0
    """[m] They are this far apart across it, and this"""
    spread: NonNegative = 0.5
    """[-] share of their distance more: a tow sways, a wake spreads."""
    speed_mps: NonNegative = 1.2
    """[m/s] Their velocities differ by at most this, and"""
    speed_sigma: NonNegative = 2.0
    """[-] so many standard deviations."""
    hold_s: NonNegative = 5.0
    """[s] Parts for so long remain parts up to"""
    hold: Positive = 1.5
    """[-] so many times all these limits."""
    lead_s: NonNegative = 2.0
    """[s] A part that leads, or that more sources see, for so long is the vessel from then on."""
    lead_m: Positive = 8.0
    """[m] So much farther ahead counts as much as a further source;"""
    lead: NonNegative = 0.5
    """[-] and by so much it must win."""


@dataclass(slots=True)
class Presence:
    """What is known of a track's existence."""

    existence: float
    """[-] Probability that there is something."""
    first_N: Float64
    """[m] [N] (2,) Where it was detected first,"""
    first_R: Float64
    """[m2] (2, 2) with this noise,"""
    first_ns: int
    """[ns] then."""
    key: tuple[int, int]
    """Number of the look and of the detection that started it: the same in every repetition."""
    hits: int = 1
    """[-] Looks that most probably detected it."""
    moved: bool = False
    """Whether it has ever moved."""
    sources: frozenset[str] = frozenset()
    """Those that have detected it."""
    visible: dict[str, float] = field(default_factory=dict)
    """[-] Probability that a source can see it, if it exists."""
    part_of: tuple[int, int] | None = None
    """Key of the vessel of which it is a part."""
    part_since_ns: int = 0
    """[ns] Since when."""


def visibility(presence: Presence, name: str, source: SourceSettings, dt: float) -> float:
    """Give the probability that a source can see a track, `dt` [s] after it was last asked."""
    known = presence.visible.get(name, source.visible)
    return source.visible + (known - source.visible) * math.exp(-dt / source.visible_s)


def in_sector(
    offset_N: Float64, heading: float, sector_rad: tuple[float, float]
) -> NDArray[np.bool_]:
    """Tell which offsets (K, 2) [m] from a sensor lie in its sector, clockwise from `heading`."""
    first, last = sector_rad
    width = last - first
    if width >= 2.0 * math.pi - 1e-9:
        return np.ones(len(offset_N), np.bool_)
    bearing = np.arctan2(offset_N[:, 1], offset_N[:, 0])
    inside: NDArray[np.bool_] = (bearing - heading - first) % (2.0 * math.pi) <= width
    return inside


def shadowed(
    offset_N: Float64, hides: NDArray[np.bool_], settings: ExistenceSettings
) -> NDArray[np.bool_]:
    """Tell which targets lie behind another one that hides what is behind it.

    Parameters
    ----------
    offset_N : (K, 2) float64
        Targets [m], from the sensor.
    hides : (K,) bool
        Whether each is sure enough to hide others.
    settings
        How wide a shadow is.
    """
    distance = np.hypot(offset_N[:, 0], offset_N[:, 1])
    near = np.flatnonzero(hides)
    if not len(near) or len(offset_N) < 2:
        return np.zeros(len(offset_N), np.bool_)
    u = offset_N[near] / np.maximum(distance[near], 1e-6)[:, None]
    along = offset_N @ u.T
    across = np.abs(offset_N[:, 1:] * u[:, 0] - offset_N[:, :1] * u[:, 1])
    at_the_front = across * distance[near] / np.maximum(distance, 1e-6)[:, None]
    behind = (along > 0.0) & (distance[:, None] > distance[near] + 3.0)
    return np.asarray((behind & (at_the_front < settings.shadow_m)).any(axis=1))


def has_moved(
    presence: Presence, position_N: Float64, P: Float64, settings: ExistenceSettings
) -> bool:
    """Tell whether a track is somewhere else than where it began."""
    if presence.moved or presence.hits < settings.moved_hits:
        return presence.moved
    d = position_N - presence.first_N
    if math.hypot(d[0], d[1]) <= settings.moved_m:
        return False
    S = P[:2, :2] + presence.first_R
    return float(d @ np.linalg.solve(S, d)) > settings.moved_sigma**2


class Clutter:
    """The density of detections of nothing, as a source's settings say and as it turns out.

    In each ring of distance the number of false detections a look is Poisson with a rate that has a
    gamma prior worth one detection; what is old is forgotten exponentially.
    """

    __slots__ = ("_counts", "_last_ns", "_looks", "_prior", "_settings", "_size")

    def __init__(self, settings: SourceSettings) -> None:
        self._settings = settings
        if settings.measures == "bearing":
            self._size = np.array([2.0 * math.pi])
            self._prior = np.array([settings.clutter])
        else:
            self._size = math.pi * (RINGS_M[1:] ** 2 - RINGS_M[:-1] ** 2)
            near = RINGS_M[:-1] < settings.near_m
            self._prior = settings.clutter + settings.near_clutter * near
        self._counts = np.zeros(len(self._size))
        self._looks = np.zeros(len(self._size))
        self._last_ns = 0

    def copy(self) -> Clutter:
        """Give what is known now; it is not changed any more."""
        other = Clutter.__new__(Clutter)
        for name in Clutter.__slots__:
            setattr(other, name, getattr(self, name))
        return other

    def ring(self, distance: Float64) -> NDArray[np.intp]:
        """Give the ring of each distance (M,) [m]."""
        if len(self._size) == 1:
            return np.zeros(len(distance), np.intp)
        return np.clip(np.searchsorted(RINGS_M, distance) - 1, 0, len(self._size) - 1)

    def density(self, distance: Float64) -> Float64:
        """Give the density [1/m2 or 1/rad] at distances (M,) [m]."""
        learnt = (1.0 + self._counts) / (1.0 / self._prior + self._looks * self._size)
        known: Float64 = learnt[self.ring(distance)]
        return known

    def learn(self, stamp_ns: int, distance: Float64, false: Float64) -> None:
        """Take in a look: the probability (M,) that each detection belongs to no settled track."""
        if not self._settings.clutter_memory_s:
            return
        dt = (stamp_ns - self._last_ns) * 1e-9 if self._last_ns else 0.0
        kept = math.exp(-max(dt, 0.0) / self._settings.clutter_memory_s)
        counts = np.bincount(self.ring(distance), weights=false, minlength=len(self._size))
        self._counts = self._counts * kept + counts
        self._looks = self._looks * kept + 1.0
        self._last_ns = stamp_ns
