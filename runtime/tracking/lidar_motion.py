"""What a LiDAR sees of motion: hull segments from scan to scan, and water that was free.

A centroid jumps as pitch and roll bring parts of a hull into sight. Two things do not. A *segment*,
what one row of beams sees of an object from end to end (`messages.types.Strips`), has moved as the
hull has if it is found again as long as before. And what moves comes to be where the sensor has
looked through before, or is gone from where it was, while a quay only ever appears where nothing
could be seen.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from twinscrew.runtime._native import FreeWater, ShiftFinder
from twinscrew.runtime.messages.types import NANOSECONDS_PER_SECOND, Float64, Objects, Outline
from twinscrew.runtime.settings import Count, NonNegative, Positive, Settings
from twinscrew.runtime.tracking.kalman import STATES, FilterBank
from twinscrew.runtime.tracking.lidar import LidarExtras, Viewpoint


class HullVelocitySettings(Settings, frozen=True, kw_only=True):
    """How strips are found again, and how far what they say can be trusted."""

    search_m: Positive = 0.3
    """[m] A strip is looked for this far from where its object's velocity would have brought it."""
    length_m: NonNegative = 0.03
    """[m] Two strips may differ by this much in length, and be the same,"""
    length_spacing: NonNegative = 1.5
    """[-] and by this share of the distance between neighbouring echoes."""
    sigma_m: Positive = 0.01
    """[m] White noise of a strip's mean: sensor, and waves that turn the object,"""
    spacing_sigma: NonNegative = 0.4
    """[-] and of where it ends, as a share of the distance between neighbouring echoes."""
    robust_sigma: Positive = 2.0
    """[-] A strip that is this many sigmas off what the others say has half a weight."""
    least_pairs: Count = 2
    """[-] With fewer strips nothing is said."""
    turn_radps: Positive = 0.6
    """[rad/s] Standard deviation of an object's turn rate."""
    floor_m: Positive = 0.015
    """[m] White noise of a displacement, however many strips agree."""
    max_age_s: Positive = 0.5
    """[s] Strips are not looked for after this long."""
    limit_sigma: Positive = 2.0
    """[-] Velocities beyond this Mahalanobis distance are trusted less the farther they are off."""
    astray: Positive = 0.4
    """[-] A centroid that seems to be off by this share of the radius tells that the strips lie:
    while it is, they are not asked."""


@dataclass(frozen=True, slots=True)
class MeasuredVelocity:
    """A velocity over ground, and its noise."""

    v_N: Float64
    """[m/s] [N] (2,)"""
    R: Float64
    """[m2/s2] [N] (2, 2)"""


class HullVelocity:
    """Measures velocities. It keeps the kernel's memory: one serves one thread at a time."""

    def __init__(self, settings: HullVelocitySettings) -> None:
        self.settings = settings
        self._find = ShiftFinder(
            search=settings.search_m,
            length=settings.length_m,
            spacing=settings.length_spacing,
            sigma=settings.sigma_m,
            ends=settings.spacing_sigma,
            robust=settings.robust_sigma,
            pairs=settings.least_pairs,
        )

    def measure(
        self,
        before: LidarExtras,
        after: LidarExtras,
        expected_N: tuple[float, float],
        centre_N: tuple[float, float],
    ) -> MeasuredVelocity | None:
        """Give an object's mean velocity between two scans; None if its strips do not tell.

        Parameters
        ----------
        before, after
            What the scans show of it.
        expected_N : (float, float)
            Its velocity as far as it is known [m/s].
        centre_N : (float, float)
            Its centre in the second scan [m]: the velocity is that of this place.
        """
        dt = (after.stamp_ns - before.stamp_ns) / NANOSECONDS_PER_SECOND
        if not 0.0 < dt <= self.settings.max_age_s:
            return None
        north, east = expected_N
        shift = self._find(
            before.segments_N,
            after.segments_N,
            (north * dt, east * dt),
            centre_N,
            self.settings.turn_radps * dt,
        )
        if not shift.pairs:
            return None
        floor, cross = self.settings.floor_m**2, shift.xy / dt**2
        R = [[(shift.xx + floor) / dt**2, cross], [cross, (shift.yy + floor) / dt**2]]
        return MeasuredVelocity(np.array([shift.x / dt, shift.y / dt]), np.array(R))


