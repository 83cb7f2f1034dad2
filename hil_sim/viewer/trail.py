"""Where a vessel has been: enough to draw a line, never more than a bounded number of places."""

from __future__ import annotations

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

    @property
    def places(self) -> tuple[tuple[float, float, float], ...]:
        """Time [s], north, east [m], oldest first."""
        return tuple(self._places)
