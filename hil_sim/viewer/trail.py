"""Where a vessel has been: enough to draw a line, never more than a bounded number of places."""

from __future__ import annotations

import numpy as np

from twinscrew.runtime.messages.types import Float64

STEP_M = 0.5
"""[m] A place nearer than this to the last one adds nothing that could be seen."""
MOST = 2000
"""[-] Places; when there are more, every second one is forgotten and the step doubles."""


class Trail:
    """Collects places as they come."""

    def __init__(self, step_m: float = STEP_M, most: int = MOST) -> None:
        self._step_m = step_m
        self._most = most
        self._places: list[tuple[float, float, float]] = []
        self.is_preceded = False
        """Whether the way before the first place is known too."""

    def add(self, time_s: float, north: float, east: float) -> None:
        """Take in a place [s, m, m], if it is far enough from the last one."""
        if self._places:
            _, last_north, last_east = self._places[-1]
            if (north - last_north) ** 2 + (east - last_east) ** 2 < self._step_m**2:
                return
        self._places.append((round(time_s, 2), round(north, 2), round(east, 2)))
        if len(self._places) > self._most:
            del self._places[1::2]
            self._step_m *= 2.0

    def precede(self, p_N: Float64) -> None:
        """Put the way in front that was sailed before anybody looked; the first telling counts.

        Parameters
        ----------
        p_N : (K, 2) float64
            [m] The whole way until now, oldest first, frame N: beyond where our own places begin
            it says nothing new.
        """
        if self.is_preceded or not self._places or not len(p_N):
            return
        begin_s, north, east = self._places[0]
        nearest = int(np.argmin(np.hypot(p_N[:, 0] - north, p_N[:, 1] - east)))
        earlier = [(begin_s, round(n, 2), round(e, 2)) for n, e in p_N[:nearest].tolist()]
        self._places = [*earlier, *self._places][-self._most :]
        self.is_preceded = bool(earlier)

    @property
    def places(self) -> tuple[tuple[float, float, float], ...]:
        """Time [s], north, east [m], oldest first."""
        return tuple(self._places)
