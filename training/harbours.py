"""Harbours drawn at random: land, fences, piles, starts, goals, a current, a way for each vessel.

Training and the simulator draw from here. Layouts are drawn in hull lengths, so that a harbour fits
any hull, and turned by any angle. Each vessel's way through the harbour is found on a visibility
graph (corners and piles moved outward by the clearance, and every leg between them that keeps it);
a draw without a way for every vessel is drawn anew, so each harbour that is given can be sailed.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Annotated, Literal, NamedTuple

import numpy as np
from msgspec import Meta
from numpy.random import Generator
from numpy.typing import ArrayLike, NDArray

from twinscrew.runtime.errors import ConfigError
from twinscrew.runtime.messages.types import Float64
from twinscrew.runtime.settings import NonNegative, Positive, Settings

Kind = Literal["basin", "channel", "dead_end", "fingers", "gap", "piles", "fenced", "mixed", "open"]
CurrentKind = Literal["steady", "shear", "vortex", "tide"]
Mask = NDArray[np.bool_]
Ring = Float64
"""(M, 2) [m] North and east of a polygon's corners; the last is joined to the first."""

REDRAWS = 200
"""[-] Draws without a way for every vessel, before the request counts as impossible."""
CANDIDATES = 64
"""[-] Places drawn at a time for one start or goal."""


class HarbourSettings(Settings, frozen=True):
    """What harbours are drawn; ranges are (least, greatest), drawn uniformly."""

    kinds: Annotated[tuple[Kind, ...], Meta(min_length=1)] = (
        "basin",
        "channel",
        "dead_end",
        "fingers",
        "gap",
        "piles",
        "mixed",
    )
    """One of these, each as likely; "fenced" is water within fences, "open" has nothing in it."""
    vessels: Annotated[int, Meta(ge=1, le=8)] = 3
    """[-] How many vessels."""
    length_m: Positive = 5.0
    """[m] Length of the longest hull: the unit of the layouts."""
    beam_m: Positive = 2.5
    """[m] Its beam."""
    gap_beams: tuple[Positive, Positive] = (1.6, 4.0)
    """[-] Width of the gap of kind "gap", in beams."""
    clearance_beams: Positive = 0.75
    """[-] Least distance of each vessel's way from everything fixed, in beams; half a beam is
    where a hull on that way would touch. Piles are passed as vessels are, at half a hull's diagonal
    at least: the circle around the hull keeps clear."""
    apart_lengths: NonNegative = 2.0
    """[-] Between any two starts, and between any two goals."""
    way_lengths: NonNegative = 4.0
    """[-] Least distance, as the crow flies, from a start to its goal."""
    height_m: tuple[Positive, Positive] = (1.0, 4.0)
    """[m] Of land and piles over the water."""
    current_mps: tuple[NonNegative, NonNegative] = (0.0, 0.0)
    """[m/s] Greatest speed of the current."""
    currents: Annotated[tuple[CurrentKind, ...], Meta(min_length=1)] = (
        "steady",
        "shear",
        "vortex",
        "tide",
    )
    """One of these, each as likely, where there is a current."""

    def __post_init__(self) -> None:
        """Refuse ranges that go down, and a gap that no hull can pass with the clearance."""
        for key in ("gap_beams", "height_m", "current_mps"):
            low, high = getattr(self, key)
            if low > high:
                raise ValueError(f"{key} must go from low to high, not from {low} to {high}")
        if self.gap_beams[0] < 2.0 * self.clearance_beams:
            raise ValueError(
                f"a gap of {self.gap_beams[0]} beams leaves no clearance of "
                f"{self.clearance_beams} beams on both sides"
            )


