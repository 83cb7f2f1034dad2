"""Which episodes come next: every slot's own, drawn ahead so that a reset only copies rows.

Each slot and each episode has its own random stream, whatever else runs beside it: slot k draws the
same numbers in a batch of 1 and of 1000, so that results do not depend on how many episodes run at
once, and an episode's scenario does not depend on what any vessel did before.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from enum import IntEnum
from typing import Any, NamedTuple

import numpy as np
from numpy.random import SFC64, Generator, Philox, SeedSequence
from numpy.typing import NDArray

from twinscrew.runtime.errors import ConfigError
from twinscrew.runtime.messages.types import Float32, Float64
from twinscrew.runtime.policy.vessel_model import VesselParameters
from twinscrew.training.harbours import HarbourSettings, draw_current
from twinscrew.training.land import Land, LandSettings, Packed, harbour_of, harbour_settings
from twinscrew.training.perception import Noise, NoiseSettings, Perception, Sight
from twinscrew.training.physics import (
    CHANCES,
    FIELD_COLUMNS,
    ConditionSettings,
    State,
    draw_hulls,
    field_columns,
)
from twinscrew.training.scenarios import (
    Index,
    MapSettings,
    Scenarios,
    ScenarioSettings,
    Strangers,
    StrangerSettings,
    draw_strangers,
    place_in_harbour,
    sample,
)


class Stream(IntEnum):
    """What a slot's stream is for."""

    PERCEPTION = 0
    IMPERFECTION = 1
    CONTOUR = 2


def slot_stream(seed: int, slot: int, stream: Stream) -> Generator:
    """Give the generator that a slot keeps for as long as the environment lives."""
    return Generator(SFC64(SeedSequence([seed, slot, int(stream)])))


def episode_stream(seed: int, slot: int, number: int) -> Generator:
    """Give the generator of the slot's episode `number`: counter-based, so cheap to make."""
    return Generator(Philox(key=np.array([seed, (slot << 32) + number], dtype=np.uint64)))


class Beginning(NamedTuple):
    """How N episodes begin."""

    scenario: Scenarios
    rows: Float32
    """(N, V, W) What the vessels see at first."""
    chance: Float64
    """(N, V + 1, chances) Uniform numbers in [0, 1) for the conditions of each and all."""
    field: Float64
    """(N, 12) Currents that vary (`physics.current_field`)."""


