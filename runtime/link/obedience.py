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
from collections.abc import Hashable

TRIES = 3
"""[-] After the autopilot disobeyed this often, it is not tried again until something changes."""
WITHHELD_S = 5.0
"""[s] Neutral thrust for this long between two tries."""
TRUSTED_S = 5.0
"""[s] Obeyed for this long without a break: earlier disobedience is forgotten."""

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
            if any(abs(o - stop) > self._tolerance_us for o in outputs):
                self.obeying = True
            elif self.obeying is False:
                self.obeying = None
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


class Trials:
    """Decides whether an autopilot that disobeyed is tried again: a few times, then not."""

    def __init__(self) -> None:
        self._situation: Hashable = None
        self._disobeyed = 0
        self._withheld_until_s = -math.inf
        self._obeys_since_s: float | None = None

    @property
    def given_up(self) -> bool:
        """Whether nothing but a change of the situation brings a further try."""
        return self._disobeyed >= TRIES

    def judge(self, obeying: bool | None, situation: Hashable, now_s: float) -> None:
        """Take what `Obedience` says; a situation that differs from the last one starts over."""
        if situation != self._situation:
            self._situation, self._disobeyed = situation, 0
            self._withheld_until_s = -math.inf
        if obeying is False and not self.withhold(now_s):
            self._disobeyed += 1
            self._withheld_until_s = now_s + WITHHELD_S
        if obeying is not True:
            self._obeys_since_s = None
        elif self._obeys_since_s is None:
            self._obeys_since_s = now_s
        elif now_s - self._obeys_since_s >= TRUSTED_S:
            self._disobeyed = 0

    def withhold(self, now_s: float) -> bool:
        """Tell whether thrust is to be neutral now."""
        return self.given_up or now_s < self._withheld_until_s