class CurrentField(NamedTuple):
    """Currents of the water; every field may have leading axes, for many harbours at once.

    The velocity at place p and time t is `mean` cos(2 pi t / period + phase) (1 + shear tanh(d /
    width)), d being the distance of p to starboard of the line through `centre` along `mean`, and
    beside it each vortex: around its centre the speed is `peak` 2 (r / core) / (1 + (r / core)^2),
    greatest at r = core (Scully's vortex).
    """

    mean: Float64
    """(..., 2) [m/s] [N] Towards north and east."""
    centre: Float64
    """(..., 2) [m] [N] Where the sheared current has its mean."""
    shear: Float64
    """(...) [-] [-1, 1] 0: the same everywhere."""
    width: Float64
    """(...) [m] Half of the current's change lies within this of the centre line, about."""
    period: Float64
    """(...) [s] Of the tide; infinite: steady."""
    phase: Float64
    """(...) [rad] Of the tide at time 0."""
    vortex: Float64
    """(..., K, 4) Centre north and east [m], core radius [m], peak speed [m/s], clockwise seen from
    above if positive."""

    @classmethod
    def of(
        cls,
        mean: ArrayLike = (0.0, 0.0),
        *,
        centre: ArrayLike = (0.0, 0.0),
        shear: ArrayLike = 0.0,
        width: ArrayLike = 1.0,
        period: ArrayLike = np.inf,
        phase: ArrayLike = 0.0,
        vortex: ArrayLike = (),
    ) -> CurrentField:
        """Give one field; without arguments the water stands still."""
        return cls(
            np.asarray(mean, np.float64),
            np.asarray(centre, np.float64),
            np.asarray(shear, np.float64),
            np.asarray(width, np.float64),
            np.asarray(period, np.float64),
            np.asarray(phase, np.float64),
            np.asarray(vortex, np.float64).reshape(-1, 4),
        )

    def velocity(self, places: Float64, time_s: ArrayLike = 0.0) -> Float64:
        """Give the water's velocity (..., P, 2) [m/s] [N] at places (..., P, 2) [m] [N].

        Parameters
        ----------
        places
            North and east; leading axes are those of the field.
        time_s : (...) float
            Since the episode began.
        """
        speed = np.hypot(self.mean[..., 0], self.mean[..., 1])
        along = self.mean / np.maximum(speed, 1e-12)[..., None]
        from_line = places - self.centre[..., None, :]
        to_starboard = (
            from_line[..., 1] * along[..., None, 0] - from_line[..., 0] * along[..., None, 1]
        )
        profile = 1.0 + self.shear[..., None] * np.tanh(to_starboard / self.width[..., None])
        tide = np.cos(2.0 * np.pi * np.asarray(time_s) / self.period + self.phase)
        water = self.mean[..., None, :] * (profile * tide[..., None])[..., None]
        for k in range(self.vortex.shape[-2]):
            north, east, core, peak = np.moveaxis(self.vortex[..., k, None, :], -1, 0)
            off = places - np.stack([north, east], axis=-1)
            # 2 (r / core) / (1 + (r / core)^2) / r, finite at the centre; empty rows give 0.
            core2 = np.maximum(core, 1e-9) ** 2
            turn = 2.0 * peak * np.sqrt(core2) / (core2 + off[..., 0] ** 2 + off[..., 1] ** 2)
            water = water + turn[..., None] * np.stack([-off[..., 1], off[..., 0]], axis=-1)
        return np.asarray(water)


STILL = CurrentField.of()
"""No current."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Harbour:
    """One harbour, in frame N with its south-western corner near (0, 0)."""

    kind: Kind
    land: tuple[Ring, ...]
    """[m] Polygons of land, quays and jetties; they may overlap and need not be convex. All rings
    run from north to east (clockwise on a map), so that land lies to the right of its edges."""
    keep_out: tuple[Ring, ...]
    """[m] Polygons that nobody may enter and no sensor sees."""
    fence: Ring | None
    """[m] The polygon that nobody may leave; None: there is none."""
    piles: Float64
    """[m] (P, 3) North, east, radius."""
    height_m: float
    """[m] Of land and piles over the water."""
    starts: Float64
    """[m, rad] (V, 3) North, east, heading: at least half a hull's diagonal from all that is fixed,
    so that every heading is clear."""
    goals: Float64
    """[m] (V, 2) North, east; as clear."""
    ways: tuple[Float64, ...]
    """[m] V ways (M, 2) from start to goal, both included: straight legs."""
    clearance_m: Float64
    """[m] (V,) How near each way comes to anything fixed."""
    current: CurrentField
    size_m: tuple[float, float]
    """[m] North and east extent of everything."""

    @property
    def rings(self) -> tuple[Ring, ...]:
        """Every polygon: land, keep-out, then the fence."""
        return (*self.land, *self.keep_out, *(() if self.fence is None else (self.fence,)))

    @property
    def edges(self) -> Float64:
        """[m] (S, 2, 2) Beginnings and ends of every polygon's edges."""
        return edges_of(self.rings)

    def forbidden(self, places: Float64) -> Mask:
        """Tell which places (P, 2) [m] are on land, in a keep-out area, a pile, or fenced off."""
        found = np.zeros(len(places), bool)
        for ring in (*self.land, *self.keep_out):
            found |= inside(places, ring)
        if self.fence is not None:
            found |= ~inside(places, self.fence)
        off = places[:, None] - self.piles[None, :, :2]
        return np.asarray(found | (np.hypot(off[..., 0], off[..., 1]) < self.piles[:, 2]).any(1))

    def distance_m(self, places: Float64) -> Float64:
        """Give how far places (P, 2) [m] are from anything fixed (P,) [m]; 0 where forbidden."""
        off = np.hypot(*np.moveaxis(places[:, None] - self.piles[None, :, :2], -1, 0))
        near = np.concatenate([_to_edges(places, self.edges), off - self.piles[:, 2]], axis=1)
        return np.where(self.forbidden(places), 0.0, near.min(axis=1, initial=np.inf))


