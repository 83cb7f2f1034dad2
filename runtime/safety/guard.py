"""The last check before the propellers: finite and in range, or zero."""

from __future__ import annotations

import numpy as np

from twinscrew.runtime.messages.types import Float64, HealthEvent
from twinscrew.runtime.safety.events import GUARD_TRIPPED
from twinscrew.runtime.settings import Settings

NEUTRAL: Float64 = np.zeros(2)
NEUTRAL.setflags(write=False)


class ThrustLimits(Settings, frozen=True):
    """What one propeller can do."""

    min_n: float = -500.0
    """[N] Full astern (paper, sec. III)."""
    max_n: float = 1000.0
    """[N] Full ahead (paper, sec. III)."""

    def clip(self, thrust: Float64) -> Float64:
        """Bring thrusts [N] into the range."""
        return np.clip(thrust, self.min_n, self.max_n)


class Guard:
    """Lets a thrust pass if both values are finite and in range; else zero and an event."""

    TOLERANCE_N = 1e-6
    """[N] Rounding that is no fault."""

    def __init__(self, limits: ThrustLimits | None = None) -> None:
        self.limits = limits or ThrustLimits()

    def check(self, thrust: Float64, stamp_ns: int) -> tuple[Float64, HealthEvent | None]:
        """Check a command.

        Parameters
        ----------
        thrust : (2,) float64
            Left and right thrust [N].
        stamp_ns : int
            The time for the event.

        Returns
        -------
        thrust : (2,) float64
            The same thrust, or zeros.
        event : HealthEvent or None
            `guard_tripped`, with the refused values, where zeros were put.
        """
        low, high = self.limits.min_n - self.TOLERANCE_N, self.limits.max_n + self.TOLERANCE_N
        if thrust.shape == (2,) and low <= thrust[0] <= high and low <= thrust[1] <= high:
            return thrust, None
        allowed = f"[{self.limits.min_n:g}, {self.limits.max_n:g}] N"
        return NEUTRAL, GUARD_TRIPPED.at(stamp_ns, f"thrust {thrust.tolist()} is not in {allowed}")
