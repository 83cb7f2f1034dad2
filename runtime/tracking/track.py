"""One track: what is known of it, whether it is something, and when it is reported and dropped.

A track exists with a probability r; if it does, each source can see it at all with a probability v
(Markov, two states), and a look then detects it with the probability that the source's settings
give. What a look has not detected is thus evidence against existence only as far as that source
should have seen it. The boat's LiDAR, whose segmented scans hold next to no false objects, reports
by counts instead: a track that it has seen often enough is something.

Sources: Musicki, Evans (2004), Joint integrated probabilistic data association: JIPDA, IEEE Trans.
AES 40(3); Brekke, Hem, Tokle (2021), Multitarget tracking with multiple models and visibility:
derivation and verification on maritime radar data, IEEE J. Oceanic Eng. 46(4).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from operator import attrgetter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from twinscrew.runtime.messages.types import Float64
from twinscrew.runtime.settings import Count, Fraction, NonNegative, Positive, Settings
from twinscrew.runtime.tracking.detections import SourceSettings
from twinscrew.runtime.tracking.kalman import STATES
from twinscrew.runtime.tracking.lidar import LidarExtras

RINGS_M = np.array([0.0, 25.0, 50.0, 100.0, 200.0, 400.0, 800.0, 1600.0])
"""[m] Between these distances clutter is learnt as one density."""
NO_SHAPE = np.zeros(2)


class LifeSettings(Settings, frozen=True, kw_only=True):
    """The life of a track that the LiDAR sees."""

    birth_hits: Count = 3
    """[-] A track is reported once seen in this many"""
    birth_scans: Count = 5
    """[-] of its first this many scans; if it is not, it is dropped."""
    coast_s: NonNegative = 2.0
    """[s] A track unseen for longer is dropped; so is one unseen for longer than it was known."""
    join_share: Fraction = 0.85
    """[-] What is this near a track's centre, as a share of its radius, is a piece of it."""


class ExistenceSettings(Settings, frozen=True, kw_only=True):
    """When a track is reported and when it is dropped."""

    birth: Positive = 2e-6
    """[1/m2] Density of new targets in a look."""
    lifetime_s: Positive = 60.0
    """[s] How long a target typically stays in the area."""
    confirm: Fraction = 0.999
    """[-] A track that exists with this probability is reported,"""
    report: Fraction = 0.4
    """[-] for as long as it exists with this one,"""
    report_new: Fraction = 0.4
    """[-] or with this one until it has been detected"""
    new_hits: Count = 12
    """[-] so often: what soon is not seen any more was clutter."""
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


@dataclass(frozen=True, slots=True)
class Named:
    """What a vessel says of itself, as AIS tells it."""

    identity: str
    """The same in all its reports, and in no other vessel's."""
    name: str
    """What people call it."""
    half_length_m: float
    """[m] Half its length; NaN: not told."""
    half_beam_m: float
    """[m] Half its beam; NaN: not told."""
    radius_m: float
    """[m] Of a circle about its hull; a guess where it has told no size."""
    heading: float
    """[rad] [N] Where its bow points; NaN: not told."""
    until_ns: int
    """[ns] Without another report it is not believed any longer than this."""


@dataclass(frozen=True, slots=True)
class Hull:
    """The outline of a long vessel that the LiDAR follows as one thing (`ships`)."""

    half_length: float
    """[m]"""
    half_beam: float
    """[m]"""
    heading: float
    """[rad] [N] Where it points: ahead, if it goes ahead."""
    rest_s: float = 0.0
    """[s] For so long it has been seen at rest."""

    @property
    def radius(self) -> float:
        """[m] Of the circle about it."""
        return math.hypot(self.half_length, self.half_beam)


