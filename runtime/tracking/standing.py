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

from twinscrew.runtime._native import FreeWater
from twinscrew.runtime.messages.types import NANOSECONDS_PER_SECOND, Float64, Objects, Outline
from twinscrew.runtime.settings import NonNegative, Positive, Settings
from twinscrew.runtime.tracking.measurement import Stand

UNKNOWN, FREE, TAKEN = range(3)
"""What a scan has shown of a place."""


class StandingSettings(Settings, frozen=True, kw_only=True):
    """When a long object is taken to stand."""

    least_s: Positive = 1.0
    """[s] The outlines that are compared lie at least this far apart, and"""
    most_s: Positive = 2.0
    """[s] if the long object was in sight for so long, this far."""
    margin_m: Positive = 0.5
    """[m] How deep in free water an echo must lie to tell of motion."""
    height_m: NonNegative = 0.2
    """[m] A beam must have passed this far below an echo: the boat heaves, and beams have gaps."""
    guard_rad: NonNegative = 0.0175
    """[rad] How far to either side the water must be as free: headings are not exact."""
    least_rad: Positive = 0.01
    """[rad] Over so wide an angle echoes must tell of it."""
    sigma_mps: Positive = 0.1
    """[m/s] Standard deviation of each velocity component of what stands."""
    slide_mps: Positive = 3.0
    """[m/s] How fast pieces of what stands may slide along it."""

    def __post_init__(self) -> None:
        """Refuse times between which no outline lies."""
        if self.least_s > self.most_s:
            raise ValueError("least_s must not be greater than most_s")


class Echoes(NamedTuple):
    """Those of long objects in an outline."""

    p_N: Float64
    """[m] (L, 2)"""
    height_m: Float64
    """[m] (L,)"""
    whose: NDArray[np.int64]
    """(L,) The objects' numbers."""


class Look:
    """What a scan's outline says, seen from a place in N; prepared when it is first asked for."""

    def __init__(
        self, stamp_ns: int, outline: Outline, own: Stand, settings: StandingSettings
    ) -> None:
        self.stamp_ns = stamp_ns
        self.outline = outline
        self._own = own
        self._settings = settings

    @cached_property
    def long(self) -> Echoes:
        """The echoes of long objects."""
        outline = self.outline
        is_long = outline.seen >= 0
        p_N = self._own.in_N(outline.boundary_L[is_long])
        return Echoes(p_N, outline.height_m[is_long], outline.seen[is_long])

    def ask(self, echoes: Echoes) -> tuple[NDArray[np.int8], NDArray[np.int64]]:
        """Tell what is known of the places of another scan's echoes, and who takes them, (L,)."""
        settings, places_L = self._settings, self._own.in_L(echoes.p_N)
        return self._water.ask(places_L, echoes.height_m - settings.height_m, settings.margin_m)

    @cached_property
    def _water(self) -> FreeWater:
        """In the levelled frame L of the place."""
        outline = self.outline
        return FreeWater(
            sights=outline.boundary_L,
            heights=outline.height_m,
            seen=outline.seen,
            begin=outline.sensor_L.tolist(),
            sector=outline.sector_rad,
            guard=self._settings.guard_rad,
            is_closed=outline.is_closed,
            elevations=outline.elevation_rad,
            down=outline.down_L.tolist(),
            least=outline.least_m,
        )


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

        True if it is, False if the long one moves; None if the object is no piece, or if nothing of
        its long one's places is known yet.
        """
        unknown: list[bool | None] = [None] * len(objects.radius)
        if objects.outline is None or not own.is_known:
            self.reset()
            return unknown
        now = Look(objects.stamp_ns, objects.outline, own, self.settings)
        before = self._before(now.stamp_ns)
        self._looks.append(now)
        cut_from = objects.outline.cut_from.tolist()
        if max(cut_from, default=-1) < 0:
            return unknown
        known: dict[int, bool] = {}
        for then in before:
            if any(number >= 0 and number not in known for number in cut_from):
                known = self._compared(then, now) | known
        return [known.get(number) for number in cut_from]

    def _before(self, stamp_ns: int) -> Sequence[Look]:
        """Give the outlines to compare with: the oldest, and the latest that is old enough."""
        settings, looks = self.settings, self._looks
        most_ns = stamp_ns - round(settings.most_s * NANOSECONDS_PER_SECOND)
        while len(looks) > 1 and looks[1].stamp_ns <= most_ns:
            looks.popleft()
        least_ns = stamp_ns - round(settings.least_s * NANOSECONDS_PER_SECOND)
        old = [look for look in looks if look.stamp_ns <= least_ns]
        return old if len(old) < 2 else (old[0], old[-1])

    def _compared(self, then: Look, now: Look) -> dict[int, bool]:
        """Tell by their numbers now which long objects stand, as far as two outlines tell."""
        answers, _ = then.ask(now.long)
        size = int(now.long.whose.max(initial=-1)) + 1
        came = np.bincount(now.long.whose[answers == FREE], minlength=size)
        met = np.bincount(now.long.whose[answers == TAKEN], minlength=size)
        for number, gone in _gone(then, now).items():
            came[number] += gone
        sectors = self.settings.least_rad / now.outline.sector_rad
        moves, stands = came >= sectors, met >= sectors
        return {k: not moves[k] for k in range(size) if moves[k] or stands[k]}


def _gone(then: Look, now: Look) -> dict[int, int]:
    """Count the echoes whose places are free now, by what is where most of their object's were."""
    answers, taker = now.ask(then.long)
    counts: dict[int, int] = {}
    for number in np.unique(then.long.whose[answers == FREE]).tolist():
        mine = then.long.whose == number
        takers = taker[mine & (taker >= 0)]
        if len(takers):
            gone = int(np.count_nonzero(answers[mine] == FREE))
            heir = int(np.bincount(takers).argmax())
            counts[heir] = counts.get(heir, 0) + gone
    return counts
