"""What each vessel sees: its own state and the nearest objects around it, in its own frame.

The definitions are those of `runtime.policy.observation`, for V vessels in E episodes at once, with
the paper's perception noise. Vectors in the plane are complex numbers, north + i east: a product
with exp(i heading) turns B into N. An observation is one row of numbers, written here once: the
environment, the networks and the replay all read the same rows.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import lru_cache
from typing import Annotated, NamedTuple

import numpy as np
from msgspec import Meta
from numpy.random import Generator
from numpy.typing import NDArray
from scipy.stats import norm, vonmises

from twinscrew.runtime.charts.contour import CONTOUR_RANGE_M, SECTORS
from twinscrew.runtime.messages.types import OBSERVED_OBJECTS, Float32, Float64
from twinscrew.runtime.policy.hull_units import HULL_COLUMNS
from twinscrew.runtime.settings import Fraction, NonNegative, Settings
from twinscrew.training.imperfections import Imperfections
from twinscrew.training.land import ContourNoise
from twinscrew.training.physics import State, rectangle_gap
from twinscrew.training.scenarios import Index, Mask, Points

Complex64 = NDArray[np.complex64]

EGO_COLUMNS = 7
OBJECT_COLUMNS = 5
OUTLINE_COLUMNS = 3
BEYOND_COLUMNS = 1
PACKED_COLUMNS = EGO_COLUMNS + OBSERVED_OBJECTS * (OBJECT_COLUMNS + 1)
"""[-] Numbers in one observation of 5 objects as the paper has it: ego, objects, mask."""
QUANTILES = 1 << 16
"""[-] Every noise takes one of so many equally likely values."""
_PROBABILITY = (np.arange(QUANTILES) + 0.5) / QUANTILES


class Layout(NamedTuple):
    """How an observation of K objects lies in a row: ego, objects, mask.

    Then, if it is extended, the objects' outlines and the own hull's description; then, if edges
    are seen, the contour, and what is left of the way beyond the goal that is shown.
    """

    objects: int
    """[-] K."""
    extended: bool
    contour: bool = False

    @property
    def widths(self) -> tuple[int, ...]:
        """[-] Numbers in each part."""
        k = self.objects
        paper = (EGO_COLUMNS, k * OBJECT_COLUMNS, k)
        if not self.extended:
            return paper
        extended = (*paper, k * OUTLINE_COLUMNS, len(HULL_COLUMNS))
        return (*extended, SECTORS, BEYOND_COLUMNS) if self.contour else extended


PAPER = Layout(OBSERVED_OBJECTS, extended=False)


@lru_cache(maxsize=32)
def layout_of(width: int) -> Layout:
    """Give the layout of rows by their width: no two layouts have the same."""
    paper, rest = divmod(width - EGO_COLUMNS, OBJECT_COLUMNS + 1)
    if not rest:
        return Layout(paper, extended=False)
    each = OBJECT_COLUMNS + 1 + OUTLINE_COLUMNS
    extended, rest = divmod(width - EGO_COLUMNS - len(HULL_COLUMNS), each)
    if not rest:
        return Layout(extended, extended=True)
    more = SECTORS + BEYOND_COLUMNS
    return Layout((width - EGO_COLUMNS - len(HULL_COLUMNS) - more) // each, True, contour=True)


class Observations:
    """What vessels see, SI units, frame B; zeros for vessels that are not on the water.

    Rows of numbers (K objects at most) and views of their parts; iterating gives the parts.
    """

    __slots__ = ("rows",)

    def __init__(self, rows: Float32) -> None:
        self.rows = rows
        """(..., W) float32"""

    @classmethod
    def empty(
        cls,
        shape: Sequence[int],
        objects: int = OBSERVED_OBJECTS,
        *,
        extended: bool = False,
        contour: bool = False,
    ) -> Observations:
        """Give observations of nothing."""
        width = sum(Layout(objects, extended, contour).widths)
        return cls(np.zeros((*shape, width), np.float32))

    @classmethod
    def of(cls, ego: Float32, objects: Float32, mask: Float32) -> Observations:
        """Lay parts out as rows."""
        made = cls.empty(ego.shape[:-1], mask.shape[-1])
        made.ego[:], made.objects[:], made.mask[:] = ego, objects, mask
        return made

    @property
    def layout(self) -> Layout:
        """How the parts lie in a row."""
        return layout_of(self.rows.shape[-1])

    def _part(self, number: int) -> Float32:
        widths = self.layout.widths
        first = sum(widths[:number])
        part: Float32 = self.rows[..., first : first + widths[number]]
        return part

    @property
    def ego(self) -> Float32:
        """(..., 7) Goal x, y [m]; surge, sway [m/s]; yaw rate [rad/s]; thrusts [N]. Eq. (2)."""
        return self.rows[..., :EGO_COLUMNS]

    @property
    def objects(self) -> Float32:
        """(..., K, 5) x, y [m]; vx, vy over ground [m/s]; radius [m]; nearest first. Eq. (3)."""
        flat = self._part(1)
        return flat.reshape(*flat.shape[:-1], -1, OBJECT_COLUMNS)

    @property
    def mask(self) -> Float32:
        """(..., K) 1 where there is an object, 0 where there is padding."""
        return self._part(2)

    @property
    def outlines(self) -> Float32:
        """(..., K, 3) Half length, half beam [m], heading [rad] in frame B; zeros for a circle.

        Extended observations only.
        """
        flat = self._part(3)
        return flat.reshape(*flat.shape[:-1], -1, OUTLINE_COLUMNS)

    @property
    def hull(self) -> Float32:
        """(..., 10) The own hull, as `HULL_COLUMNS` says. Extended observations only."""
        return self._part(4)

    @property
    def contour(self) -> Float32:
        """(..., 32) [m] The nearest edge in each sector (`charts.contour`). With a contour only."""
        return self._part(5)

    @property
    def beyond(self) -> Float32:
        """(..., 1) [m] What is left of the way beyond the goal that is shown.

        With a contour only; no policy is told: it serves the critic.
        """
        return self._part(6)

    def __iter__(self) -> Iterator[Float32]:
        return iter((self.ego, self.objects, self.mask))


class NoiseSettings(Settings, frozen=True):
    """How wrong perception is (parameters.md, Training environment: noise)."""

    position_m: NonNegative = 0.05
    """[m] Standard deviation of each coordinate."""
    velocity_mps: NonNegative = 0.05
    """[m/s] Standard deviation of each component."""
    radius_mean: Fraction = 0.8
    """[-] The perceived radius is the true one times this + (1 - this) w / pi,"""
    radius_kappa: Annotated[float, Meta(ge=0.0, le=500.0)] = 1.0
    """[-] w von Mises distributed around 0 with this concentration."""
    perfect: bool = False
    """True: no noise at all, the true radius."""


class Noise:
    """The paper's perception noise, eqs. (13) to (15), independent for each observer and object.

    Each number is one of 65 536 equally likely values, the midpoints of the quantile bins: a
    look-up in place of a rejection loop, and closer to the distribution than a run can tell. The
    bins of a slot come from its own stream, drawn `block` decisions ahead so that a draw costs
    little.
    """

    def __init__(
        self,
        settings: NoiseSettings,
        generators: Sequence[Generator],
        shape: tuple[int, ...],
        block: int = 32,
    ) -> None:
        self._generators, self._shape, self._ahead = generators, shape, block
        self._left = 0
        self._position = self._velocity = np.zeros(QUANTILES, np.float32)
        self._radius = np.ones(QUANTILES, np.float32)
        if not settings.perfect:
            self._position = normal_values(settings.position_m)
            self._velocity = normal_values(settings.velocity_mps)
            self._radius = radius_factors(settings.radius_mean, settings.radius_kappa)
        self.perfect = settings.perfect
        self.reach = float(2**0.5 * np.abs(self._position).max())
        """[m] No place is seen farther from the true one than this."""

    def next(self) -> NDArray[np.uint16]:
        """Draw the bins of the next decision, (E, *shape, 5)."""
        if self.perfect:
            return np.zeros((len(self._generators), *self._shape, 5), np.uint16)
        if not self._left:
            shape = (self._ahead, *self._shape, 5)
            drawn = [g.integers(0, QUANTILES, shape, dtype=np.uint16) for g in self._generators]
            self._bins = np.stack(drawn, axis=1)
            self._left = self._ahead
        self._left -= 1
        bins: NDArray[np.uint16] = self._bins[self._ahead - 1 - self._left]
        return bins

    def values(self, bins: NDArray[np.uint16]) -> tuple[Complex64, Complex64, Float32]:
        """Give errors of place [m] and velocity [m/s] and the radius' factor, of bins (..., 5)."""
        position = self._position[bins[..., 0:2]].view(np.complex64)[..., 0]
        velocity = self._velocity[bins[..., 2:4]].view(np.complex64)[..., 0]
        return position, velocity, self._radius[bins[..., 4]]