def draw_harbour(rng: Generator, settings: HarbourSettings) -> Harbour:
    """Draw a harbour, the same one for the same generator and settings.

    Raises
    ------
    ConfigError
        No harbour with a way for every vessel was found: too many vessels, or too far apart.
    """
    kind = settings.kinds[int(rng.integers(len(settings.kinds)))]
    beam = settings.beam_m / settings.length_m
    for _ in range(REDRAWS):
        layout = _LAYOUTS[kind](rng, beam, settings)
        ends = _draw_ends(rng, layout, beam, settings)
        if ends is None:
            continue
        ways = _find_ways(layout, ends, settings.clearance_beams * beam, _reach(beam) + 0.25)
        if ways is not None:
            return _placed(rng, kind, layout, ways, settings)
    raise ConfigError(
        f"no harbour found of kind {kind!r} in which {settings.vessels} vessels of "
        f"{settings.length_m:g} x {settings.beam_m:g} m start {settings.apart_lengths:g} lengths "
        f"apart, {settings.way_lengths:g} lengths from their goals, with a clearance of "
        f"{settings.clearance_beams:g} beams on the way; ask for fewer, or for less",
        key="harbour",
    )


def inside(places: Float64, ring: Ring) -> Mask:
    """Tell which places (P, 2) lie within a polygon (M, 2), convex or not (even-odd rule)."""
    (x, y), (ax, ay) = places.T[:, :, None], ring.T[:, None, :]
    bx, by = np.roll(ax, -1, axis=1), np.roll(ay, -1, axis=1)
    spans = (ay > y) != (by > y)
    with np.errstate(divide="ignore", invalid="ignore"):
        crossing = ax + (y - ay) * (bx - ax) / (by - ay)
    return np.asarray((spans & (x < crossing)).sum(axis=1) % 2 == 1)


def edges_of(rings: Sequence[Ring]) -> Float64:
    """Give the edges (S, 2, 2) of polygons, ring by ring."""
    parts = [np.stack([ring, np.roll(ring, -1, axis=0)], axis=1) for ring in rings]
    return np.concatenate(parts) if parts else np.empty((0, 2, 2))


# -- layouts, in hull lengths ---------------------------------------------------------------------


class _Layout(NamedTuple):
    """A harbour before it is turned and scaled; x and y in hull lengths."""

    start_boxes: Float64
    """(V, 4) Least x, least y, greatest x, greatest y of where each vessel starts;"""
    goal_boxes: Float64
    """(V, 4) and of where it goes."""
    land: Sequence[Ring] = ()
    keep_out: Sequence[Ring] = ()
    fence: Ring | None = None
    piles: Float64 = np.empty((0, 3))
    hints: Float64 = np.empty((0, 2))
    """(H, 2) Places that a way may well lead through, as before and behind a gap."""


def _box(x0: float, y0: float, x1: float, y1: float) -> Ring:
    return np.array([(x0, y0), (x1, y0), (x1, y1), (x0, y1)])


def _turned(ring: Ring, angle: float) -> Ring:
    cos, sin = np.cos(angle), np.sin(angle)
    return np.asarray(ring @ np.array([[cos, sin], [-sin, cos]]))


def _free_box(rng: Generator, area: ArrayLike, size: tuple[float, float]) -> Ring:
    """Draw a rectangle of a random heading; both sides within `size`, its centre in the area."""
    length, width = rng.uniform(*size, 2) / 2
    x0, y0, x1, y1 = np.asarray(area)
    ring = _turned(_box(-length, -width, length, width), rng.uniform(0.0, np.pi))
    return ring + rng.uniform((x0, y0), (x1, y1))


def _star(rng: Generator, corners: int, radius: tuple[float, float]) -> Ring:
    """Draw a polygon around (0, 0) whose corners lie at any distance between: seldom convex."""
    angle = (np.arange(corners) + rng.uniform(-0.3, 0.3, corners)) * (2.0 * np.pi / corners)
    far = rng.uniform(*radius, corners)
    return np.column_stack([far * np.cos(angle), far * np.sin(angle)])


def _pick(rng: Generator, boxes: ArrayLike, count: int) -> Float64:
    """Draw one of the boxes for each of `count` vessels."""
    table = np.asarray(boxes, np.float64)
    return table[rng.integers(len(table), size=count)]


def _scatter(rng: Generator, area: ArrayLike, count: int) -> Float64:
    """Draw piles: thin posts to dolphins of a third of a hull's length in radius."""
    x0, y0, x1, y1 = np.asarray(area)
    centres = rng.uniform((x0, y0), (x1, y1), (count, 2))
    return np.column_stack([centres, 0.05 + 0.28 * rng.random(count) ** 2])


