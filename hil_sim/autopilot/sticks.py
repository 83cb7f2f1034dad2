"""From the two messages that move sticks to override values [us], channel 1 first."""

from __future__ import annotations

from operator import attrgetter

from twinscrew.hil_sim.autopilot.mixer import Calibration, in_uint16
from twinscrew.hil_sim.autopilot.parameters import Parameters
from twinscrew.hil_sim.autopilot.radio import CHANNELS, IGNORE, RELEASE
from twinscrew.runtime.link.ardupilot.thrust import STICK_SPAN
from twinscrew.runtime.mavlink import Message

_NOT_A_STICK = 32767
"""MANUAL_CONTROL's word for an axis that is not there."""

override_values = attrgetter(*(f"chan{n}_raw" for n in range(1, CHANNELS + 1)))
"""The values of RC_CHANNELS_OVERRIDE, as many as the radio has channels."""


def stick_values(message: Message, parameters: Parameters) -> list[int]:
    """Give the values of MANUAL_CONTROL: y moves RCMAP_ROLL, z moves RCMAP_THROTTLE."""
    values = [IGNORE] * CHANNELS
    for name, stick in (("RCMAP_ROLL", message.y), ("RCMAP_THROTTLE", message.z)):
        channel = int(parameters[name])
        if 1 <= channel <= CHANNELS:
            values[channel - 1] = _pulse(Calibration.of("RC", channel, parameters), stick)
    return values


def _pulse(calibration: Calibration, stick: int) -> int:
    if stick == _NOT_A_STICK:
        return RELEASE  # read in its sources: an axis that is not there gives its channel back
    within = max(-STICK_SPAN, min(STICK_SPAN, stick)) / STICK_SPAN
    return in_uint16(calibration.low + (calibration.high - calibration.low) * (within + 1.0) / 2.0)