class Episodes:
    """Draws the episodes of every slot.

    Parameters
    ----------
    scenarios, area
        The mixture of rows, and the map.
    noise, sight
        Of the first observation.
    conditions, vessel
        What the hulls are drawn from.
    strangers
        What vessels are like that give no way.
    land
        How harbours are drawn.
    shape
        V, M and T: vessels, buoys and strangers.
    slots
        E pairs of a seed and a slot's number, which determine its episodes.
    ahead
        How many of a slot are drawn at a time.
    """

    def __init__(
        self,
        scenarios: Sequence[ScenarioSettings],
        area: MapSettings,
        noise: NoiseSettings,
        sight: Sight,
        conditions: ConditionSettings,
        vessel: VesselParameters,
        strangers: StrangerSettings,
        land: LandSettings,
        shape: tuple[int, int, int],
        slots: Sequence[tuple[int, int]],
        ahead: int,
    ) -> None:
        self._scenarios, self._map, self._noise, self._shape = scenarios, area, noise, shape
        self._sight, self._conditions, self._vessel = sight, conditions, vessel
        self._strangers, self._land = strangers, land
        hull = (vessel.length, vessel.width)
        self._harbours = [
            harbour_settings(row.harbour, row.robots, hull, land) if row.harbour else None
            for row in scenarios
        ]
        self._slots = slots
        self._pool = Pool(self._draw, len(slots), ahead)
        self.set_weights([row.weight for row in scenarios])

    def set_weights(self, weights: Sequence[float]) -> None:
        """Change how often each row of the mixture is drawn, for episodes yet to begin."""
        rows = self._scenarios
        if len(weights) != len(rows) or min(weights) < 0.0 or sum(weights) <= 0.0:
            raise ConfigError(
                f"{len(rows)} numbers >= 0 with a positive sum are needed, got {list(weights)}",
                key="weight",
            )
        self._cumulative = np.cumsum(weights) / np.sum(weights)
        self._pool.forget()

    def take(self, slots: Index) -> Beginning:
        """Give the next episode of each of these slots (each at most once)."""
        *drawn, rows, chance, field = self._pool.take(slots)
        placed, others = drawn[:SCENARIO_PARTS], drawn[SCENARIO_PARTS:]
        scenario = Scenarios._make([*placed, Strangers(*others) if others else None])
        return Beginning(scenario, rows, chance, field)

    @property
    def has_harbours(self) -> bool:
        """Whether a row of the mixture asks for harbours."""
        return any(one is not None for one in self._harbours)

    def harbours_of(self, scenario: Scenarios) -> list[Packed | None]:
        """Give each episode's harbour; None where it has open water."""
        return [self._harbour(*numbers) for numbers in scenario.harbour.tolist()]

    def _harbour(self, row: int, number: int) -> Packed | None:
        settings = self._harbours[row] if row >= 0 else None
        return None if settings is None else harbour_of(settings, self._land.seed, number)

    def _begin_in_harbours(
        self, scenario: Scenarios, row: Index, generators: Sequence[Generator]
    ) -> None:
        for n, (k, g) in enumerate(zip(row.tolist(), generators, strict=True)):
            if self._harbours[k] is not None:
                number = int(g.random() * self._land.harbours)
                packed = self._harbour(k, number)
                assert packed is not None  # noqa: S101 - the row has harbours
                place_in_harbour(scenario, n, k, number, packed.harbour)

    def _fields(
        self, harbours: Sequence[Packed | None], generators: Sequence[Generator]
    ) -> Float64:
        """Draw currents that vary, (N, 12); none where the conditions have none."""
        s = self._conditions
        if not s.currents:
            return np.zeros((len(generators), FIELD_COLUMNS))
        settings = HarbourSettings(current_mps=s.current_mps, currents=s.currents)
        sizes = [(self._map.size_m,) * 2 if one is None else one.harbour.size_m for one in harbours]
        drawn = zip(sizes, generators, strict=True)
        return np.stack([field_columns(draw_current(g, settings, size)) for size, g in drawn])

    def _draw(self, slots: Index, numbers: Index) -> tuple[NDArray[Any], ...]:
        """Draw episodes, by slot and number, with all that depends on them alone."""
        chosen = [self._slots[slot] for slot in slots]
        generators = [
            episode_stream(seed, slot, number)
            for (seed, slot), number in zip(chosen, numbers.tolist(), strict=True)
        ]
        vessels, buoys, room = self._shape
        row = np.searchsorted(self._cumulative, [g.random() for g in generators], side="right")
        scenario = sample(self._scenarios, row, self._map, generators, (vessels, buoys))
        if self.has_harbours:
            self._begin_in_harbours(scenario, row, generators)
        harbours = self.harbours_of(scenario)
        field = self._fields(harbours, generators)
        strangers: tuple[NDArray[Any], ...] = ()
        if room:
            most = np.array([self._scenarios[k].strangers for k in row])
            strangers = draw_strangers(
                scenario, most, self._strangers, self._sight.range_m, generators, room
            )
            scenario = scenario._replace(strangers=strangers)
        noise = Noise(self._noise, generators, (vessels, vessels + buoys + room), block=1)
        drawn = noise.next()
        chance = np.stack([g.random((vessels + 1, CHANCES)) for g in generators])
        more = self._conditions.chances - CHANCES
        if more:
            further = np.stack([g.random((vessels + 1, more)) for g in generators])
            chance = np.concatenate([chance, further], axis=-1)
        every = np.arange(len(generators))
        lag_s = self._conditions.thrust_lag_s
        land = Land((len(generators), vessels), self._land) if self.has_harbours else None
        state = State(len(generators), vessels, buoys, room, self._vessel, lag_s, land)
        state.begin(every, scenario)
        if self._conditions.varied:
            state.take_hulls(every, draw_hulls(self._conditions, self._vessel, chance))
        if self._conditions.currents:
            state.take_field(every, field, np.zeros(len(every)))
        if land is not None:
            land.begin(every, harbours, chance)
            state.take_aim(every)
        seen = Perception(noise, self._sight).observe(state, scenario.vessel, drawn).rows
        rows = seen * scenario.vessel[..., None]
        placed: tuple[Any, ...] = scenario[:SCENARIO_PARTS]
        return (*placed, *strangers, rows, chance, field)


SCENARIO_PARTS = len(Scenarios._fields) - 1


class Pool:
    """Keeps up to `depth` drawn rows of each slot; the n-th of a slot is always the same.

    Parameters
    ----------
    make
        Gives arrays of rows, by slot and by number within the slot.
    slots, depth
        How many slots there are and how far ahead each is drawn.
    """

    def __init__(
        self, make: Callable[[Index, Index], tuple[NDArray[Any], ...]], slots: int, depth: int
    ) -> None:
        self._make, self._depth = make, depth
        self._taken, self._made = np.zeros((2, slots), np.intp)
        self._rows: list[NDArray[Any]] = []

    def take(self, slots: Index) -> list[NDArray[Any]]:
        """Give the next rows of each of these slots (each at most once)."""
        if (self._made[slots] == self._taken[slots]).any():
            self._refill()
        place = slots * self._depth + self._taken[slots] % self._depth
        self._taken[slots] += 1
        return [rows[place] for rows in self._rows]

    def forget(self) -> None:
        """Drop what was drawn ahead: from now on `make` is asked anew."""
        self._made[:] = self._taken

    def _refill(self) -> None:
        """Draw ahead for every slot that has used up half."""
        missing = self._depth - (self._made - self._taken)
        missing[2 * missing < self._depth] = 0
        slots = np.repeat(np.arange(len(missing)), missing)
        ends = np.cumsum(missing)
        numbers = self._made[slots] + np.arange(ends[-1]) - np.repeat(ends - missing, missing)
        fresh = self._make(slots, numbers)
        if not self._rows:
            size = len(missing) * self._depth
            self._rows = [np.zeros((size, *rows.shape[1:]), rows.dtype) for rows in fresh]
        for into, rows in zip(self._rows, fresh, strict=True):
            into[slots * self._depth + numbers % self._depth] = rows
        self._made += missing
