"""Does the autopilot do what it is told? Only SERVO_OUTPUT_RAW knows.

ArduPilot ignores overrides of a system it does not listen to (SYSID_MYGCS) without a word, and
RC_CHANNELS may show values long past. So the outputs are compared with what was commanded within
the last moments: the link has a delay, and the thrust may be on its way. And when a pilot takes the
boat the outputs stop at once, but the heartbeat that says so comes up to a second later: it is
waited for.
"""

from __future__ import annotations

import math
from collections import deque

Pair = tuple[int, int]
"""Left and right [us]."""


class Obedience:
    """Compares outputs with commands.

    Parameters
    ----------
    tolerance_us
        [us] Difference that rounding may make (measured: 1 us).
    delay_s
        [s] How old a command the outputs may still show.
    patience_s
        [s] How long outputs may differ before that is disobedience.
    """

    def __init__(self, tolerance_us: int, delay_s: float, patience_s: float) -> None:
        self._tolerance_us = tolerance_us
        self._delay_s = delay_s
        self._patience_s = patience_s
        self.reset()

    def reset(self) -> None:
        """Forget everything, as when somebody else drove."""
        self._commands: deque[tuple[float, Pair]] = deque()
        self._differs_since_s: float | None = None
        self._confirmed_s = -math.inf
        self.obeying: bool | None = None
        """True if the outputs follow, False if not, None while that is unproven: the outputs
        never left stop, so that nobody can tell."""
        self.outputs: Pair | None = None
        """[us] The last outputs."""

    def commanded(self, pair: Pair, now_s: float) -> None:
        """Note a command that was sent."""
        self._commands.append((now_s, pair))
        while len(self._commands) > 1 and self._commands[1][0] < now_s - self._delay_s:
            self._commands.popleft()  # one older than the delay stays: it acted when it began

    def confirmed(self, now_s: float) -> None:
        """Note that the autopilot says we drive: outputs that differ are nobody else's doing."""
        self._confirmed_s = now_s

    def measured(self, outputs: Pair, stop: int, now_s: float) -> None:
        """Judge the outputs that SERVO_OUTPUT_RAW tells; `stop` [us] proves nothing."""
        self.outputs = outputs
        if not self._commands or now_s - self._commands[0][0] < self._delay_s / 2:
            return
        if self._explained(outputs):
            self._differs_since_s = None
            if self.obeying is False or any(abs(o - stop) > self._tolerance_us for o in outputs):
                self.obeying = True
            return
        if self._differs_since_s is None:
            self._differs_since_s = now_s
        since_s = self._differs_since_s
        if now_s - since_s >= self._patience_s and self._confirmed_s > since_s:
            self.obeying = False

    def _explained(self, outputs: Pair) -> bool:
        for side, output in enumerate(outputs):
            sent = [pair[side] for _, pair in self._commands]
            low, high = min(sent) - self._tolerance_us, max(sent) + self._tolerance_us
            if not low <= output <= high:
                return False
        return True
