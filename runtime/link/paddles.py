"""Thrust as an autopilot's paddles understand it: 1500 us is stop, both sides linear.

Ahead and astern have scales of their own, because a propeller pushes less astern: 2000 us is the
greatest thrust ahead (1000 N as published), 1000 us the greatest astern (500 N). One microsecond
is then 2 N ahead and 1 N astern. The simulator turns servo outputs back with the same module.
"""

from __future__ import annotations

import math

from twinscrew.runtime.settings import Positive, Settings

STOP_US = 1500
"""[us] No thrust."""
SPAN_US = 500
"""[us] From stop to the greatest thrust, either way: 1000 to 2000 us (RCx_MIN, RCx_MAX)."""
STICK_SPAN = 1000
"""[-] MANUAL_CONTROL's full stick."""


class PaddleSettings(Settings, frozen=True):
    """What full paddle means: the vessel's thrust range, each propeller."""

    ahead_N: Positive = 1000.0
    """[N] Thrust at 2000 us (paper: range [-500, 1000] N)."""
    astern_N: Positive = 500.0
    """[N] Thrust astern at 1000 us, a positive number (paper: range [-500, 1000] N)."""


def fraction_from_thrust(thrust_N: float, scale: PaddleSettings) -> float:
    """Give the paddle's position in [-1, 1] for a thrust [N]; anything not finite is stop."""
    if not math.isfinite(thrust_N):
        return 0.0
    full = scale.ahead_N if thrust_N >= 0.0 else scale.astern_N
    return max(-1.0, min(1.0, thrust_N / full))


def thrust_from_fraction(fraction: float, scale: PaddleSettings) -> float:
    """Give the thrust [N] of a paddle's position; beyond [-1, 1] is full."""
    full = scale.ahead_N if fraction >= 0.0 else scale.astern_N
    return max(-1.0, min(1.0, fraction)) * full


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
