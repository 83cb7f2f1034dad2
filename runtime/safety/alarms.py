"""Tells of vessels that come too near on present courses, early: closest approach, and when.

For a navigator a risk of collision is a bearing that does not change while the range closes
(COLREGs, rule 7 d). That is a miss distance near zero. How well it is known follows from the
track's covariance: a minute ahead, a velocity that is off by 0.3 m/s moves it by 18 m. So a vessel
is announced when it more probably than not comes nearer than the limit, for some seconds without a
break, and not because one report says so.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from twinscrew.runtime.geometry import rotation_from_quaternion
from twinscrew.runtime.messages.types import (
    NANOSECONDS_PER_SECOND,
    Float64,
    HealthEvent,
    Odometry,
    Tracks,
)
from twinscrew.runtime.safety.events import COLLISION_COURSE, COLLISION_COURSE_OVER
from twinscrew.runtime.settings import Fraction, NonNegative, Positive, Settings
from twinscrew.runtime.vessel_description import load_vessel

PART_M = 5.0
"""[m] What is so near a ship's outline is a part of it: positions by satellite are no better."""


class AlarmSettings(Settings, frozen=True, kw_only=True):
    """When a vessel is announced."""

    enabled: bool = True
    """Whether vessels are announced at all: where there is any of [senses]."""
    cpa_m: NonNegative = 10.0
    """[m] If its surface comes nearer than this to the own one,"""
    tcpa_s: Positive = 100.0
    """[s] within this time,"""
    probability: Fraction = 0.5
    """[-] more probably than this,"""
    confirm_s: NonNegative = 3.0
    """[s] for so long."""
    clear: Positive = 1.5
    """[-] It is over when it will pass at this times the limit, or has passed."""
    least_mps: Positive = 0.5
    """[m/s] What closes in more slowly is not announced."""
    own_time_s: Positive = 8.0
    """[s] Time constant over which the own velocity is averaged: waves are no course."""
    own_radius_m: NonNegative = load_vessel().radius_m
    """[m] Radius of the own hull."""


@dataclass(frozen=True, slots=True)
class Approaches:
    """How near each track comes on present courses."""

    miss_m: Float64
    """[m] (K,) Between the surfaces; negative: they touch."""
    time_s: Float64
    """[s] (K,) From now; infinite for what does not close in."""
    probability: Float64
    """[-] (K,) That it comes nearer than the limit."""
    speed_mps: Float64
    """[m/s] (K,) Relative."""


def approaches(
    tracks: Tracks, own_N: Float64, own_v_N: Float64, *, limit_m: float, own_radius_m: float
) -> Approaches:
    """Give the closest points of approach, and how surely they are too near.

    Parameters
    ----------
    tracks
        K of them.
    own_N, own_v_N : (2,) float64
        The own vessel's position [m] and velocity over ground [m/s], frame N.
    limit_m
        [m] Surfaces that come nearer than this are too near.
    own_radius_m
        [m] The own hull as a circle.
    """
    p, v = tracks.p_N - own_N, tracks.v_N - own_v_N
    speed = np.hypot(v[:, 0], v[:, 1])
    u = v / np.maximum(speed, 1e-6)[:, None]
    along = -(p * u).sum(axis=1)
    time_s = np.where(along > 0.0, along / np.maximum(speed, 1e-6), np.inf)
    n = np.column_stack([-u[:, 1], u[:, 0]])
    miss = (p * n).sum(axis=1)  # signed: on which side it passes
    t = np.minimum(time_s, 1e4)
    P = tracks.covariance
    variance = np.einsum("ki,kij,kj->k", n, P[:, :2, :2], n)
    variance += 2.0 * t * np.einsum("ki,kij,kj->k", n, P[:, :2, 2:], n)
    variance += t**2 * np.einsum("ki,kij,kj->k", n, P[:, 2:, 2:], n)
    sigma = np.sqrt(np.maximum(variance, 1e-4))
    hulls = tracks.radius + own_radius_m
    reach = hulls + limit_m
    near = [
        0.5 * (math.erf((r - m) / (s * math.sqrt(2))) - math.erf((-r - m) / (s * math.sqrt(2))))
        for r, m, s in zip(reach.tolist(), miss.tolist(), sigma.tolist(), strict=True)
    ]
    return Approaches(np.abs(miss) - hulls, time_s, np.array(near), speed)