@lru_cache(maxsize=8)
def normal_values(deviation: float) -> Float32:
    """Give a centred normal distribution as `QUANTILES` equally likely values."""
    values: Float32 = (deviation * norm.ppf(_PROBABILITY)).astype(np.float32)
    return values


@lru_cache(maxsize=8)
def radius_factors(mean: float, kappa: float) -> Float32:
    """Give the radius factor, eq. (15), as `QUANTILES` equally likely values."""
    w = np.pi * (2 * _PROBABILITY - 1)
    if kappa > 0.0:  # the distribution function, read backwards: its own inverse takes a minute
        angle = np.linspace(-np.pi, np.pi, 4 * QUANTILES + 1)
        w = np.interp(_PROBABILITY, vonmises(kappa).cdf(angle), angle)
    return (mean + (1.0 - mean) * w / np.pi).astype(np.float32)


class Things(NamedTuple):
    """O objects in E episodes; the first V of them are the vessels themselves."""

    position: Points
    """(E, O) [m] [N]"""
    velocity: Points
    """(E, O) [m/s] [N]"""
    radius: Float64
    """(E, O) [m]"""
    there: Mask
    """(E, O) Whether there is such an object."""


def things_of(state: State) -> Things:
    """Give all vessels, buoys and scripted vessels of a state."""
    (episodes, vessels), buoys = state.shape, state.buoy.shape[1]
    count = vessels + buoys + state.scripted.shape[1]
    velocity, radius = np.zeros((episodes, count), complex), np.empty((episodes, count))
    velocity[:, :vessels], velocity[:, vessels + buoys :] = state.velocity, state.scripted_velocity
    radius[:, :vessels], radius[:, vessels : vessels + buoys] = state.radius, state.buoy_radius
    radius[:, vessels + buoys :] = state.scripted_radius
    return Things(
        np.concatenate([state.position, state.buoy, state.scripted], axis=1),
        velocity,
        radius,
        np.concatenate([state.there, state.buoy_there, state.scripted_radius > 0.0], axis=1),
    )


