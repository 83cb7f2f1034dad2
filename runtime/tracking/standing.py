"""Whether what is too long for a circle moves: by the free water it goes into, or leaves behind.

A quay is cut into pieces along the part of it that is seen, and that part goes along with the boat;
a wall looks the same everywhere, so nothing but its ends can tell that it stands. But what moves
comes to be where the sensor has looked through before, or is gone from where it was: a quay only
ever appears where nothing could be seen. So the outline of this scan is compared with that of one
some time ago, both in frame N.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from twinscrew.runtime._native import FreeWater, nearest_circles
from twinscrew.runtime.messages.types import NANOSECONDS_PER_SECOND, Float64, Objects, Outline
from twinscrew.runtime.settings import Positive, Settings
from twinscrew.runtime.tracking.measurement import Stand


class StandingSettings(Settings, frozen=True, kw_only=True):
    """When a long object is taken to stand."""

    least_s: Positive = 1.0
    """[s] The outlines that are compared lie at least this far apart, and"""
    most_s: Positive = 2.0
    """[s] if the long objects have been seen for so long, this far."""
    margin_m: Positive = 0.5
    """[m] How deep in free water an echo must lie to tell of motion."""
    guard_rad: Positive = 0.0175
    """[rad] How far to either side the water must be as free: headings are not exact."""
    least_rad: Positive = 0.01
    """[rad] Over so wide an angle echoes must tell of it."""
    near_m: Positive = 3.0
    """[m] What has gone from a place was part of a long object that is no farther than this now."""
    sigma_mps: Positive = 0.1
    """[m/s] Standard deviation of each velocity component of what stands."""
    slide_mps: Positive = 3.0
    """[m/s] How fast pieces of what stands may slide along it."""

    def __post_init__(self) -> None:
        """Refuse times between which no outline lies."""
        if self.least_s > self.most_s:
            raise ValueError("least_s must not be greater than most_s")


class Look:
    """What a scan's outline says, seen from a place in N; prepared when it is first asked for."""

    def __init__(self, stamp_ns: int, outline: Outline, own: Stand, guard_rad: float) -> None:
        self.stamp_ns = stamp_ns
        self._outline = outline
        self._own = own
        self._guard_rad = guard_rad

    @cached_property
    def long(self) -> tuple[Float64, NDArray[np.int64]]:
        """The echoes of long objects, (L, 2) [m] in N, and the objects' numbers, (L,)."""
        outline, own = self._outline, self._own
        is_long = outline.seen >= 0
        return outline.sights_B[is_long] @ own.R_NB.T + own.p_N, outline.seen[is_long]

    def saw_through(self, p_N: Float64, margin_m: float) -> NDArray[np.bool_]:
        """Tell which places, (L, 2), lie in free water, and so deep [m]."""
        own = self._own
        return self._water.holds((p_N - own.p_N) @ own.R_NB, margin_m)

    @cached_property
    def _water(self) -> FreeWater:
        """In the levelled frame B of the place."""
        outline = self._outline
        return FreeWater(
            sights=outline.sights_B,
            begin=outline.sensor_B.tolist(),
            sector=outline.sector_rad,
            guard=self._guard_rad,
            is_closed=outline.is_closed,
        )


class Circles(NamedTuple):
    """The pieces of long objects in a scan."""

    p_N: Float64
    """[m] (K, 2)"""
    radius: Float64
    """[m] (K,)"""
    cut_from: NDArray[np.int64]
    """(K,) The objects' numbers."""

    def nearest(self, p_N: Float64, near_m: float) -> NDArray[np.int64]:
        """Give the objects to which places, (L, 2), are nearest; none for those too far off."""
        nearest, away = nearest_circles(p_N, self.p_N, self.radius)
        objects: NDArray[np.int64] = self.cut_from[nearest[away < near_m]]
        return objects


class Standing:
    """Remembers outlines for as long as they are compared."""

    def __init__(self, settings: StandingSettings) -> None:
        self.settings = settings
        self._looks: deque[Look] = deque()

    def reset(self) -> None:
        """Forget what was seen."""
        self._looks.clear()

    def pieces(self, objects: Objects, own: Stand) -> Sequence[bool | None]:
        """Tell of each object whether it is a piece of a long one that stands.

        True if it is, False if the long one moves; None if the object is no piece, or if it is not
        known yet.
        """
        unknown: list[bool | None] = [None] * len(objects.radius)
        if objects.outline is None or not np.isfinite([*own.p_N, *own.R_NB[0]]).all():
            self.reset()
            return unknown
        now = Look(objects.stamp_ns, objects.outline, own, self.settings.guard_rad)
        then = self._before(now.stamp_ns)
        self._looks.append(now)
        cut_from = objects.outline.cut_from
        pieces = np.flatnonzero(cut_from >= 0)
        if then is None or len(pieces) == 0:
            return unknown
        pieces_N = objects.p_B[pieces] @ own.R_NB.T + own.p_N
        circles = Circles(pieces_N, objects.radius[pieces], cut_from[pieces])
        told_rad = self._told(then, now, circles) * objects.outline.sector_rad
        stands = (told_rad < self.settings.least_rad).tolist()
        known = set(circles.nearest(then.long[0], self.settings.margin_m).tolist())
        return [stands[number] if number in known else None for number in cut_from.tolist()]

    def _before(self, stamp_ns: int) -> Look | None:
        """Give the outline to compare with; none if it is not old enough."""
        settings, looks = self.settings, self._looks
        most_ns = stamp_ns - round(settings.most_s * NANOSECONDS_PER_SECOND)
        while len(looks) > 1 and looks[1].stamp_ns <= most_ns:
            looks.popleft()
        least_ns = stamp_ns - round(settings.least_s * NANOSECONDS_PER_SECOND)
        return looks[0] if looks and looks[0].stamp_ns <= least_ns else None

    def _told(self, then: Look, now: Look, pieces: Circles) -> NDArray[np.intp]:
        """Count the sectors that tell that a long object moves, by its number."""
        margin_m = self.settings.margin_m
        (now_N, seen), (then_N, _) = now.long, then.long
        came = seen[then.saw_through(now_N, margin_m)]
        went = pieces.nearest(then_N[now.saw_through(then_N, margin_m)], self.settings.near_m)
        return np.bincount(np.concatenate([came, went]), minlength=int(pieces.cut_from.max()) + 1)
