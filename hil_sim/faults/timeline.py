"""Something that changes, with the times at which it did."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable, Iterable
from itertools import pairwise
from typing import Any, Generic, NamedTuple, TypeVar

T = TypeVar("T")


class Span(NamedTuple):
    """From when to when [s]."""

    begin_s: float
    end_s: float

    @property
    def length_s(self) -> float:
        """[s] How long it is."""
        return self.end_s - self.begin_s

    def holds(self, time_s: float) -> bool:
        """Tell whether a time lies in it, its ends included."""
        return self.begin_s <= time_s <= self.end_s


class Timeline(Generic[T]):
    """Remembers what something was, and when; only changes are kept."""

    def __init__(self, before: T, *changes: tuple[float, T]) -> None:
        """Begin with what it is `before` the first change; `changes` are (time [s], value)."""
        self._before = before
        self._times: list[float] = []
        self._values: list[T] = []
        for time_s, value in changes:
            self.note(time_s, value)

    def note(self, time_s: float, value: T) -> None:
        """See what it is now; times do not go back."""
        if value != self.last:
            self._values.append(value)
            self._times.append(time_s)

    @property
    def last(self) -> T:
        """What it is now."""
        return self._values[-1] if self._values else self._before

    def at(self, time_s: float) -> T:
        """Give what it was at a time."""
        number = bisect_right(self._times, time_s)
        return self._values[number - 1] if number else self._before

    def changes(self, begin_s: float, end_s: float) -> list[float]:
        """Give the times [s] after `begin_s`, and not after `end_s`, at which it changed."""
        return self._times[bisect_right(self._times, begin_s) : bisect_right(self._times, end_s)]


def spans(
    holds: Callable[[float], bool], lines: Iterable[Timeline[Any]], begin_s: float, end_s: float
) -> list[Span]:
    """Give when something held, between two times.

    Parameters
    ----------
    holds
        Whether it did at a time [s].
    lines
        What that follows from: it changes only where one of them does.
    """
    changes = {time_s for line in lines for time_s in line.changes(begin_s, end_s)}
    found: list[Span] = []
    for start_s, stop_s in pairwise([begin_s, *sorted(changes - {end_s}), end_s]):
        if not holds(start_s):
            continue
        if found and found[-1].end_s == start_s:
            found[-1] = Span(found[-1].begin_s, stop_s)
        else:
            found.append(Span(start_s, stop_s))
    return found