def _basin(rng: Generator, beam: float, settings: HarbourSettings) -> _Layout:
    """Lay out a basin: walls around, one entrance, jetties from the walls, and loose quays."""
    del beam
    (width, depth), wall = rng.uniform(9.0, 15.0, 2), rng.uniform(1.0, 2.5)
    middle, half = rng.uniform(0.25, 0.75) * width, rng.uniform(1.0, 2.0)
    left, right = middle - half, middle + half
    within = [(left, 0.0), (0.0, 0.0), (0.0, depth), (width, depth), (width, 0.0), (right, 0.0)]
    out = [
        (right, -wall),
        (width + wall, -wall),
        (width + wall, depth + wall),
        (-wall, depth + wall),
        (-wall, -wall),
        (left, -wall),
    ]
    around = np.array(within + out) + rng.uniform(-0.3, 0.3, (12, 2))
    land = [around]
    for _ in range(int(rng.integers(4))):
        at, thick, reach = rng.uniform(0.2, 0.8), rng.uniform(0.1, 0.4), rng.uniform(0.25, 0.6)
        side = int(rng.integers(3))
        if side == 0:
            land.append(_box(-0.6, at * depth - thick, reach * width, at * depth + thick))
        elif side == 1:
            x = (1.0 - reach) * width
            land.append(_box(x, at * depth - thick, width + 0.6, at * depth + thick))
        else:
            y = (1.0 - reach) * depth
            land.append(_box(at * width - thick, y, at * width + thick, depth + 0.6))
    area = (1.5, 2.5, width - 1.5, depth - 1.5)
    land += [_free_box(rng, area, (0.4, 2.5)) for _ in range(int(rng.integers(3)))]
    water, sea = (0.0, 0.0, width, depth), (middle - 4.0, -wall - 6.0, middle + 4.0, -wall - 1.0)
    boxes = [water, water, sea]
    count = settings.vessels
    entrance = np.array([(middle, y) for y in (1.0, -wall / 2, -wall - 1.0)])
    return _Layout(_pick(rng, boxes, count), _pick(rng, boxes, count), land, hints=entrance)


def _channel(rng: Generator, beam: float, settings: HarbourSettings) -> _Layout:
    """Lay out a channel: two banks with bends; vessels sail both ways."""
    bends = int(rng.integers(3, 6))
    x = np.linspace(0.0, rng.uniform(14.0, 22.0), bends)
    slope = rng.uniform(-0.6, 0.6, bends - 1)
    y = np.concatenate([[0.0], np.cumsum(slope * np.diff(x))])
    half = rng.uniform(max(1.3, 2.0 * beam), 2.5)
    bank = 0.25 * rng.random((2, bends))  # walls are rough
    left = np.column_stack([x, y + half * np.sqrt(1.0 + np.max(slope**2)) + bank[0]])
    right = np.column_stack([x, y - half * np.sqrt(1.0 + np.max(slope**2)) - bank[1]])
    land = [
        np.concatenate([left, left[::-1] + np.array((0.0, 2.0))]),
        np.concatenate([right, right[::-1] - np.array((0.0, 2.0))]),
    ]
    ends = [
        (0.0, y[0] - half, 4.0, y[0] + half + 1.0),
        (x[-1] - 4.0, y[-1] - half - 1.0, x[-1], y[-1] + half + 1.0),
    ]
    way = (np.arange(settings.vessels) + rng.integers(2)) % 2
    boxes = np.array(ends)
    return _Layout(boxes[way], boxes[1 - way], land, hints=np.column_stack([x, y]))


def _dead_end(rng: Generator, beam: float, settings: HarbourSettings) -> _Layout:
    """Lay out a pocket between a vessel and its goal; others want into it or past it."""
    wide, deep = rng.uniform(max(1.6, 2.6 * beam), 5.0) / 2, rng.uniform(2.5, 7.0)
    wall = rng.uniform(0.2, 1.2, 3)
    pocket = [
        (rng.uniform(-1.0, 1.0), -wide - wall[0]),
        (deep + wall[1], -wide - wall[0]),
        (deep + wall[1], wide + wall[2]),
        (rng.uniform(-1.0, 1.0), wide + wall[2]),
    ]
    land = [
        np.array(
            [*pocket, (pocket[3][0], wide), (deep, wide), (deep, -wide), (pocket[0][0], -wide)]
        )
    ]
    before = (-6.0, -wide - 2.0, -1.5, wide + 2.0)
    behind = (deep + 2.0, -wide - 2.0, deep + 6.0, wide + 2.0)
    within = (0.5, -wide, deep, wide)
    count = settings.vessels
    starts, goals = _pick(rng, [before, within, behind], count), np.empty((count, 4))
    for n in range(count):
        from_behind = starts[n, 0] == behind[0]
        goals[n] = _pick(rng, [before, within] if from_behind else [behind], 1)[0]
    starts[0], goals[0] = (within if rng.random() < 0.5 else before), behind
    return _Layout(starts, goals, land, piles=_scatter(rng, before, int(rng.integers(3))))


