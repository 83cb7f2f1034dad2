"""From the pilot's two channels to the two propellers' pulse widths, in MANUAL mode."""

from __future__ import annotations

from collections.abc import Sequence

from twinscrew.hil_sim.autopilot.parameters import Parameters

TWO_PADDLES = 1
"""PILOT_STEER_TYPE 1: channel RCMAP_ROLL is the left paddle, RCMAP_THROTTLE the right one."""


def paddle_outputs(channels: Sequence[int] | None, parameters: Parameters) -> tuple[int, int]:
    """Give the left and right pulse widths [us] for channels [us]; None is neutral."""
    if channels is None:
        return _output(0.0, parameters, 1), _output(0.0, parameters, 3)
    steer = _normalise(channels, int(parameters["RCMAP_ROLL"]), parameters)
    throttle = _normalise(channels, int(parameters["RCMAP_THROTTLE"]), parameters)
    if parameters["PILOT_STEER_TYPE"] == TWO_PADDLES:
        left, right = steer, throttle
    else:  # one stick steers, the other drives: the paddles become a mixture
        left, right = throttle + steer, throttle - steer
    return _output(left, parameters, 1), _output(right, parameters, 3)


def in_uint16(pwm_us: float) -> int:
    """Round a pulse width to what MAVLink can carry, however odd the parameters are."""
    return round(max(0.0, min(65534.0, pwm_us)))


def _normalise(channels: Sequence[int], channel: int, parameters: Parameters) -> float:
    """Give a channel's deflection, -1 to 1, outside its dead zone RCx_DZ."""
    if not 1 <= channel <= len(channels) or channels[channel - 1] == 0:
        return 0.0
    low, trim, high, dead = _calibration("RC", channel, parameters)
    offset = channels[channel - 1] - trim
    if abs(offset) <= dead:
        return 0.0
    span = high - trim - dead if offset > 0 else trim - low - dead
    fraction = (abs(offset) - dead) / span if span > 0 else 0.0
    return min(1.0, fraction) * (1.0 if offset > 0 else -1.0)


def _output(fraction: float, parameters: Parameters, servo: int) -> int:
    low, trim, high, _ = _calibration("SERVO", servo, parameters)
    fraction = max(-1.0, min(1.0, fraction))
    return in_uint16(trim + fraction * (high - trim if fraction > 0 else trim - low))


def _calibration(
    kind: str, number: int, parameters: Parameters
) -> tuple[float, float, float, float]:
    def value(what: str, factory: float) -> float:
        return parameters.get(f"{kind}{number}_{what}", factory)

    # ArduPilot's factory calibration, for channels that the shipped file does not set
    return value("MIN", 1100), value("TRIM", 1500), value("MAX", 1900), value("DZ", 0)
