"""The next episodes of every slot, drawn many at a time so that a reset only copies rows."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from twinscrew.runtime.messages.types import Float32
from twinscrew.training.scenarios import Scenarios

Index: TypeAlias = NDArray[np.intp]


class Beginning(NamedTuple):
    """How N episodes begin."""

    scenario: Scenarios
    ego: Float32
    """(N, V, 7) What the vessels see at first."""
    objects: Float32
    """(N, V, K, 5)"""
    mask: Float32
    """(N, V, K)"""
    chance: NDArray[np.float64]
    """(N, V + 1, C) Uniform numbers in [0, 1) for the conditions of each vessel and of all."""


class Pool:
    """Keeps up to `depth` beginnings of each slot; the n-th of a slot is always the same.

    Parameters
    ----------
    make
        Gives the beginnings of episodes, by slot and by number within the slot.
    slots, depth
        How many slots there are and how far ahead each is drawn.
    """

    def __init__(self, make: Callable[[Index, Index], Beginning], slots: int, depth: int) -> None:
        self._make = make
        self._depth = depth
        self._taken = np.zeros(slots, np.intp)
        self._made = np.zeros(slots, np.intp)
        self._rows: Beginning | None = None

    def take(self, slots: Index) -> Beginning:
        """Give the next beginning of each of these slots (each at most once)."""
        if (self._made[slots] == self._taken[slots]).any():
            self._refill()
        rows = slots * self._depth + self._taken[slots] % self._depth
        self._taken[slots] += 1
        taken: Beginning = map_rows(lambda array: array[rows], self._rows)
        return taken

    def forget(self) -> None:
        """Drop what was drawn ahead: from now on `make` is asked anew."""
        self._made[:] = self._taken

    def _refill(self) -> None:
        """Draw ahead for every slot that has used up half."""
        missing = self._depth - (self._made - self._taken)
        missing[2 * missing < self._depth] = 0
        slots = np.repeat(np.arange(len(missing)), missing)
        numbers = self._made[slots] + _count_up(missing)
        fresh = self._make(slots, numbers)
        if self._rows is None:
            size = len(missing) * self._depth
            self._rows = map_rows(lambda a: np.zeros((size, *a.shape[1:]), a.dtype), fresh)
        for into, array in zip(_leaves(self._rows), _leaves(fresh), strict=True):
            into[slots * self._depth + numbers % self._depth] = array
        self._made += missing


def map_rows(function: Callable[[Any], Any], tree: Any) -> Any:
    """Apply a function to every array of a (nested) named tuple."""
    if isinstance(tree, tuple):
        return type(tree)(*(map_rows(function, part) for part in tree))
    return function(tree)


def _leaves(tree: Any) -> list[NDArray[Any]]:
    if isinstance(tree, tuple):
        return [leaf for part in tree for leaf in _leaves(part)]
    return [tree]


def _count_up(repeats: Index) -> Index:
    """Give 0, 1, ..., n - 1 for every n, one after the other."""
    ends = np.cumsum(repeats)
    return np.arange(ends[-1]) - np.repeat(ends - repeats, repeats)