class Track:
    """What is known of one object. Arrays and mappings are replaced, never changed."""

    __slots__ = (
        "P",
        "age_s",
        "apart_ns",
        "confirmed",
        "detections",
        "existence",
        "extras",
        "first_N",
        "first_R",
        "first_ns",
        "hits",
        "hull",
        "id",
        "key",
        "known_s",
        "moved",
        "named",
        "part_of",
        "part_since_ns",
        "radius",
        "scans",
        "shape_m2",
        "sources",
        "visible",
        "x",
    )

    def __init__(
        self,
        x: Float64,
        P: Float64,
        *,
        key: tuple[int, int],
        source: str,
        stamp_ns: int,
        first_R: Float64,
        radius: float,
        existence: float,
        extras: LidarExtras | None = None,
        shape_m2: Float64 | None = None,
    ) -> None:
        """Start from one detection.

        Parameters
        ----------
        x, P : (6,), (6, 6) float64
            State and covariance.
        key
            Numbers of the look and of the detection in it: the same whenever it is taken in again.
        source, stamp_ns
            Who detected it, and when.
        first_R : (2, 2) float64
            The noise of that detection [m2].
        radius
            Its radius [m].
        existence
            Probability that it is something.
        extras
            What a LiDAR saw of it; None if it was not the LiDAR.
        shape_m2 : (2,) float64
            Variance of the visible centroid about the centre, along and across [m2].
        """
        self.x, self.P, self.radius, self.extras = x, P, radius, extras
        self.id, self.confirmed, self.key = -1, False, key
        self.hits = self.scans = int(extras is not None)  # of LiDAR scans
        self.known_s = self.age_s = 0.0
        self.existence, self.detections, self.moved = existence, 1, False
        self.first_N, self.first_R, self.first_ns = x[:2], first_R, stamp_ns
        self.sources = frozenset((source,))
        self.visible: dict[str, float] = {}
        self.shape_m2: Float64 = NO_SHAPE if shape_m2 is None else shape_m2
        self.part_of: tuple[int, int] | None = None
        self.part_since_ns = 0
        self.apart_ns: int | None = None
        self.named: Named | None = None
        self.hull: Hull | None = None

    @property
    def at_rest(self) -> bool:
        """True if it was last seen as a piece of something long that lies at rest."""
        return self.extras is not None and self.extras.at_rest is True

    def predicted(self, dt: float, x: Float64, P: Float64) -> None:
        """Be what was predicted for `dt` [s] later."""
        self.x, self.P = x, P
        self.known_s += dt
        self.age_s += dt

    def seen(self, x: Float64, P: Float64, radius: float, extras: LidarExtras) -> None:
        """Be what a LiDAR scan has made of it."""
        self.x, self.P = x, P
        self.radius, self.extras = radius, extras
        self.hits += 1
        self.age_s = 0.0

    def saved(self) -> tuple[Any, ...]:
        """Give all that is known, for `restored`."""
        known: tuple[Any, ...] = _ALL(self)
        return known

    @classmethod
    def restored(cls, saved: tuple[Any, ...]) -> Track:
        """Give a track as it was."""
        track = cls.__new__(cls)
        for name, value in zip(cls.__slots__, saved, strict=True):
            setattr(track, name, value)
        return track


_ALL = attrgetter(*Track.__slots__)


def is_born(track: Track, settings: LifeSettings) -> bool:
    """Tell whether the LiDAR has seen a track often enough to report it.

    A piece of something long at rest is reported at once: that has been seen for long enough.
    """
    return not track.confirmed and (track.hits >= settings.birth_hits or track.at_rest)


def lives(track: Track, settings: LifeSettings) -> bool:
    """Tell whether to keep a track, by how often and how lately the LiDAR has seen it."""
    if not track.confirmed:
        missed = track.scans - track.hits
        return missed <= settings.birth_scans - settings.birth_hits
    seen_for = track.known_s - track.age_s
    return track.age_s <= min(settings.coast_s, seen_for)


def is_absorbed(track: Track, tracks: Sequence[Track], settings: LifeSettings) -> bool:
    """Tell whether an unseen track lies within the circle of a seen one: it was its piece."""
    if track.age_s == 0.0:
        return False
    north, east = track.x[:2]
    return any(
        other.confirmed
        and other.age_s == 0.0
        and math.hypot(other.x[0] - north, other.x[1] - east) <= settings.join_share * other.radius
        for other in tracks
    )


def states(tracks: Sequence[Track]) -> tuple[Float64, Float64]:
    """Give states and covariances, (K, 6) and (K, 6, 6)."""
    if not tracks:
        return np.empty((0, STATES)), np.empty((0, STATES, STATES))
    x, P = np.concatenate([t.x for t in tracks]), np.concatenate([t.P for t in tracks])
    return x.reshape(-1, STATES), P.reshape(-1, STATES, STATES)


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


def least_reported(track: Track, settings: ExistenceSettings) -> float:
    """Give with which probability a track must exist to be reported."""
    return settings.report_new if track.detections < settings.new_hits else settings.report


def has_moved(track: Track, settings: ExistenceSettings) -> bool:
    """Tell whether a track is, or has ever been, somewhere else than where it began."""
    if track.moved or track.detections < settings.moved_hits:
        return track.moved
    d = track.x[:2] - track.first_N
    if math.hypot(d[0], d[1]) <= settings.moved_m:
        return False
    S = track.P[:2, :2] + track.first_R
    return float(d @ np.linalg.solve(S, d)) > settings.moved_sigma**2


def sigma_m(P: Float64) -> float:
    """[m] Give the standard deviation of a position, the mean of both axes."""
    return math.sqrt(0.5 * (P[0, 0] + P[1, 1]))


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