def _fingers(rng: Generator, beam: float, settings: HarbourSettings) -> _Layout:
    """Lay out finger piers on one side of a fairway or on both; vessels leave and enter slips."""
    fairway = rng.uniform(3.5, 6.0)
    land: list[Ring] = []
    slips: list[tuple[float, float, float, float]] = []
    longest = rng.uniform(1.5, 3.5)
    sides = 1 + int(rng.integers(2))
    for side in range(sides):
        slip, finger = rng.uniform(max(1.5, 2.4 * beam), 3.0), rng.uniform(0.1, 0.4)
        count = int(rng.integers(3, 6))
        comb = [(0.0, -2.0)]
        for k in range(count + 1):
            x = k * (slip + finger)
            comb += [(x, 0.0), (x, longest), (x + finger, longest), (x + finger, 0.0)]
            if k < count:
                slips.append((x + finger, 0.3, x + finger + slip, longest + 0.3))
        comb.append((comb[-1][0], -2.0))
        ring = np.array(comb)
        if side:
            top = 2.0 * longest + fairway
            ring = ring * (1.0, -1.0) + (0.0, top)
            slips[-count:] = [(a, top - d, c, top - b) for a, b, c, d in slips[-count:]]
        land.append(ring)
    span = max(ring[:, 0].max() for ring in land)
    open_water = (0.0, longest + 0.5, span, longest + fairway)
    boxes = [*slips, *[open_water] * max(1, len(slips) // 2)]
    count = settings.vessels
    return _Layout(_pick(rng, boxes, count), _pick(rng, boxes, count), land)


def _gap(rng: Generator, beam: float, settings: HarbourSettings) -> _Layout:
    """Lay out a wall with one gap; banks on both sides make the way around far longer."""
    half = beam * rng.uniform(*settings.gap_beams) / 2
    thick, bank = rng.uniform(0.1, 0.5), 1.0
    reach = rng.uniform(5.0, 8.0, 2)
    side = rng.uniform(4.0, 6.0, 2)
    land = []
    for sign, span, along in zip((1.0, -1.0), reach, side, strict=True):
        tee = [
            (-thick, half),
            (-thick, span),
            (-along, span),
            (-along, span + bank),
            (along, span + bank),
            (along, span),
            (thick, span),
            (thick, half),
        ]
        land.append(np.array(tee) * (1.0, sign))
    boxes = np.array([(-8.0, -4.0, -1.5, 4.0), (1.5, -4.0, 8.0, 4.0)])
    way = rng.integers(2, size=settings.vessels)
    axis = np.array([(x, 0.0) for x in (-thick - 1.0, -thick, 0.0, thick, thick + 1.0)])
    return _Layout(boxes[way], boxes[1 - way], land, hints=axis)


def _piles(rng: Generator, beam: float, settings: HarbourSettings) -> _Layout:
    """Lay out posts and dolphins, anywhere."""
    del beam
    side = rng.uniform(8.0, 12.0)
    area, count = (0.0, 0.0, side, side), settings.vessels
    posts = _scatter(rng, area, int(rng.integers(6, 15)))
    return _Layout(_pick(rng, [area], count), _pick(rng, [area], count), piles=posts)


def _fenced(rng: Generator, beam: float, settings: HarbourSettings) -> _Layout:
    """Lay out an inclusion fence, seldom convex, around exclusion fences."""
    del beam
    keep_out = [
        _star(rng, int(rng.integers(3, 8)), (0.5, 2.2)) + rng.uniform(-5.0, 5.0, 2)
        for _ in range(int(rng.integers(1, 4)))
    ]
    if rng.random() < 0.4:  # an L, or a U where the notch is in the middle
        long, wide, notch = rng.uniform(6.0, 9.0), rng.uniform(6.0, 9.0), rng.uniform(1.0, 3.0)
        tip, foot = rng.uniform(-long, 0.3 * long), rng.uniform(-0.3, 1.0) * wide
        ring = np.array(
            [
                (-long, -wide),
                (long, -wide),
                (long, wide),
                (tip + notch, wide),
                (tip + notch, foot),
                (tip - notch, foot),
                (tip - notch, wide),
                (-long, wide),
            ]
        )
        is_u = tip - notch > -long + 2.0
        fence = ring if is_u else np.vstack([ring[:4], (tip + notch, foot), (-long, foot)])
    else:
        fence = _star(rng, int(rng.integers(6, 13)), (4.5, 10.0))
    area, count = (*fence.min(axis=0), *fence.max(axis=0)), settings.vessels
    return _Layout(
        _pick(rng, [area], count), _pick(rng, [area], count), keep_out=keep_out, fence=fence
    )


def _mixed(rng: Generator, beam: float, settings: HarbourSettings) -> _Layout:
    """Lay out a basin with piles, and at times a closed area."""
    layout = _basin(rng, beam, settings)
    width, depth = layout.land[0][3]
    area = (1.0, 1.0, width - 1.0, depth - 1.0)
    closed = [_star(rng, 5, (0.5, 1.5)) + (width, depth) * rng.uniform(0.3, 0.7, 2)]
    return layout._replace(
        piles=_scatter(rng, area, int(rng.integers(1, 6))),
        keep_out=closed if rng.random() < 0.5 else [],
    )


def _open(rng: Generator, beam: float, settings: HarbourSettings) -> _Layout:
    """Lay out nothing but water."""
    del beam
    area = (0.0, 0.0, 11.0, 11.0)
    count = settings.vessels
    return _Layout(_pick(rng, [area], count), _pick(rng, [area], count))


_LAYOUTS: dict[str, Callable[[Generator, float, HarbourSettings], _Layout]] = {
    "basin": _basin,
    "channel": _channel,
    "dead_end": _dead_end,
    "fingers": _fingers,
    "gap": _gap,
    "piles": _piles,
    "fenced": _fenced,
    "mixed": _mixed,
    "open": _open,
}


# -- starts and goals -----------------------------------------------------------------------------


def _reach(beam: float) -> float:
    """[lengths] From a hull's middle to its corner."""
    return float(np.hypot(1.0, beam)) / 2.0


def _draw_ends(
    rng: Generator, layout: _Layout, beam: float, settings: HarbourSettings
) -> Float64 | None:
    """Draw starts and goals (2, V, 2), or give None where one finds no place."""
    fixed = _Fixed(layout)
    count, clear = settings.vessels, _reach(beam) + 0.1
    boxes = np.stack([layout.start_boxes, layout.goal_boxes])[:, :, None]
    drawn = boxes[..., :2] + rng.random((2, count, CANDIDATES, 2)) * (
        boxes[..., 2:] - boxes[..., :2]
    )
    fits = (fixed.distance(drawn.reshape(-1, 2)) >= clear).reshape(2, count, CANDIDATES)
    ends = np.empty((2, count, 2))
    for vessel in range(count):
        far = drawn[0, vessel, :, None] - drawn[1, vessel, None, :]
        pairs = np.hypot(far[..., 0], far[..., 1]) >= settings.way_lengths
        for end, axis in ((0, 1), (1, 0)):
            off = drawn[end, vessel, :, None] - ends[end, None, :vessel]
            apart = (np.hypot(off[..., 0], off[..., 1]) >= settings.apart_lengths).all(axis=1)
            pairs &= np.expand_dims(fits[end, vessel] & apart, axis)
        if not pairs.any():
            return None
        start, goal = np.unravel_index(int(pairs.argmax()), pairs.shape)
        ends[0, vessel], ends[1, vessel] = drawn[0, vessel, start], drawn[1, vessel, goal]
    return ends


class _Fixed:
    """Everything fixed of a layout: its corners, and the edges from each to the next."""

    def __init__(self, layout: _Layout) -> None:
        shut = [_clockwise(ring) for ring in (*layout.land, *layout.keep_out)]
        rings = list(shut)
        if layout.fence is not None:  # land is outside of it
            rings.append(_clockwise(layout.fence)[::-1])
        self._shut, self._fence = shut, layout.fence
        self.piles = layout.piles
        self.edges = edges_of(rings)
        sizes = np.array([len(ring) for ring in rings], np.intp)
        first = np.repeat(np.cumsum(sizes) - sizes, sizes)
        self.next = np.arange(len(first)) + 1
        ends = np.cumsum(sizes) - 1
        self.next[ends] = first[ends]
        self.before = np.empty_like(self.next)
        self.before[self.next] = np.arange(len(first))

    def distance(self, places: Float64) -> Float64:
        """Give how far places (P, 2) are from everything fixed (P,); 0 where forbidden."""
        off = np.hypot(*np.moveaxis(places[:, None] - self.piles[None, :, :2], -1, 0))
        near = np.concatenate([_to_edges(places, self.edges), off - self.piles[:, 2]], axis=1)
        least = np.maximum(near.min(axis=1, initial=np.inf), 0.0)
        for ring in self._shut:
            least[inside(places, ring)] = 0.0
        if self._fence is not None:
            least[~inside(places, self._fence)] = 0.0
        return np.asarray(least)


def _clockwise(ring: Ring) -> Ring:
    """Give a ring that runs from the first axis to the second: positive area."""
    x, y = ring.T
    return ring if np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)) > 0.0 else ring[::-1]


