"""From thrust [N] to the PWM of two thrusters, and how the channels are given back to a pilot."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Annotated, NamedTuple

import numpy as np
from msgspec import Meta

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
    low_us: Annotated[int, Meta(ge=500, le=1499)] = 1000
    """[us] Pulse at which the motor controllers give full thrust astern."""
    stop_us: Annotated[int, Meta(ge=600, le=2400)] = 1500
    """[us] Pulse at which they stand still."""
    high_us: Annotated[int, Meta(ge=1501, le=2500)] = 2000
    """[us] Pulse at which they give full thrust ahead."""

    def __post_init__(self) -> None:
        """Refuse pulses that are not in order."""
        if not self.low_us < self.stop_us < self.high_us:
            raise ValueError(
                "low_us < stop_us < high_us is needed, got "
                f"{self.low_us}, {self.stop_us}, {self.high_us}"
            )


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
    """Give the pulse width [us] that the motor controller must get for a thrust [N]."""
    fraction = fraction_from_thrust(thrust_N, scale)
    span = scale.high_us - scale.stop_us if fraction >= 0.0 else scale.stop_us - scale.low_us
    return scale.stop_us + round(span * fraction)


def thrust_from_pwm(pwm_us: float, scale: PaddleSettings) -> float:
    """Give the thrust [N] of a pulse width [us]; 0 us (no pulse) is stop."""
    return thrust_from_fraction(fraction_from_pwm(pwm_us, scale), scale)


def fraction_from_pwm(pwm_us: float, scale: PaddleSettings) -> float:
    """Give the share of full, about -1 to 1, of a motor controller's pulse; no pulse is stop."""
    if pwm_us <= 0:
        return 0.0
    offset = pwm_us - scale.stop_us
    span = scale.high_us - scale.stop_us if offset >= 0.0 else scale.stop_us - scale.low_us
    return offset / span


def stick_from_pwm(pwm_us: int) -> int:
    """Give MANUAL_CONTROL's stick, -1000 to 1000, for a pulse width [us]."""
    return round((pwm_us - STOP_US) * STICK_SPAN / SPAN_US)


# -- What the autopilot makes of a channel on the way to an output, in MANUAL with two paddles.
#
# ArduPilot Rover bends the paddles (MOT_THST_EXPO), leaves out the lowest ones (MOT_THR_MIN), and
# spreads them over SERVOn_MIN, SERVOn_TRIM and SERVOn_MAX. The channel is chosen so that the pulse
# that comes out is the one that the thrust needs.


class Output:
    """One output's way from its channel [us] to its pulse [us], and back.

    Parameters
    ----------
    values
        The autopilot's parameters, as far as they were read; the others are as shipped.
    number
        Of the output: SERVO1_MIN and so on.

    Source: ArduPilot's documentation of these parameters, and its rover's behaviour (SITL): x goes
    to the y in [0, 1] with x = e y^2 + (1 - e) y, after MOT_THR_MIN has lifted x.
    """

    def __init__(self, values: Mapping[str, float], number: int) -> None:
        self._low = values.get(f"SERVO{number}_MIN", STOP_US - SPAN_US)
        self._trim = values.get(f"SERVO{number}_TRIM", STOP_US)
        self._high = values.get(f"SERVO{number}_MAX", STOP_US + SPAN_US)
        expo, least = values.get("MOT_THST_EXPO", 0.0), values.get("MOT_THR_MIN", 0.0) / 100.0
        self._expo = expo if 1e-6 < abs(expo) <= 1.0 else 0.0
        self._least = least if 0.0 < least < 1.0 else 0.0
        in_order = self._low < self._trim < self._high
        self.is_straight = not in_order or (
            (self._low, self._trim, self._high, self._expo, self._least)
            == (STOP_US - SPAN_US, STOP_US, STOP_US + SPAN_US, 0.0, 0.0)
        )
        """Whether the pulse is the channel's own; so, too, where the parameters make no sense."""

    def channel(self, pulse_us: float) -> int:
        """Give the channel that makes a pulse; where none does, the nearest that there is."""
        if self.is_straight:
            return round(pulse_us)
        offset = pulse_us - self._trim
        span = self._high - self._trim if offset > 0.0 else self._trim - self._low
        y = min(abs(offset) / span, 1.0)
        x = self._expo * y * y + (1.0 - self._expo) * y
        stick = max(0.0, (x - self._least) / (1.0 - self._least))
        return STOP_US + round(math.copysign(SPAN_US * stick, offset))

    def pulse(self, channel_us: float) -> int:
        """Give the pulse that comes of a channel."""
        if self.is_straight:
            return round(channel_us)
        stick = max(-1.0, min(1.0, (channel_us - STOP_US) / SPAN_US))
        x = 0.0 if stick == 0.0 else self._least + (1.0 - self._least) * abs(stick)
        e = self._expo
        y = x if e == 0.0 else (math.sqrt((1.0 - e) ** 2 + 4.0 * e * x) - (1.0 - e)) / (2.0 * e)
        span = self._high - self._trim if stick > 0.0 else self._trim - self._low
        return round(self._trim + math.copysign(span * y, stick))


class Outputs(NamedTuple):
    """The left and the right output, which the shipped parameters put on 1 and 3."""

    left: Output
    right: Output

    @classmethod
    def bent(cls, values: Mapping[str, float]) -> Outputs | None:
        """Give what parameters make of the channels; None if they hand them through."""
        both = cls(Output(values, 1), Output(values, 3))
        return None if both.left.is_straight and both.right.is_straight else both

    def channels(self, pulses: Pair) -> Pair:
        """Give the channels [us] that make two pulses [us]."""
        return self.left.channel(pulses[0]), self.right.channel(pulses[1])

    def pulses(self, channels: Pair) -> Pair:
        """Give the pulses [us] that come of two channels [us]."""
        return self.left.pulse(channels[0]), self.right.pulse(channels[1])


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
