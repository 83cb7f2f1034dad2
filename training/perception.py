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

from twinscrew.runtime.messages.types import OBSERVED_OBJECTS, Float32, Float64
from twinscrew.runtime.settings import Fraction, NonNegative, Settings
from twinscrew.training.imperfections import Imperfections
from twinscrew.training.physics import State
from twinscrew.training.scenarios import Index, Mask, Points

Complex64 = NDArray[np.complex64]

EGO_COLUMNS = 7
OBJECT_COLUMNS = 5
PACKED_COLUMNS = EGO_COLUMNS + OBSERVED_OBJECTS * (OBJECT_COLUMNS + 1)
"""[-] Numbers in one observation of 5 objects: ego, objects row by row, mask."""
QUANTILES = 1 << 16
"""[-] Every noise takes one of so many equally likely values."""
_PROBABILITY = (np.arange(QUANTILES) + 0.5) / QUANTILES


class Observations:
    """What vessels see, raw SI units, frame B; zeros for vessels that are not on the water.

    Rows of 7 + 6 K numbers (K objects at most) and views of their parts; iterating gives the parts.
    """

    __slots__ = ("rows",)

    def __init__(self, rows: Float32) -> None:
        self.rows = rows
        """(..., 7 + 6 K) float32"""

    @classmethod
    def empty(cls, shape: Sequence[int], objects: int = OBSERVED_OBJECTS) -> Observations:
        """Give observations of nothing."""
        return cls(np.zeros((*shape, EGO_COLUMNS + objects * (OBJECT_COLUMNS + 1)), np.float32))

    @classmethod
    def of(cls, ego: Float32, objects: Float32, mask: Float32) -> Observations:
        """Lay parts out as rows."""
        made = cls.empty(ego.shape[:-1], mask.shape[-1])
        made.ego[:], made.objects[:], made.mask[:] = ego, objects, mask
        return made

    @property
    def _end(self) -> int:
        width: int = self.rows.shape[-1]
        return EGO_COLUMNS + (width - EGO_COLUMNS) // 6 * OBJECT_COLUMNS

    @property
    def ego(self) -> Float32:
        """(..., 7) Goal x, y [m]; surge, sway [m/s]; yaw rate [rad/s]; thrusts [N]. Eq. (2)."""
        return self.rows[..., :EGO_COLUMNS]

    @property
    def objects(self) -> Float32:
        """(..., K, 5) x, y [m]; vx, vy over ground [m/s]; radius [m]; nearest first. Eq. (3)."""
        flat = self.rows[..., EGO_COLUMNS : self._end]
        return flat.reshape(*flat.shape[:-1], -1, OBJECT_COLUMNS)

    @property
    def mask(self) -> Float32:
        """(..., K) 1 where there is an object, 0 where there is padding."""
        return self.rows[..., self._end :]

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


def things_of(state: State, vessel_radius: float, buoy_radius: float) -> Things:
    """Give all vessels, buoys and scripted vessels of a state."""
    (episodes, vessels), buoys = state.shape, state.buoy.shape[1]
    count = vessels + buoys + state.scripted.shape[1]
    velocity, radius = np.zeros((episodes, count), complex), np.empty((episodes, count))
    moving = (state.nu[0] + 1j * state.nu[1]) * np.exp(1j * state.heading) * state.active
    velocity[:, :vessels], velocity[:, vessels + buoys :] = moving, state.scripted_velocity
    radius[:, :vessels], radius[:, vessels : vessels + buoys] = vessel_radius, buoy_radius
    radius[:, vessels + buoys :] = state.scripted_radius
    return Things(
        np.concatenate([state.position, state.buoy, state.scripted], axis=1),
        velocity,
        radius,
        np.concatenate([state.there, state.buoy_there, state.scripted_radius > 0.0], axis=1),
    )


class Perception:
    """Observes states with a noise, and whatever else goes wrong.

    Parameters
    ----------
    noise
        Of E episodes, for pairs of V observers and O objects.
    range_m : float
        [m] An object is seen while the nearest point of its true circle, at its perceived place,
        is within this.
    most : int
        K: how many objects are given.
    radii : tuple of float
        [m] Of vessels and of buoys.
    imperfections
        What else goes wrong.
    """

    def __init__(
        self,
        noise: Noise,
        range_m: float,
        most: int,
        radii: tuple[float, float],
        imperfections: Imperfections | None = None,
    ) -> None:
        self.noise, self._range, self._most = noise, range_m, most
        self._radii, self._imperfections = radii, imperfections

    def observe(self, state: State, observers: Mask) -> Observations:
        """See what is around the observers, (E, V), as things are now."""
        heading = np.exp(1j * state.heading)
        seen = Observations.empty(state.shape, self._most)
        goal_B = (state.goal - state.position) * heading.conj()
        ego = seen.ego
        ego[..., 0], ego[..., 1] = goal_B.real, goal_B.imag
        ego[..., 2:5] = state.nu.transpose(1, 2, 0)
        ego[..., 5:7] = state.thrust.transpose(1, 2, 0)
        things = things_of(state, *self._radii)
        which, p, v, radius = self._pairs(things, observers)
        surface = np.abs(p) - radius
        turn = heading.conj().astype(np.complex64)[which[0], which[1]]
        p, v = p * turn, v * turn
        features = np.empty((len(radius), OBJECT_COLUMNS), np.float32)
        for column, part in enumerate((p.real, p.imag, v.real, v.imag, radius)):
            features[:, column] = part
        _write_nearest(seen, which, features, surface)
        return seen

    def _pairs(
        self, things: Things, observers: Mask
    ) -> tuple[tuple[Index, Index], Complex64, Complex64, Float32]:
        """Give who sees what: n pairs as (episode, observer), place, velocity (frame N), radius."""
        vessels, imperfect = observers.shape[1], self._imperfections
        place = things.position.astype(np.complex64)
        apart = place[:, None, :] - place[:, :vessels, None]
        possible = observers[..., None] & things.there[:, None, :]
        possible[:, np.arange(vessels), np.arange(vessels)] = False
        bins, radius = self.noise.next(), things.radius.astype(np.float32)
        if imperfect is None:
            # A pair that even the greatest noise cannot bring within range needs no noise.
            reach = (radius + np.float32(self._range + self.noise.reach + 0.01))[:, None, :]
            near = apart.real * apart.real + apart.imag * apart.imag
            e, o, k = np.nonzero(possible & (near < reach * reach))
            errors = self.noise.values(bins[e, o, k])
            p, size = apart[e, o, k] + errors[0], radius[e, k]
            v = things.velocity.astype(np.complex64)[e, k] + errors[1]
            seen = np.abs(p) <= size + np.float32(self._range)
            return (e[seen], o[seen]), p[seen], v[seen], (size * errors[2])[seen]
        errors = self.noise.values(bins)
        p, size = apart + errors[0], np.broadcast_to(radius[:, None, :], apart.shape)
        v = imperfect.lagged(things.velocity).astype(np.complex64)[:, None, :] + errors[1]
        seen = possible & (np.abs(p) <= size + np.float32(self._range))
        p, v, size, seen = imperfect.distort(p, v, size * errors[2], seen)
        e, o, k = np.nonzero(seen)
        return (e, o), p[e, o, k], v[e, o, k], size[e, o, k]

    def forget(self, slots: Index) -> None:
        """Forget what was believed in some slots: new episodes begin."""
        if self._imperfections is not None:
            self._imperfections.forget(slots)


def _write_nearest(
    into: Observations, which: tuple[Index, Index], features: Float32, surface: Float32
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