class Sight(NamedTuple):
    """What a policy is shown."""

    range_m: float
    """[m] An object is seen while its nearest point, at its perceived place, is within this."""
    most: int
    """[-] K: how many objects are given."""
    extended: bool = False
    """Whether outlines and the own hull's description are given too."""
    contour: bool = False
    """Whether edges are given too."""


class Pairs(NamedTuple):
    """Who sees what: n pairs of an observer and an object."""

    which: tuple[Index, Index]
    """(n,) Episode, observer."""
    thing: Index
    """(n,) The object's number; that of the last one's other half is one too large."""
    place: Complex64
    """(n,) [m] From the observer, axes of N."""
    velocity: Complex64
    """(n,) [m/s] Over ground, axes of N."""
    radius: Float32
    """(n,) [m] As it is perceived."""
    factor: Float32
    """(n,) [-] What was perceived of the size; 0 where it is another object's size by now."""

    def only(self, keep: Mask) -> Pairs:
        """Give some of the pairs."""
        (e, o), k, p, v, radius, factor = self
        return Pairs((e[keep], o[keep]), k[keep], p[keep], v[keep], radius[keep], factor[keep])


class Perception:
    """Observes states with a noise, and whatever else goes wrong.

    Parameters
    ----------
    noise
        Of E episodes, for pairs of V observers and O objects.
    sight
        What is shown.
    imperfections
        What else goes wrong.
    contour_noise
        How wrong contours are; None: not at all.
    """

    def __init__(
        self,
        noise: Noise,
        sight: Sight,
        imperfections: Imperfections | None = None,
        contour_noise: ContourNoise | None = None,
    ) -> None:
        self.noise, self.sight, self._imperfections = noise, sight, imperfections
        self._contour_noise = contour_noise

    def observe(
        self, state: State, observers: Mask, bins: NDArray[np.uint16] | None = None
    ) -> Observations:
        """See what is around the observers, (E, V), as things are now; `bins` are the noise's."""
        s, heading = self.sight, np.exp(1j * state.heading)
        seen = Observations.empty(state.shape, s.most, extended=s.extended, contour=s.contour)
        aim, beyond = state.aim
        goal_B = (aim - state.position) * heading.conj()
        ego = seen.ego
        ego[..., 0], ego[..., 1] = goal_B.real, goal_B.imag
        ego[..., 2:5] = state.nu.transpose(1, 2, 0)
        if state.drift.any():
            drift = state.drift * heading.conj() * state.active
            ego[..., 2] += drift.real
            ego[..., 3] += drift.imag
        ego[..., 5:7] = state.thrust.transpose(1, 2, 0)
        if s.extended:
            seen.hull[:] = state.told
        if s.contour:
            seen.beyond[..., 0] = beyond
            self._see_edges(state, observers, seen.contour)
        things = things_of(state)
        reach = np.where(np.isnan(state.range), s.range_m, state.range).astype(np.float32)
        pairs = self._pairs(things, observers, reach, self.noise.next() if bins is None else bins)
        surface = np.abs(pairs.place) - pairs.radius
        e, o = pairs.which
        outlines = np.zeros((len(e), OUTLINE_COLUMNS), np.float32)
        if state.scripted.shape[1]:
            keep = self._outline(state, pairs, outlines, surface, reach)
            if not keep.all():
                pairs = pairs.only(keep)
                surface, outlines = surface[keep], outlines[keep]
                e, o = pairs.which
        turn = heading.conj().astype(np.complex64)[e, o]
        p, v = pairs.place * turn, pairs.velocity * turn
        features = np.empty((len(p), OBJECT_COLUMNS), np.float32)
        for column, part in enumerate((p.real, p.imag, v.real, v.imag, pairs.radius)):
            features[:, column] = part
        if s.extended:
            shown = outlines[:, 0] > 0.0
            outlines[:, 2] = np.where(shown, outlines[:, 2] - state.heading[e, o], 0.0)
            outlines[:, 2] = np.remainder(outlines[:, 2] + np.pi, 2 * np.pi) - np.pi * shown
            outlines[~shown] = 0.0
        _write_nearest(seen, pairs.which, features, surface, outlines)
        return seen

    def _see_edges(self, state: State, observers: Mask, contour: Float32) -> None:
        if state.land is None:
            contour[:] = CONTOUR_RANGE_M
            return
        contour[:] = state.land.contours(state.position, state.heading, observers)
        if self._contour_noise is not None:
            self._contour_noise.spoil(contour, state.land.reach)

    def _outline(
        self, state: State, pairs: Pairs, outlines: Float32, surface: Float32, reach: Float32
    ) -> Mask:
        """Write outlines, and the distances of their surfaces; tell which pairs are in range."""
        (e, _), first = pairs.which, state.shape[1] + state.buoy.shape[1]
        t = pairs.thing - first
        shown = (t >= 0) & (t < state.scripted.shape[1]) & (pairs.factor > 0.0)
        n = np.flatnonzero(shown)
        n = n[state.scripted_outlined[e[n], t[n]]]
        half = state.scripted_half[e[n], t[n]] * pairs.factor[n, None]
        heading = state.scripted_heading[e[n], t[n]]
        surface[n] = rectangle_gap(pairs.place[n], heading, half)
        outlines[n, :2], outlines[n, 2] = half, heading
        return np.asarray(surface <= reach[e])

    def _pairs(
        self, things: Things, observers: Mask, reach: Float32, bins: NDArray[np.uint16]
    ) -> Pairs:
        """Give who sees what; `reach` (E,) [m] is how far."""
        vessels, imperfect = observers.shape[1], self._imperfections
        place = things.position.astype(np.complex64)
        apart = place[:, None, :] - place[:, :vessels, None]
        possible = observers[..., None] & things.there[:, None, :]
        possible[:, np.arange(vessels), np.arange(vessels)] = False
        radius = things.radius.astype(np.float32)
        if imperfect is None:
            # A pair that even the greatest noise cannot bring within range needs no noise.
            most = (radius + (reach + np.float32(self.noise.reach + 0.01))[:, None])[:, None, :]
            near = apart.real * apart.real + apart.imag * apart.imag
            e, o, k = np.nonzero(possible & (near < most * most))
            errors = self.noise.values(bins[e, o, k])
            p, size = apart[e, o, k] + errors[0], radius[e, k]
            v = things.velocity.astype(np.complex64)[e, k] + errors[1]
            seen = np.abs(p) <= size + reach[e]
            which = (e[seen], o[seen])
            factor = errors[2][seen]
            return Pairs(which, k[seen], p[seen], v[seen], size[seen] * factor, factor)
        errors = self.noise.values(bins)
        p, size = apart + errors[0], np.broadcast_to(radius[:, None, :], apart.shape)
        v = imperfect.lagged(things.velocity).astype(np.complex64)[:, None, :] + errors[1]
        seen = possible & (np.abs(p) <= size + reach[:, None, None])
        believed = size * errors[2]
        p, v, size, seen = imperfect.distort(p, v, believed, seen)
        e, o, k = np.nonzero(seen)
        radii, known = size[e, o, k], np.minimum(k, believed.shape[-1] - 1)
        own = (k == known) & (radii == believed[e, o, known])
        factor = np.where(own, errors[2][e, o, known], np.float32(0.0))
        return Pairs((e, o), k, p[e, o, k], v[e, o, k], radii, factor)

    def forget(self, slots: Index) -> None:
        """Forget what was believed in some slots: new episodes begin."""
        if self._imperfections is not None:
            self._imperfections.forget(slots)


def _write_nearest(
    into: Observations,
    which: tuple[Index, Index],
    features: Float32,
    surface: Float32,
    outlines: Float32,
) -> None:
    """Write each observer's pairs, nearest surface first; pairs are ordered by observer."""
    vessels, most = into.rows.shape[1], into.mask.shape[-1]
    observer = which[0] * vessels + which[1]
    # One key sorts by observer, then surface: far less than 1000 m, and exact in float64.
    order = np.argsort(1000.0 * observer + surface, kind="stable")
    begin = np.cumsum(np.bincount(observer, minlength=len(into.rows) * vessels))
    rank = np.arange(len(order)) - np.concatenate([[0], begin[:-1]])[observer]
    kept = rank < most
    episode, vessel, rank = which[0][kept], which[1][kept], rank[kept]
    into.objects[episode, vessel, rank] = features[order[kept]] + np.float32(0.0)  # and no -0.0
    into.mask[episode, vessel, rank] = 1.0
    if into.layout.extended:
        into.outlines[episode, vessel, rank] = outlines[order[kept]]