class Alarms:
    """Remembers who was announced."""

    def __init__(self, settings: AlarmSettings | None = None) -> None:
        self.settings = settings or AlarmSettings()
        self.reset()

    def reset(self) -> None:
        """Forget everybody."""
        self._since_ns: dict[int, int] = {}
        self._announced: dict[int, tuple[str, int]] = {}
        self._own_v_N: Float64 | None = None
        self._last_ns = 0

    def step(self, odometry: Odometry, tracks: Tracks) -> tuple[HealthEvent, ...]:
        """Look at all tracks; give `collision_course` and `collision_course_over` events."""
        settings, stamp_ns = self.settings, tracks.stamp_ns
        if not settings.enabled:
            return ()
        own_v_N = self._averaged(odometry)
        found = approaches(
            tracks,
            odometry.position_N[:2],
            own_v_N,
            limit_m=settings.cpa_m,
            own_radius_m=settings.own_radius_m,
        )
        near = (found.time_s <= settings.tcpa_s) & (found.probability >= settings.probability)
        near &= found.speed_mps >= settings.least_mps
        near &= ~_parts(tracks)
        clear = ~np.isfinite(found.time_s)
        clear |= (found.miss_m > settings.clear * settings.cpa_m) & (found.probability < 0.3)
        events: list[HealthEvent] = []
        ids = tracks.id.tolist()
        for k, track in enumerate(ids):
            if track in self._announced:
                if not clear[k]:
                    self._announced[track] = self._announced[track][0], stamp_ns
                elif stamp_ns - self._announced[track][1] > settings.confirm_s * 1e9:
                    who, _ = self._announced.pop(track)
                    words = "has passed" if not np.isfinite(found.time_s[k]) else "will pass clear"
                    events.append(COLLISION_COURSE_OVER.at(stamp_ns, f"{who} {words}"))
            elif near[k]:
                since_ns = self._since_ns.setdefault(track, stamp_ns)
                if stamp_ns - since_ns >= settings.confirm_s * 1e9:
                    who = _who(tracks, k)
                    self._announced[track] = who, stamp_ns
                    words = _words(tracks, k, found, odometry)
                    events.append(COLLISION_COURSE.at(stamp_ns, f"{who} {words}"))
            else:
                self._since_ns.pop(track, None)
        self._forget(set(ids))
        return tuple(events)

    def _averaged(self, odometry: Odometry) -> Float64:
        """Give the own velocity over ground, north and east [m/s], averaged."""
        v_N: Float64 = (rotation_from_quaternion(odometry.q_NB) @ odometry.velocity_B)[:2]
        dt = (odometry.stamp_ns - self._last_ns) / NANOSECONDS_PER_SECOND
        self._last_ns = odometry.stamp_ns
        if self._own_v_N is None or not 0.0 <= dt <= 5.0:
            self._own_v_N = v_N
        else:
            keep = math.exp(-dt / self.settings.own_time_s)
            self._own_v_N = keep * self._own_v_N + (1.0 - keep) * v_N
        return self._own_v_N

    def _forget(self, there: set[int]) -> None:
        for gone in [track for track in self._since_ns if track not in there]:
            del self._since_ns[gone]
        for gone in [track for track in self._announced if track not in there]:
            del self._announced[gone]


def _parts(tracks: Tracks) -> NDArray[np.bool_]:
    """Tell which tracks, (K,), lie on the outline of another that has a name: it is announced."""
    parts = np.zeros(len(tracks.id), np.bool_)
    if tracks.name is None or tracks.half_length is None or tracks.half_beam is None:
        return parts
    unnamed = np.array([not name for name in tracks.name], np.bool_)
    for k in np.flatnonzero(~unnamed & np.isfinite(tracks.half_length)).tolist():
        reach = math.hypot(tracks.half_length[k], tracks.half_beam[k]) + PART_M
        d = tracks.p_N - tracks.p_N[k]
        parts |= unnamed & (np.hypot(d[:, 0], d[:, 1]) <= reach)
    return parts


def _who(tracks: Tracks, k: int) -> str:
    name = "" if tracks.name is None else tracks.name[k]
    return name or f"track {int(tracks.id[k])}"


def _words(tracks: Tracks, k: int, found: Approaches, odometry: Odometry) -> str:
    d = tracks.p_N[k] - odometry.position_N[:2]
    bearing = math.degrees(math.atan2(d[1], d[0])) % 360.0
    return (
        f"bearing {bearing:03.0f}, {math.hypot(*d):.0f} m: comes within "
        f"{max(float(found.miss_m[k]), 0.0):.0f} m in {float(found.time_s[k]):.0f} s"
    )
