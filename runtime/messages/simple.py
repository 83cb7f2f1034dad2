"""The messages of one or two numbers: thrust, clock, engagement."""

from __future__ import annotations

import math
import struct
from typing import Final

from twinscrew.runtime.errors import MessageError
from twinscrew.runtime.messages.header import read_stamp, write_stamp
from twinscrew.runtime.messages.types import Engagement
from twinscrew.runtime.messages.wire import HEADER, Reader, Writer

THRUST_TYPE: Final = "std_msgs/msg/Float64"
CLOCK_TYPE: Final = "rosgraph_msgs/msg/Clock"
ENGAGEMENT_TYPE: Final = "twinscrew_msgs/msg/Engagement"


def encode_thrust(thrust: float) -> bytes:
    """Write a std_msgs/Float64: the force of one propeller [N], ahead positive."""
    if not math.isfinite(thrust):
        raise MessageError(f"a thrust of {thrust} N cannot be sent")
    return HEADER + struct.pack("<d", thrust)


def decode_thrust(payload: bytes | memoryview) -> float:
    """Read a std_msgs/Float64: the force of one propeller [N]; it is finite."""
    reader = Reader(payload, THRUST_TYPE)
    (thrust,) = reader.values("d", 8)
    reader.end()
    if not math.isfinite(thrust):
        raise reader.fail(f"a thrust of {thrust} N")
    return float(thrust)


def encode_clock(stamp_ns: int) -> bytes:
    """Write a rosgraph_msgs/Clock: the simulation's time [ns]."""
    writer = Writer()
    write_stamp(writer, stamp_ns)
    return writer.payload()


def decode_clock(payload: bytes | memoryview) -> int:
    """Read a rosgraph_msgs/Clock: the simulation's time [ns]."""
    reader = Reader(payload, CLOCK_TYPE)
    stamp_ns = read_stamp(reader)
    reader.end()
    return stamp_ns


def encode_engagement(engagement: Engagement) -> bytes:
    """Write a twinscrew_msgs/Engagement."""
    writer = Writer()
    write_stamp(writer, engagement.stamp_ns)
    writer.values("?", 1, engagement.engaged)
    return writer.payload()


def decode_engagement(payload: bytes | memoryview) -> Engagement:
    """Read a twinscrew_msgs/Engagement."""
    reader = Reader(payload, ENGAGEMENT_TYPE)
    engagement = Engagement(stamp_ns=read_stamp(reader), engaged=reader.flag())
    reader.end()
    return engagement
