"""Harbours for E episodes at once: contours, contacts with edges, and the goal along each way.

Harbours are drawn once (`harbours.draw_harbour`) and packed: edges as pairs of complex numbers,
north + i east [m], and each vessel's way as points at equal distances. A vessel is shown the
farthest point of its way that lies in a straight line from it, as a route planned anew would.
"""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from twinscrew.runtime.charts.contour import (
    CONTOUR_RANGE_M,
    SECTORS,
    nearest_point,
    sector_distances,
)
from twinscrew.runtime.messages.types import Float32, Float64
from twinscrew.runtime.settings import Count, Fraction, NonNegative, Positive, Settings
from twinscrew.training.harbours import Harbour, HarbourSettings, Kind, draw_harbour

Mask = NDArray[np.bool_]
Index = NDArray[np.intp]
Complex64 = NDArray[np.complex64]
Points = NDArray[np.complex128]

SIGHT_SHARE = 0.8
"""[-] The straight line to the goal that is shown keeps this share of the way's own clearance,"""
MOST_ROOM_M = 5.0
"""[m] of which more than this does not count: one hull length."""
WAY_POINTS = 24
"""[-] Points along a way,"""
BACK, FORTH = 3, 8
"""[-] of which so many before, and behind, the last one that was shown are looked for first."""
NOWHERE = 1e6
"""[m] Where edges lie that are not there."""


class LandSettings(Settings, frozen=True):
    """How harbours are drawn, and how their edges are seen; where a scenario asks for harbours."""

    harbours: Count = 4096
    """[-] How many different ones there are of each row; drawn when first needed."""
    seed: int = 0
    """[-] Of these harbours."""
    gap_beams: tuple[Positive, Positive] = (1.6, 4.0)
    """[-] Width of the gap of kind "gap", in beams."""
    look_ahead_m: tuple[Positive, Positive] = (12.0, 50.0)
    """[m] The goal is shown at most so far ahead along the way; drawn for every episode."""
    partly_known: Fraction = 0.0
    """[-] Share of the episodes in which edges are known only as far as they are seen,"""
    least_range_m: Positive = 10.0
    """[m] which is anywhere between this and the contour's range."""
    noise_m: NonNegative = 0.0
    """[m] Standard deviation of a contour's distances,"""
    noise_share: NonNegative = 0.0
    """[-] and the same as a share of the distance."""
    lost: Fraction = 0.0
    """[-] Chance that a sector shows nothing, at any decision."""
    offset_m: NonNegative = 0.0
    """[m] Standard deviation of a lasting error, north and east, of the place on the chart."""


class Packed(NamedTuple):
    """One harbour, as the environment needs it."""

    start: Complex64
    """(S,) [m] Where each edge begins,"""
    end: Complex64
    """(S,) [m] and ends."""
    fence: Mask
    """(S,) Whether it is a fence or a keep-out area's: no sensor sees it."""
    harbour: Harbour
    way: Complex64
    """(V, WAY_POINTS) [m] Along each vessel's way, from its start to its goal."""
    rest: Float32
    """(V, WAY_POINTS) [m] From each of them on to the goal."""


@lru_cache(maxsize=16384)
def harbour_of(settings: HarbourSettings, seed: int, number: int) -> Packed:
    """Draw harbour `number` of a seed, the same at every call."""
    harbour = draw_harbour(np.random.default_rng([seed, number]), settings)
    edges = harbour.edges
    corners = (edges[..., 0] + 1j * edges[..., 1]).reshape(-1, 2)
    land = sum(len(ring) for ring in harbour.land)
    ways = [_along(way) for way in harbour.ways]
    return Packed(
        corners[:, 0].astype(np.complex64),
        corners[:, 1].astype(np.complex64),
        np.arange(len(corners)) >= land,
        harbour,
        *(np.stack(parts) for parts in zip(*ways, strict=True)),
    )


def harbour_settings(
    kinds: tuple[Kind, ...], vessels: int, hull: tuple[float, float], land: LandSettings
) -> HarbourSettings:
    """Give how the harbours of a row are drawn, for hulls of a length and a beam [m]."""
    return HarbourSettings(
        kinds=kinds,
        vessels=vessels,
        length_m=hull[0],
        beam_m=hull[1],
        gap_beams=land.gap_beams,
    )


