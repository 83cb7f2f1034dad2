"""ArduPilot SITL's JSON physics protocol: what it asks, and how it is answered. Bytes only.

SITL sends its servo outputs in a binary frame and waits; the physics answers with one line of JSON.
Facts: ArduPilot, libraries/SITL/examples/JSON/readme.md; run on ArduRover V4.6.0-dev.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from typing import Final, TypeAlias

Vector: TypeAlias = tuple[float, float, float]
"""Three numbers in plain floats: at 1200 frames a second faster than an array of three."""
Quaternion: TypeAlias = tuple[float, float, float, float]
"""w first."""

_HEADER: Final = struct.Struct("<HHI")
_CHANNELS: Final = {18458: 16, 29569: 32}
"""The frame's magic number says how many outputs it carries (32 with SERVO_32_ENABLE 1)."""
_OUTPUTS: Final = {magic: struct.Struct(f"<{channels}H") for magic, channels in _CHANNELS.items()}


@dataclass(frozen=True, slots=True)
class ServoFrame:
    """What ArduPilot asks: move on by one frame under these outputs."""

    rate_hz: int
    """[Hz] Frames a second that it wants (SIM_RATE_HZ)."""
    count: int
    """[-] Counts its frames; the same again is a repetition, a smaller one a restart."""
    pwm_us: tuple[int, ...]
    """[us] Outputs 1 to 16, or 1 to 32."""


@dataclass(frozen=True, slots=True)
class Motion:
    """What ArduPilot is told: its sensors follow from this."""

    time_s: float
    """[s] Physics time; ArduPilot's own time moves on by the difference to the last one."""
    rates_B: Vector
    """[rad/s] [B] Roll, pitch and yaw rate: the gyroscope."""
    specific_force_B: Vector
    """[m/s2] [B] What an accelerometer feels: (0, 0, -9.8) at rest."""
    position_N: Vector
    """[m] [N] From the place of `--home`."""
    q_NB: Quaternion
    """[-] Attitude."""
    velocity_N: Vector
    """[m/s] [N] Over ground."""


def decode_servos(datagram: bytes) -> ServoFrame | None:
    """Read a servo frame; None if the datagram is none."""
    if len(datagram) < _HEADER.size:
        return None
    magic, rate_hz, count = _HEADER.unpack_from(datagram)
    outputs = _OUTPUTS.get(magic)
    if outputs is None or len(datagram) != _HEADER.size + outputs.size:
        return None
    return ServoFrame(rate_hz, count, outputs.unpack_from(datagram, _HEADER.size))


def encode_servos(frame: ServoFrame) -> bytes:
    """Write a servo frame, as ArduPilot does: for simulated ones.

    Raises
    ------
    ValueError
        There are neither 16 nor 32 outputs.
    """
    for magic, channels in _CHANNELS.items():
        if len(frame.pwm_us) == channels:
            header = _HEADER.pack(magic, frame.rate_hz, frame.count)
            return header + _OUTPUTS[magic].pack(*frame.pwm_us)
    raise ValueError(f"a servo frame has 16 or 32 outputs, not {len(frame.pwm_us)}")


def encode_motion(motion: Motion) -> bytes:
    """Write the answer: one line, a newline before and after it, not one space in it.

    ArduPilot looks for `"key":` by text search, and older versions cannot step over a space.
    """
    return (
        f'\n{{"timestamp":{motion.time_s:.9f},'
        f'"imu":{{"gyro":{_list(motion.rates_B)},'
        f'"accel_body":{_list(motion.specific_force_B)}}},'
        f'"position":{_list(motion.position_N)},'
        f'"quaternion":{_list(motion.q_NB)},'
        f'"velocity":{_list(motion.velocity_N)}}}\n'
    ).encode("ascii")


def _list(values: tuple[float, ...]) -> str:
    return "[" + ",".join([f"{value:.9g}" for value in values]) + "]"