def _to_edges(places: Float64, edges: Float64) -> Float64:
    """Give the distances (P, S) of places (P, 2) from edges (S, 2, 2)."""
    (ax, ay), (bx, by) = edges[:, 0].T, edges[:, 1].T
    dx, dy = bx - ax, by - ay
    x, y = places[:, :1] - ax, places[:, 1:] - ay
    t = np.clip((x * dx + y * dy) / np.maximum(dx * dx + dy * dy, 1e-12), 0.0, 1.0)
    return np.asarray(np.hypot(x - t * dx, y - t * dy))


# -- a way for each vessel ------------------------------------------------------------------------


class _Ways(NamedTuple):
    ways: list[Float64]
    clearance: Float64
    """(V,) Of the nearest leg."""


def _find_ways(layout: _Layout, ends: Float64, least: float, wanted: float) -> _Ways | None:
    """Find each vessel's way that keeps `least` from everything fixed, and `wanted` where it can.

    Shortest ways on the visibility graph, on which a leg counts up to three times its length where
    it comes nearer than `wanted`. Gives None where there is no way for one of them.
    """
    # Piles count as wider, so that the circle around a hull passes them.
    wider = np.array([0.0, 0.0, max(wanted - 0.2 - least, 0.0)])
    fixed, count = _Fixed(layout._replace(piles=layout.piles + wider)), ends.shape[1]
    more = np.concatenate(
        [_around_corners(fixed, least), _around_corners(fixed, wanted), layout.hints]
    )
    more = np.concatenate([more, _around_piles(fixed.piles, least)])
    more = more[fixed.distance(more) >= 0.999 * least]
    nodes = np.concatenate([ends[0], ends[1], more])
    length, clearance = _legs(nodes, fixed)
    narrow = np.maximum(wanted - clearance, 0.0) / wanted
    cost = np.where(clearance >= 0.99 * least, length * (1.0 + 2.0 * narrow), np.inf)
    to_goal = np.full((count, len(nodes)), np.inf)
    to_goal[np.arange(count), count + np.arange(count)] = 0.0
    while True:  # Bellman and Ford's, for all goals at once
        better = np.minimum(to_goal, (to_goal[:, :, None] + cost[None]).min(axis=1))
        if np.array_equal(better, to_goal):
            break
        to_goal = better
    if not np.isfinite(to_goal[np.arange(count), np.arange(count)]).all():
        return None
    ways, nearest = [], np.full(count, np.inf)
    for vessel in range(count):
        at, way = vessel, [vessel]
        while at != count + vessel:
            after = int(np.argmin(cost[at] + to_goal[vessel]))
            nearest[vessel] = min(nearest[vessel], clearance[at, after])
            at = after
            way.append(at)
        ways.append(nodes[way])
    return _Ways(ways, nearest)


