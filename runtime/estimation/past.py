"""The filter's states of the last seconds, for fixes that come late."""

from __future__ import annotations

import numpy as np

from twinscrew.runtime.estimation.kinematics import ATTITUDE, STATES
from twinscrew.runtime.messages.types import Float64

SIZE = 256
"""[-] States kept: 2.5 s at 100 Hz."""


class Past:
    """A ring of states, oldest overwritten first."""

    def __init__(self) -> None:
        self._x = np.zeros((SIZE, STATES))
        self._stamps_ns = np.zeros(SIZE, dtype=np.int64)
        self._count = 0

    @property
    def newest_ns(self) -> int | None:
        """[ns] The time of the newest state; None if there is none."""
        return None if self._count == 0 else int(self._stamps_ns[(self._count - 1) % SIZE])

    def clear(self) -> None:
        """Forget everything."""
        self._count = 0

    def add(self, stamp_ns: int, x: Float64) -> None:
        """Keep a state that is newer than all others."""
        place = self._count % SIZE
        self._x[place], self._stamps_ns[place] = x, stamp_ns
        self._count += 1

    def correct(self, dx: Float64) -> None:
        """Note that the filter was off by `dx`, (15,), now and so in the time before.

        Without it, the next late fix would be compared with a state that does not know of this
        correction, and would make it again.
        """
        self._x += dx

    def at(self, stamp_ns: int) -> Float64 | None:
        """Give the state at a time, (15,); None if it lies before all that are kept.

        Between two states it is interpolated, but for the attitude: angles do not mix across
        south.
        """
        later: int | None = None
        for place in range(self._count - 1, max(-1, self._count - 1 - SIZE), -1):
            index = place % SIZE
            stamp = int(self._stamps_ns[index])
            if stamp <= stamp_ns:
                if later is None or stamp == stamp_ns:
                    then: Float64 = self._x[index].copy()
                    return then
                f = (stamp_ns - stamp) / (int(self._stamps_ns[later]) - stamp)
                between: Float64 = self._x[index] + f * (self._x[later] - self._x[index])
                between[ATTITUDE] = self._x[index, ATTITUDE]
                return between
            later = index
        return None
