"""From the pilot's two channels to the two propellers' pulse widths, in MANUAL mode."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from twinscrew.hil_sim.autopilot.parameters import Parameters

TWO_PADDLES = 1
"""PILOT_STEER_TYPE 1: channel RCMAP_ROLL is the left paddle, RCMAP_THROTTLE the right one."""
SERVOS = 16
THROTTLE_LEFT, THROTTLE_RIGHT = 73, 74
"""SERVOn_FUNCTION of the two propellers."""


def in_uint16(pwm_us: float) -> int:
    """Round a pulse width to what MAVLink can carry, however odd the parameters are."""
    return round(max(0.0, min(65534.0, pwm_us)))


@dataclass(frozen=True, slots=True)
class Calibration:
    """What one channel's or output's pulse widths [us] mean."""

    low: float
    trim: float
    high: float
    dead: float = 0.0

    @classmethod
    def of(cls, kind: str, number: int, parameters: Parameters) -> Calibration:
        """Read RCn_* or SERVOn_*; ArduPilot's factory values where the table has none."""
        name = f"{kind}{number}"
        return cls(
            parameters.get(f"{name}_MIN", 1100),
            parameters.get(f"{name}_TRIM", 1500),
            parameters.get(f"{name}_MAX", 1900),
            parameters.get(f"{name}_DZ", 0),
        )

    def fraction(self, pulse_us: float) -> float:
        """Give a channel's deflection, -1 to 1, outside its dead zone; none without a pulse."""
        offset = pulse_us - self.trim
        if pulse_us == 0 or abs(offset) <= self.dead:
            return 0.0
        span = (self.high - self.trim if offset > 0 else self.trim - self.low) - self.dead
        fraction = (abs(offset) - self.dead) / span if span > 0 else 0.0
        return min(1.0, fraction) * (1.0 if offset > 0 else -1.0)

    def pulse(self, fraction: float) -> int:
        """Give an output's pulse width [us] for a fraction, -1 to 1."""
        within = max(-1.0, min(1.0, fraction))
        span = self.high - self.trim if within > 0 else self.trim - self.low
        return in_uint16(self.trim + within * span)


class Mixer:
    """The wiring of one set of parameters."""

    def __init__(self, parameters: Parameters) -> None:
        self._steer, self._throttle = (
            int(parameters[name]) for name in ("RCMAP_ROLL", "RCMAP_THROTTLE")
        )
        self._steer_input = Calibration.of("RC", self._steer, parameters)
        self._throttle_input = Calibration.of("RC", self._throttle, parameters)
        self._two_paddles = parameters["PILOT_STEER_TYPE"] == TWO_PADDLES
        functions = [parameters.get(f"SERVO{n}_FUNCTION", 0.0) for n in range(1, SERVOS + 1)]
        self.functions = functions
        """SERVOn_FUNCTION of outputs 1 to 16."""
        self._expo = parameters.get("MOT_THST_EXPO", 0.0)
        self._least = parameters.get("MOT_THR_MIN", 0.0) / 100.0
        self._left = self._output(THROTTLE_LEFT, parameters)
        self._right = self._output(THROTTLE_RIGHT, parameters)
        self._neutral = self._outputs = self._mix(0.0, 0.0)
        self._pulses = (0, 0)

    def outputs(self, channels: Sequence[int] | None) -> tuple[int, int]:
        """Give the left and right pulse widths [us] for channels [us]; None is neutral."""
        if channels is None:
            return self._neutral
        pulses = _channel(channels, self._steer), _channel(channels, self._throttle)
        if pulses != self._pulses:  # mostly nothing has changed since the last step
            self._pulses, self._outputs = pulses, self._mix(*self._paddles(*pulses))
        return self._outputs

    def both(self, fraction: float) -> tuple[int, int]:
        """Give the pulse widths [us] that drive both propellers alike, -1 to 1."""
        return self._mix(fraction, fraction)

    def _mix(self, left: float, right: float) -> tuple[int, int]:
        return self._left.pulse(self._bent(left)), self._right.pulse(self._bent(right))

    def _bent(self, throttle: float) -> float:
        """Lift a motor's throttle over MOT_THR_MIN, and bend it by MOT_THST_EXPO.

        The bend takes thrust to go with (1 - e) y + e y^2 of the output y, and solves for y.
        """
        if throttle == 0.0:
            return 0.0
        size = min(abs(throttle), 1.0)
        if self._least > 0.0:
            size = self._least + size * (1.0 - self._least)
        e = self._expo
        if 1e-6 < abs(e) <= 1.0:
            size = (e - 1.0 + math.sqrt((1.0 - e) ** 2 + 4.0 * e * size)) / (2.0 * e)
        return math.copysign(size, throttle)

    def _paddles(self, steer_us: int, throttle_us: int) -> tuple[float, float]:
        steer = self._steer_input.fraction(steer_us)
        throttle = self._throttle_input.fraction(throttle_us)
        if self._two_paddles:
            return steer, throttle
        return throttle + steer, throttle - steer  # one stick steers, the other drives

    def _output(self, function: int, parameters: Parameters) -> Calibration:
        number = self.functions.index(function) + 1 if function in self.functions else 0
        return Calibration.of("SERVO", number, parameters)


def _channel(channels: Sequence[int], number: int) -> int:
    return channels[number - 1] if 1 <= number <= len(channels) else 0