def _along(way: Float64) -> tuple[Complex64, Float32]:
    """Give a way's points, and what is left of it from each of them [m]."""
    legs = way[:, 0] + 1j * way[:, 1]
    passed = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(legs)))])
    at = np.linspace(0.0, passed[-1], WAY_POINTS)
    point = np.interp(at, passed, legs.real) + 1j * np.interp(at, passed, legs.imag)
    rest = (passed[-1] - at).astype(np.float32)
    return point.astype(np.complex64), rest


class Land:
    """What is fixed in E episodes, and V vessels' ways through it; arrays change in place."""

    def __init__(self, shape: tuple[int, int], settings: LandSettings) -> None:
        self.settings, self.shape = settings, shape
        episodes = shape[0]
        self.there = np.zeros(episodes, bool)
        """(E,) Whether anything is fixed."""
        self.start = np.full((episodes, 0), NOWHERE, np.complex64)
        """(E, S) [m]"""
        self.end = self.start.copy()
        """(E, S) [m]"""
        self.fence = np.zeros((episodes, 0), bool)
        """(E, S)"""
        self.way = np.zeros((*shape, WAY_POINTS), np.complex64)
        self.rest = np.zeros((*shape, WAY_POINTS), np.float32)
        self.at = np.zeros(shape, np.intp)
        """(E, V) Which point of its way each vessel is shown."""
        self.shown = np.zeros(shape, complex)
        """(E, V) [m] Where it is; the goal itself at the end, and in open water."""
        self.beyond = np.zeros(shape)
        """(E, V) [m] What is left of the way from there."""
        self._decisions = np.zeros(episodes, np.intp)
        self.room_m = np.zeros(shape)
        """(E, V) [m] The clearance of each vessel's way."""
        self.most = np.zeros(shape, np.intp)
        """(E, V) The goal is shown at most so many points ahead."""
        self.reach = np.full(episodes, CONTOUR_RANGE_M, np.float32)
        """(E,) [m] Edges are known so far."""
        self.offset = np.zeros(shape, np.complex64)
        """(E, V) [m] Lasting error of each vessel's place on the chart."""

    def begin(self, slots: Index, harbours: list[Packed | None], chance: Float64) -> None:
        """Put harbours, or open water, in some slots; `chance` is (n, V + 1, chances)."""
        s = self.settings
        room = max((len(one.start) for one in harbours if one is not None), default=0)
        self._widen(room)
        self.there[slots] = False
        self.start[slots] = self.end[slots] = NOWHERE
        self.at[slots] = self._decisions[slots] = 0
        for k, (slot, one) in enumerate(zip(slots.tolist(), harbours, strict=True)):
            if one is None:
                continue
            self.there[slot] = True
            count, vessels = len(one.start), len(one.way)
            self.start[slot, :count], self.end[slot, :count] = one.start, one.end
            self.fence[slot, :count] = one.fence
            self.room_m[slot, :vessels] = np.minimum(one.harbour.clearance_m, MOST_ROOM_M)
            self.way[slot, :vessels], self.rest[slot, :vessels] = one.way, one.rest
            low, high = s.look_ahead_m
            dice = chance[k, -1, 5:8]
            far = low + (high - low) * dice[0]
            spacing = np.maximum(one.rest[:, 0], 1.0) / (WAY_POINTS - 1)
            self.most[slot, :vessels] = np.maximum(far / spacing, 1.0)
            known = CONTOUR_RANGE_M
            if dice[1] < s.partly_known:
                known = s.least_range_m + (known - s.least_range_m) * float(dice[2])
            self.reach[slot] = known
            size = np.sqrt(-2.0 * np.log1p(-chance[k, :-1, 13]))
            self.offset[slot] = s.offset_m * size * np.exp(2j * np.pi * chance[k, :-1, 14])

    def _widen(self, room: int) -> None:
        more = room - self.start.shape[1]
        if more > 0:
            pad = ((0, 0), (0, more))
            self.start = np.pad(self.start, pad, constant_values=NOWHERE)
            self.end = np.pad(self.end, pad, constant_values=NOWHERE)
            self.fence = np.pad(self.fence, pad)

    def follow(self, slots: Index, position: Points, goal: Points, active: Mask) -> None:
        """Choose the goals that are shown in some slots, from places and goals (E, V).

        That is the farthest point of a vessel's way to which a straight line keeps nearly the
        clearance that the way has, at most `look_ahead_m` beyond the nearest such point; where no
        line does, the nearest point with no edge before it; and where there is none, the last one
        stays. It is looked for at every other decision, near the last one first.
        """
        self.shown[slots], self.beyond[slots] = goal[slots], 0.0
        slots = slots[self.there[slots]]
        if not slots.size:
            return
        looking = slots[self._decisions[slots] % 2 == 0]
        n, v = np.nonzero(active[looking])
        e = looking[n]
        near = self.at[e, v][:, None] + np.arange(-BACK, FORTH + 1)
        found = self._look(e, v, position[e, v], np.clip(near, 0, WAY_POINTS - 1))
        found &= self._decisions[e] > 0
        e, v = e[~found], v[~found]
        every = np.broadcast_to(np.arange(WAY_POINTS), (len(e), WAY_POINTS))
        self._look(e, v, position[e, v], every)
        self._decisions[slots] += 1
        at = self.at[slots][..., None]
        there = np.take_along_axis(self.way[slots], at, axis=-1)[..., 0]
        self.shown[slots] = np.where(at[..., 0] == WAY_POINTS - 1, goal[slots], there)
        self.beyond[slots] = np.take_along_axis(self.rest[slots], at, axis=-1)[..., 0]

    def _look(self, e: Index, v: Index, position: Points, points: Index) -> Mask:
        """Look for the farthest of some points of their ways, (r, C), for r vessels at places.

        Tells for which of them there was one with room enough.
        """
        place = position.astype(np.complex64)[:, None]
        off = np.take_along_axis(self.way[e, v], points, axis=-1) - place
        clear = wide = np.ones(off.shape, bool)
        if self.start.shape[1]:
            start, end = self.start[e] - place, self.end[e] - place
            own_m = np.abs(nearest_point(start, end)).min(axis=-1)
            start, way = start[:, None], (end - start)[:, None]
            x, y = off.real[..., None], off.imag[..., None]
            # The sight crosses an edge if each has the other's ends on both of its sides.
            turn = x * way.imag - y * way.real
            before = x * start.imag - y * start.real
            own = start.real * way.imag - start.imag * way.real
            crossed = ((before > 0) != (before + turn > 0)) & ((own > 0) != (own - turn > 0))
            clear = ~crossed.any(axis=-1)
            square = np.maximum(x * x + y * y, 1e-6)
            along = np.clip((x * start.real + y * start.imag) / square, 0.0, 1.0)
            aside, beside = start.real - along * x, start.imag - along * y
            apart = np.sqrt((aside * aside + beside * beside).min(axis=-1))
            room_m = SIGHT_SHARE * np.minimum(self.room_m[e, v], own_m)
            wide = clear & (apart >= room_m[:, None])
        far, rows = np.abs(off), np.arange(len(e))
        near = points[rows, np.where(wide, far, np.inf).argmin(axis=-1)]
        ahead = points <= (near + self.most[e, v])[:, None]
        target = np.where(wide & ahead, points, -1).max(axis=-1, initial=-1)
        nearest = points[rows, np.where(clear, far, np.inf).argmin(axis=-1)]
        otherwise = np.where(clear.any(axis=-1), nearest, self.at[e, v])
        self.at[e, v] = np.where(target < 0, otherwise, target)
        return np.asarray(target >= 0)

    def contours(self, position: Points, heading: Float64, observers: Mask) -> Float32:
        """Give what each observer, (E, V), is shown of the edges, (E, V, SECTORS) [m]."""
        contour = np.full((*self.shape, SECTORS), CONTOUR_RANGE_M, np.float32)
        e = np.flatnonzero(self.there)
        if not e.size or not self.start.shape[1]:
            return contour
        place = (position[e] + self.offset[e]).astype(np.complex64)[..., None]
        start, end = self.start[e][:, None] - place, self.end[e][:, None] - place
        near = np.abs(nearest_point(start, end)) < self.reach[e][:, None, None]
        near &= observers[e][..., None]
        n, o, k = np.nonzero(near)
        if not n.size:
            return contour
        turn = np.exp(-1j * heading[e]).astype(np.complex64)[n, o]
        found = sector_distances(
            start[n, o, k] * turn, end[n, o, k] * turn, CONTOUR_RANGE_M, SECTORS
        )
        observer = n * self.shape[1] + o
        first = np.flatnonzero(np.diff(observer, prepend=-1))
        least = np.minimum.reduceat(found, first, axis=0)
        least[least >= self.reach[e[n[first]]][:, None]] = CONTOUR_RANGE_M
        contour[e[n[first]], o[first]] = least
        return contour

    def touched(
        self, trajectory: Float64, headings: Float64, strayed: Float64, active: Mask, half: Float64
    ) -> tuple[Mask, Mask]:
        """Tell whose rectangle touched an edge of land, and one of a fence, both (E, V).

        Parameters
        ----------
        trajectory : (S + 1, 2, E, V) float64
            North, east [m] before and after each sub-step.
        headings : (S + 1, E, V) float64
            [rad]
        strayed : (E, V) float64
            [m] Farthest from the first place.
        active : (E, V) bool
            Who is on the water.
        half : (E, V, 2) float64
            [m] Half of length and beam.
        """
        quay, fence = np.zeros((2, *self.shape), bool)
        e = np.flatnonzero(self.there)
        if not e.size or not self.start.shape[1]:
            return quay, fence
        place = trajectory[0, 0, e] + 1j * trajectory[0, 1, e]
        start, end = (
            self.start[e][:, None] - place[..., None],
            self.end[e][:, None] - place[..., None],
        )
        reach = np.hypot(half[e, :, 0], half[e, :, 1]) + strayed[e]
        near = np.abs(nearest_point(start, end)) < reach[..., None]
        near &= active[e][..., None]
        n, o, k = np.nonzero(near)
        if not n.size:
            return quay, fence
        slot = e[n]
        own = trajectory[1:, 0, slot, o] + 1j * trajectory[1:, 1, slot, o]
        turn = np.exp(-1j * headings[1:, slot, o])
        a, b = (self.start[slot, k] - own) * turn, (self.end[slot, k] - own) * turn
        hit = crosses_box(a, b, half[slot, o]).any(axis=0)
        of_fence = self.fence[slot, k]
        quay[slot[hit & ~of_fence], o[hit & ~of_fence]] = True
        fence[slot[hit & of_fence], o[hit & of_fence]] = True
        return quay, fence