def _around_corners(fixed: _Fixed, clearance: float) -> Float64:
    """Give places beside the corners that stick out into the water, `clearance` off both edges."""
    corner = fixed.edges[:, 0]
    before = corner - corner[fixed.before]
    after = corner[fixed.next] - corner
    out = before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0] > 0.0
    corner, before, after = corner[out], before[out], after[out]
    before /= np.hypot(*before.T)[:, None]
    after /= np.hypot(*after.T)[:, None]
    outward = before - after
    outward /= np.maximum(np.hypot(*outward.T), 1e-9)[:, None]
    # Half of the corner's angle lies between an edge and the line that halves it.
    sine = np.abs(outward[:, 0] * after[:, 1] - outward[:, 1] * after[:, 0])
    return np.asarray(corner + outward * (1.02 * clearance / np.maximum(sine, 0.5))[:, None])


def _around_piles(piles: Float64, clearance: float) -> Float64:
    """Give six places around each pile, whose connections keep the clearance."""
    angle = np.arange(6) * (np.pi / 3.0)
    ring = np.column_stack([np.cos(angle), np.sin(angle)])
    far = 1.02 * (piles[:, 2] + clearance) / np.cos(np.pi / 6.0)
    return np.asarray((piles[:, None, :2] + far[:, None, None] * ring).reshape(-1, 2))


