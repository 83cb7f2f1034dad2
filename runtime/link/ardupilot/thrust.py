"""From thrust [N] to the PWM of two thrusters, and how the channels are given back to a pilot."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from twinscrew.runtime.messages.types import Float64
from twinscrew.runtime.settings import Positive, Settings
from twinscrew.runtime.vessel_description import load_vessel

# -- Thrust as an autopilot's paddles understand it: 1500 us is stop, 1000 to 2000 us is all.
#
# Ahead and astern have scales of their own, because a propeller pushes less astern: 2000 us is the
# greatest thrust ahead (1000 N for the default vessel), 1000 us the greatest astern (500 N). One
# microsecond is then 2 N ahead and 1 N astern. Both sides are linear unless the vessel has a thrust
# curve. The simulator turns servo outputs back with the same module.


STOP_US = 1500
"""[us] No thrust."""
SPAN_US = 500
"""[us] From stop to the greatest thrust, either way: 1000 to 2000 us (RCx_MIN, RCx_MAX)."""
STICK_SPAN = 1000
"""[-] MANUAL_CONTROL's full stick."""


class PaddleSettings(Settings, frozen=True):
    """What full paddle means: the vessel's thrust range, each propeller."""

    ahead_N: Positive = load_vessel().thrusters.max_n
    """[N] Thrust at 2000 us."""
    astern_N: Positive = -load_vessel().thrusters.min_n
    """[N] Thrust astern at 1000 us, a positive number."""
    curve: tuple[tuple[float, float], ...] = ()
    """Thrust [N] over the paddle's position in [-1, 1], in rising order; empty: straight lines."""


def fraction_from_thrust(thrust_N: float, scale: PaddleSettings) -> float:
    """Give the paddle's position in [-1, 1] for a thrust [N]; anything not finite is stop."""
    if not math.isfinite(thrust_N):
        return 0.0
    if scale.curve:
        return _from_curve(scale.curve, thrust_N)
    full = scale.ahead_N if thrust_N >= 0.0 else scale.astern_N
    return max(-1.0, min(1.0, thrust_N / full))


def thrust_from_fraction(fraction: float, scale: PaddleSettings) -> float:
    """Give the thrust [N] of a paddle's position; beyond [-1, 1] is full."""
    if scale.curve:
        positions, thrusts = zip(*scale.curve, strict=True)
        return float(np.interp(fraction, positions, thrusts))
    full = scale.ahead_N if fraction >= 0.0 else scale.astern_N
    return max(-1.0, min(1.0, fraction)) * full


def _from_curve(curve: tuple[tuple[float, float], ...], thrust_N: float) -> float:
    """Give the position nearest to stop that gives a thrust: a dead band is passed over."""
    if thrust_N == 0.0:
        return 0.0
    sign = math.copysign(1.0, thrust_N)
    branch = sorted((sign * at, sign * n) for at, n in curve if sign * at >= 0.0)
    before = (0.0, 0.0)
    for after in branch:
        if after[1] >= abs(thrust_N):
            share = (abs(thrust_N) - before[1]) / max(after[1] - before[1], 1e-12)
            return sign * (before[0] + share * (after[0] - before[0]))
        before = after
    return sign


def pwm_from_thrust(thrust_N: float, scale: PaddleSettings) -> int:
    """Give the pulse width [us], 1000 to 2000, for a thrust [N]."""
    return STOP_US + round(SPAN_US * fraction_from_thrust(thrust_N, scale))


def thrust_from_pwm(pwm_us: float, scale: PaddleSettings) -> float:
    """Give the thrust [N] of a pulse width [us]; 0 us (no pulse) is stop."""
    if pwm_us <= 0:
        return 0.0
    return thrust_from_fraction((pwm_us - STOP_US) / SPAN_US, scale)


def stick_from_pwm(pwm_us: int) -> int:
    """Give MANUAL_CONTROL's stick, -1000 to 1000, for a pulse width [us]."""
    return round((pwm_us - STOP_US) * STICK_SPAN / SPAN_US)


# -- Which paddles go out: the thrust that is asked for, stop, or hands off.

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


class ChannelRelease:
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