def crosses_box(start: Points, end: Points, half: Float64) -> Mask:
    """Tell which segments, (...), touch the box of half sizes (..., 2) around the origin [m]."""
    low, high = np.zeros(start.shape), np.ones(start.shape)
    for a, b, limit in (
        (start.real, end.real, half[..., 0]),
        (start.imag, end.imag, half[..., 1]),
    ):
        way = b - a
        way = np.where(np.abs(way) < 1e-12, 1e-12, way)
        one, other = (-limit - a) / way, (limit - a) / way
        low = np.maximum(low, np.minimum(one, other))
        high = np.minimum(high, np.maximum(one, other))
    return np.asarray(low <= high)


class ContourNoise:
    """Errors of contours, each slot's from its own stream, drawn `block` decisions ahead."""

    def __init__(
        self,
        settings: LandSettings,
        generators: list[np.random.Generator],
        vessels: int,
        block: int = 16,
    ) -> None:
        self._settings, self._generators = settings, generators
        self._shape, self._left = (block, vessels, SECTORS), 0

    def spoil(self, contour: Float32, reach: Float32) -> None:
        """Spoil contours (E, V, SECTORS) [m] in place; `reach` (E,) [m] is how far is known."""
        s = self._settings
        if s.noise_m + s.noise_share + s.lost <= 0.0:
            return
        if not self._left:
            drawn = [
                (g.standard_normal(self._shape, np.float32), g.random(self._shape, np.float32))
                for g in self._generators
            ]
            self._error = np.stack([one for one, _ in drawn], axis=1)
            self._dice = np.stack([one for _, one in drawn], axis=1)
            self._left = self._shape[0]
        self._left -= 1
        error, dice = self._error[self._left], self._dice[self._left]
        shown = contour < CONTOUR_RANGE_M
        wrong = contour + error * (s.noise_m + s.noise_share * contour)
        wrong = np.clip(wrong, 0.0, reach[:, None, None])
        contour[:] = np.where(shown & (dice >= s.lost), wrong, np.float32(CONTOUR_RANGE_M))
