"""Which paddles go out: the thrust that is asked for, stop, or hands off."""

from __future__ import annotations

from collections.abc import Sequence

from twinscrew.runtime.link.paddles import STOP_US, PaddleSettings, pwm_from_thrust
from twinscrew.runtime.messages.types import Float64

Pair = tuple[int, int]
"""Left and right [us]."""
Thrust = Float64 | Sequence[float]
"""(2,) [N] left, right."""

STOP: Pair = (STOP_US, STOP_US)
RELEASED: Pair = (0, 0)
"""Both channels given back to the pilot's receiver."""
STOP_BEFORE_RELEASE_S = 0.2
"""[s] Stop goes first: without a receiver a released channel keeps its last value."""
RELEASE_S = 0.5
"""[s] How long channels are given back, several times over: a message may be lost."""


def paddles(thrust: Thrust, scale: PaddleSettings) -> Pair:
    """Give the pulse widths [us] for a thrust."""
    return pwm_from_thrust(float(thrust[0]), scale), pwm_from_thrust(float(thrust[1]), scale)


class LettingGo:
    """Stop, then give the channels back, then be silent."""

    def __init__(self) -> None:
        self._since_s: float | None = None

    def hold(self) -> None:
        """Take the channels again."""
        self._since_s = None

    def let_go(self, now_s: float) -> Pair | None:
        """Give what to send now; None for nothing."""
        if self._since_s is None:
            self._since_s = now_s
        elapsed_s = now_s - self._since_s
        if elapsed_s < STOP_BEFORE_RELEASE_S:
            return STOP
        return RELEASED if elapsed_s <= STOP_BEFORE_RELEASE_S + RELEASE_S else None