MEASURED = 4
"""[-] A centroid's two coordinates, and a velocity's."""
VELOCITY = np.eye(STATES)[2:4]
"""H of a measured velocity, (2, 6)."""
UNIT = np.eye(MEASURED)
"""R of what is not measured, which no row of H asks for."""


def corrected(
    bank: FilterBank,
    x: Float64,
    P: Float64,
    centroids: tuple[Float64, Float64, Float64],
    excess: Float64,
    velocities: Sequence[MeasuredVelocity | None],
    limit_sigma: float,
) -> tuple[Float64, Float64]:
    """Take in what was measured of N tracks.

    Parameters
    ----------
    x, P : (N, 6), (N, 6, 6) float64
        States and covariances.
    centroids
        z, H, R of the centroids, (N, 2), (N, 2, 6), (N, 2, 2).
    excess : (N,) float64
        See `jumps_to_bias`.
    velocities
        How fast each went since it was last seen, if that is known.
    limit_sigma : float
        See `inflated_noise`.
    """
    z, H = np.zeros((len(x), MEASURED)), np.zeros((len(x), MEASURED, STATES))
    R = np.broadcast_to(UNIT, (len(x), MEASURED, MEASURED)).copy()
    z[:, :2], H[:, :2], R[:, :2, :2] = centroids
    measured = np.array(
        [n for n, velocity in enumerate(velocities) if velocity is not None], np.intp
    )
    if len(measured):
        known = [velocity for velocity in velocities if velocity is not None]
        v_N, R_v = np.array([v.v_N for v in known]), np.array([v.R for v in known])
        z[measured, 2:], H[measured, 2:] = v_N, VELOCITY
        R[measured, 2:, 2:] = inflated_noise(v_N, R_v, x[measured], P[measured], limit_sigma)
    return bank.update(x, jumps_to_bias(P, centroids[1], centroids[2], excess), z, H, R)


def jumps_to_bias(P: Float64, H: Float64, R: Float64, excess: Float64) -> Float64:
    """Charge what is too large of an innovation to the bias.

    A vessel does not move by decimetres between two scans; its visible side does. What of the
    innovation exceeds some Mahalanobis distance is therefore charged to the bias: before the
    filter's own update its variance is raised by `excess` times the innovation's covariance, which
    brings the innovation to that distance.

    Parameters
    ----------
    P, H, R : (N, 6, 6), (N, 2, 6), (N, 2, 2) float64
        Covariances, and what the centroids say.
    excess : (N,) float64
        Squared Mahalanobis distance over the squared limit, less 1; nothing if negative.
    """
    jumped: NDArray[np.intp] = np.flatnonzero(excess > 0.0)
    if len(jumped) == 0:
        return P
    P, H = P.copy(), H[jumped]
    turn = H[:, :, 4:]  # the bias's axes in N, but for the sign
    S = H @ P[jumped] @ H.transpose(0, 2, 1) + R[jumped]
    P[jumped, 4:, 4:] += excess[jumped, None, None] * (turn.transpose(0, 2, 1) @ S @ turn)
    return P


def inflated_noise(v_N: Float64, R: Float64, x: Float64, P: Float64, limit_sigma: float) -> Float64:
    """Give velocities as much noise as brings them within a Mahalanobis distance.

    Strips can be mistaken for others. A bad velocity does the less harm the farther it is off; and
    if it was the filter that was wrong, it is told so again and again.

    Parameters
    ----------
    v_N, R : (N, 2), (N, 2, 2) float64
        What was measured.
    x, P : (N, 6), (N, 6, 6) float64
        What is expected.
    limit_sigma : float
        The distance [-].

    Returns
    -------
    R : (N, 2, 2) float64
        The noise to reckon with.
    """
    y, S = v_N - x[:, 2:4], P[:, 2:4, 2:4] + R
    (a, b), (c, d) = S.transpose(1, 2, 0)
    north, east = y.T
    distance2 = (d * north**2 + a * east**2 - (b + c) * north * east) / (a * d - b * c)
    excess = np.maximum(distance2 / limit_sigma**2 - 1.0, 0.0)
    raised: Float64 = R + excess[:, None, None] * S
    return raised


UNKNOWN, FREE, TAKEN = range(3)
"""What a scan has shown of a place."""


class LongObjectSettings(Settings, frozen=True, kw_only=True):
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
    number: NDArray[np.int64]
    """(L,) The objects' numbers."""


