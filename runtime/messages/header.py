"""`std_msgs/Header` and `builtin_interfaces/Time`: what nearly every message starts with."""

from __future__ import annotations

from twinscrew.runtime.errors import MessageError
from twinscrew.runtime.messages.types import NANOSECONDS_PER_SECOND
from twinscrew.runtime.messages.wire import Reader, Writer

MIN_STAMP_NS = -(2**31) * NANOSECONDS_PER_SECOND
MAX_STAMP_NS = 2**31 * NANOSECONDS_PER_SECOND - 1
"""[ns] ROS 2 counts seconds in a signed number of 32 bits: from 1901 until 2038."""

WORLD_FRAME = "world"
"""The frame of positions that we publish: local, east-north-up (VRX's name)."""
VESSEL_FRAME = "base_link"
"""The vessel's frame, forward-left-up (REP 105)."""
LIDAR_FRAME = "lidar_wamv_link"
"""The LiDAR's frame, forward-left-up."""


def read_stamp(reader: Reader) -> int:
    """Read a Time; give it in nanoseconds."""
    seconds, nanoseconds = reader.values("iI", 4)
    if nanoseconds >= NANOSECONDS_PER_SECOND:
        raise reader.fail(f"a stamp has {nanoseconds} ns within its second")
    return int(seconds) * NANOSECONDS_PER_SECOND + int(nanoseconds)


def split_stamp(stamp_ns: int) -> tuple[int, int]:
    """Give a Time's seconds and nanoseconds; a `MessageError` before 1901 or after 2038."""
    if not MIN_STAMP_NS <= stamp_ns <= MAX_STAMP_NS:
        raise MessageError(f"{stamp_ns} ns is not a stamp that ROS 2 can write")
    return divmod(stamp_ns, NANOSECONDS_PER_SECOND)


def write_stamp(writer: Writer, stamp_ns: int) -> None:
    """Write a Time; a `MessageError` before 1901 or after 2038."""
    writer.values("iI", 4, *split_stamp(stamp_ns))


def read_header(reader: Reader) -> tuple[int, str]:
    """Read a Header; give its stamp [ns] and frame."""
    return read_stamp(reader), reader.name()


def write_header(writer: Writer, stamp_ns: int, frame_id: str) -> None:
    """Write a Header."""
    write_stamp(writer, stamp_ns)
    writer.string(frame_id)