def _legs(nodes: Float64, fixed: _Fixed) -> tuple[Float64, Float64]:
    """Give length and clearance (N, N) of the legs between all nodes; 0 where one is crossed."""
    count, corners = len(nodes), len(fixed.edges)
    place = (nodes[:, 0] + 1j * nodes[:, 1]).astype(np.complex64)
    points = np.concatenate([fixed.edges[:, 0], fixed.piles[:, :2]])
    radius = np.concatenate([np.zeros(corners), fixed.piles[:, 2]]).astype(np.float32)
    i, j = np.triu_indices(count, 1)
    leg = place[j] - place[i]
    far = np.abs(leg)
    unit = leg / np.maximum(far, np.float32(1e-6))
    at = ((points[:, 0] + 1j * points[:, 1]).astype(np.complex64) - place[i][:, None]) * np.conj(
        unit
    )[:, None]
    past = at.real - np.clip(at.real, 0.0, far[:, None])
    clearance = (np.sqrt(past * past + at.imag * at.imag) - radius).min(axis=1, initial=np.inf)
    if corners:
        beyond = at.imag[:, :corners] > 0.0
        edge = fixed.edges[:, 1] - fixed.edges[:, 0]
        off = nodes[:, None] - fixed.edges[None, :, 0]
        left = edge[:, 0] * off[..., 1] - edge[:, 1] * off[..., 0] > 0.0
        crossed = (beyond != beyond[:, fixed.next]) & (left[i] != left[j])
        near = _to_edges(nodes, fixed.edges).min(axis=1)
        clearance = np.minimum(clearance, np.minimum(near[i], near[j]))
        clearance[crossed.any(axis=1)] = 0.0
    result = np.full((2, count, count), np.inf)
    result[0, i, j] = result[0, j, i] = far
    result[1] = 0.0
    result[1, i, j] = result[1, j, i] = clearance
    return result[0], result[1]


# -- into the world -------------------------------------------------------------------------------


def _placed(
    rng: Generator, kind: Kind, layout: _Layout, found: _Ways, settings: HarbourSettings
) -> Harbour:
    """Turn a layout by any angle, scale it to metres, and move it to the north-east of (0, 0)."""
    scale, angle = settings.length_m, rng.uniform(-np.pi, np.pi)
    rings = [*layout.land, *layout.keep_out, *(() if layout.fence is None else (layout.fence,))]
    everything = np.concatenate([*rings, layout.piles[:, :2], *found.ways])
    turned = _turned(everything, angle) * scale
    margin = scale
    origin, far = turned.min(axis=0) - margin, turned.max(axis=0) + margin

    def world(points: Float64) -> Float64:
        return np.asarray(_turned(points, angle) * scale - origin)

    ways = tuple(world(way) for way in found.ways)
    size = far - origin
    count = len(ways)
    return Harbour(
        kind=kind,
        land=tuple(_clockwise(world(ring)) for ring in layout.land),
        keep_out=tuple(_clockwise(world(ring)) for ring in layout.keep_out),
        fence=None if layout.fence is None else _clockwise(world(layout.fence)),
        piles=np.column_stack([world(layout.piles[:, :2]), layout.piles[:, 2] * scale]),
        height_m=float(rng.uniform(*settings.height_m)),
        starts=np.column_stack(
            [np.array([way[0] for way in ways]), rng.uniform(-np.pi, np.pi, count)]
        ),
        goals=np.array([way[-1] for way in ways]),
        ways=ways,
        clearance_m=found.clearance * scale,
        current=draw_current(rng, settings, (float(size[0]), float(size[1]))),
        size_m=(float(size[0]), float(size[1])),
    )


def draw_current(
    rng: Generator, settings: HarbourSettings, size_m: tuple[float, float]
) -> CurrentField:
    """Draw the current of a map of this size [m], nowhere faster than the speed that is drawn."""
    dice = rng.random(8)
    low, high = settings.current_mps
    if high == 0.0:
        return STILL
    speed, angle = low + dice[0] * (high - low), 2.0 * np.pi * dice[1]
    towards = np.array([np.cos(angle), np.sin(angle)])
    kind = settings.currents[int(dice[2] * len(settings.currents))]
    inner = np.array(size_m) * (0.25 + 0.5 * dice[3:5])
    if kind == "shear":
        shear = 2.0 * dice[5] - 1.0
        width = min(size_m) * (0.05 + 0.25 * dice[6])
        mean = speed / (1.0 + abs(shear)) * towards
        return CurrentField.of(mean, centre=inner, shear=shear, width=width)
    if kind == "vortex":
        share = 0.3 + 0.7 * dice[5]
        core = min(size_m) * (0.1 + 0.2 * dice[6])
        turn = speed * share * (1.0 if dice[7] < 0.5 else -1.0)
        return CurrentField.of(speed * (1.0 - share) * towards, vortex=[(*inner, core, turn)])
    if kind == "tide":
        period, phase = 60.0 + 540.0 * dice[5], 2.0 * np.pi * dice[6]
        return CurrentField.of(speed * towards, period=period, phase=phase)
    return CurrentField.of(speed * towards)