class OutlineView:
    """What a scan's outline says, seen from a place in N; prepared when it is first asked for."""

    def __init__(
        self, stamp_ns: int, outline: Outline, own: Viewpoint, settings: LongObjectSettings
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
        return self.water.ask(places_L, echoes.height_m - settings.height_m, settings.margin_m)

    @cached_property
    def water(self) -> FreeWater:
        """What the scan has shown of places, in the levelled frame L of its own place."""
        outline = self.outline
        return FreeWater(
            boundary=outline.boundary_L,
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


class LongObjects:
    """Remembers outlines for as long as they are compared."""

    def __init__(self, settings: LongObjectSettings) -> None:
        self.settings = settings
        self._outlines: deque[OutlineView] = deque()
        self.stands: dict[int, bool] = {}
        """Whether the latest outline's long objects stand, by number, where that is known."""

    def reset(self) -> None:
        """Forget what was seen."""
        self._outlines.clear()
        self.stands = {}

    @property
    def latest(self) -> OutlineView | None:
        """The latest outline; None if there is none."""
        return self._outlines[-1] if self._outlines else None

    def saved(self) -> tuple[OutlineView, ...]:
        """Give what is remembered, for `restore`."""
        return tuple(self._outlines)

    def restore(self, outlines: tuple[OutlineView, ...]) -> None:
        """Remember what was `saved`, and nothing else."""
        self._outlines = deque(outlines)

    def at_rest(self, objects: Objects, own: Viewpoint) -> Sequence[bool | None]:
        """Tell of each object whether it is a piece of a long one that stands.

        True if it is, False if the long one moves; None if the object is no piece, or if nothing of
        its long one's places is known yet.
        """
        unknown: list[bool | None] = [None] * len(objects.radius)
        if objects.outline is None or not own.is_known:
            self.reset()
            return unknown
        now = OutlineView(objects.stamp_ns, objects.outline, own, self.settings)
        before = self._before(now.stamp_ns)
        self._outlines.append(now)
        self.stands = {}
        cut_from = objects.outline.cut_from.tolist()
        if max(cut_from, default=-1) < 0:
            return unknown
        known: dict[int, bool] = {}
        for then in before:
            if any(number >= 0 and number not in known for number in cut_from):
                known = self._compared(then, now) | known
        self.stands = known
        return [known.get(number) for number in cut_from]

    def _before(self, stamp_ns: int) -> Sequence[OutlineView]:
        """Give the outlines to compare with: the oldest, and the latest that is old enough."""
        settings, outlines = self.settings, self._outlines
        most_ns = stamp_ns - round(settings.most_s * NANOSECONDS_PER_SECOND)
        while len(outlines) > 1 and outlines[1].stamp_ns <= most_ns:
            outlines.popleft()
        least_ns = stamp_ns - round(settings.least_s * NANOSECONDS_PER_SECOND)
        old = [view for view in outlines if view.stamp_ns <= least_ns]
        return old if len(old) < 2 else (old[0], old[-1])

    def _compared(self, then: OutlineView, now: OutlineView) -> dict[int, bool]:
        """Tell by their numbers now which long objects stand, as far as two outlines tell."""
        answers, _ = then.ask(now.long)
        size = int(now.long.number.max(initial=-1)) + 1
        came = np.bincount(now.long.number[answers == FREE], minlength=size)
        met = np.bincount(now.long.number[answers == TAKEN], minlength=size)
        for number, gone in _gone(then, now).items():
            came[number] += gone
        sectors = self.settings.least_rad / now.outline.sector_rad
        moves, stands = came >= sectors, met >= sectors
        return {k: not moves[k] for k in range(size) if moves[k] or stands[k]}


def _gone(then: OutlineView, now: OutlineView) -> dict[int, int]:
    """Count the echoes whose places are free now, by what is where most of their object's were."""
    answers, taker = now.ask(then.long)
    counts: dict[int, int] = {}
    for number in np.unique(then.long.number[answers == FREE]).tolist():
        mine = then.long.number == number
        takers = taker[mine & (taker >= 0)]
        if len(takers):
            gone = int(np.count_nonzero(answers[mine] == FREE))
            now_at = int(np.bincount(takers).argmax())
            counts[now_at] = counts.get(now_at, 0) + gone
    return counts
