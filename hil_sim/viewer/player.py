"""One page's place in time: with the boat, or anywhere in a recording."""

from __future__ import annotations

import math

from twinscrew.hil_sim.viewer.source import Source
from twinscrew.hil_sim.viewer.wire import Request, encode_frame

SPEEDS = (0.25, 16.0)
"""[-] How slow and how fast a recording may be played."""


class Player:
    """Gives a page its next frame. Pausing is the page's own: others see on."""

    def __init__(self, source: Source) -> None:
        self._source = source
        self._playing = True
        self._speed = 1.0
        self._time_s = 0.0
        self._last_s: float | None = None
        self._due = True

    def ask(self, request: Request) -> None:
        """Do what the page asks for; the next frame follows it even in a pause."""
        if request.playing is not None:
            self._playing = request.playing
            if self._playing and self._time_s >= self._source.duration_s:
                self._time_s = 0.0
        if request.speed is not None and math.isfinite(request.speed):
            self._speed = min(max(request.speed, SPEEDS[0]), SPEEDS[1])
        if request.seek_s is not None and math.isfinite(request.seek_s):
            self._time_s = min(max(request.seek_s, 0.0), self._source.duration_s)
        self._due = True

    def frame(self, clock_s: float) -> bytes | None:
        """Give the frame for a moment of a steady clock [s]; None if nothing has changed."""
        elapsed_s = 0.0 if self._last_s is None else clock_s - self._last_s
        self._last_s = clock_s
        if not self._playing and not self._due:
            return None
        self._due = False
        if self._source.mode == "live":
            time_s = self._source.now_s()
        else:
            time_s = self._wind(elapsed_s)
        return encode_frame(time_s, self._source.parts(time_s), playing=self._playing)

    def _wind(self, elapsed_s: float) -> float:
        if self._playing:
            self._time_s += self._speed * elapsed_s
        if self._time_s >= self._source.duration_s:
            self._time_s, self._playing = self._source.duration_s, False
        return self._time_s
