"""`nav_msgs/Path`: the way that was sailed, as RViz and Foxglove draw it."""

from __future__ import annotations

from typing import Final

import numpy as np

from twinscrew.runtime.messages.header import WORLD_FRAME, read_header, write_header
from twinscrew.runtime.messages.odometry import GREATEST, check_numbers
from twinscrew.runtime.messages.types import NANOSECONDS_PER_SECOND, Float64
from twinscrew.runtime.messages.wire import HEADER_SIZE, Reader, Writer

PATH_TYPE: Final = "nav_msgs/msg/Path"
_SMALLEST_POSE: Final = 68
"""[B] A header with an empty frame, and seven numbers, without padding."""
MOST_PLACES: Final = 4096
"""[-] Reading them holds up the control loop for up to 13 ms, where each names a frame of its own;
for 2 ms where all name the same one."""
_HEADER: Final = 12
"""[B] A pose's header before the name of its frame: a stamp, and the name's length."""
_NUMBERS: Final = 7 * 8
"""[B] A position and an attitude."""


def encode_path(p_N: Float64, *, stamp_ns: int, frame_id: str = WORLD_FRAME) -> bytes:
    """Write places, (K, 2) [m] [N], as a nav_msgs/Path in ENU; attitudes mean nothing."""
    writer = Writer()
    write_header(writer, stamp_ns, frame_id)
    writer.values("I", 4, len(p_N))
    for north, east in p_N[:1].tolist():
        _write_pose(writer, stamp_ns, frame_id, (east, north))
    return writer.payload() + _alike(p_N[1:], stamp_ns, frame_id)


def _write_pose(
    writer: Writer, stamp_ns: int, frame_id: str, east_north: tuple[float, float]
) -> None:
    write_header(writer, stamp_ns, frame_id)
    writer.values("7d", 8, *east_north, 0.0, 0.0, 0.0, 0.0, 1.0)


def _alike(p_N: Float64, stamp_ns: int, frame_id: str) -> bytes:
    """Give the poses after the first, which begin at multiples of 8 bytes.

    They differ in two numbers. One by one a thousand would hold up the control loop for 5 ms.
    """
    writer = Writer()
    _write_pose(writer, stamp_ns, frame_id, (0.0, 0.0))
    pose = writer.payload()[HEADER_SIZE:]
    poses = np.frombuffer(bytearray(pose * len(p_N)), np.uint8).reshape(len(p_N), len(pose))
    place = len(pose) - 7 * 8
    east_north = np.ascontiguousarray(p_N[:, ::-1]).astype("<f8")
    poses[:, place : place + 16] = east_north.view(np.uint8).reshape(len(p_N), 16)
    return poses.tobytes()


def decode_path(payload: bytes | memoryview) -> tuple[int, Float64]:
    """Read a nav_msgs/Path; give its stamp [ns] and the places, (K, 2) [m] [N].

    Raises
    ------
    MessageError
        Not such a message, a place is not finite or nowhere on earth, or there are too many.
    """
    reader = Reader(payload, PATH_TYPE)
    stamp_ns, _ = read_header(reader)
    count = reader.count(_SMALLEST_POSE)
    if count > MOST_PLACES:
        raise reader.fail(f"{count} places are too many: at most {MOST_PLACES} are allowed")
    places: list[tuple[float, float]] = []
    while len(places) < count:
        _, frame_id = read_header(reader)
        east, north, *_ = reader.values("7d", 8)
        check_numbers(reader, (east, north))
        places.append((north, east))
        if len(places) == 1:
            places += _read_alike(reader, count - 1, frame_id)
    reader.end()
    return stamp_ns, np.array(places).reshape(-1, 2)


def _read_alike(reader: Reader, count: int, frame_id: str) -> list[tuple[float, float]]:
    """Read the poses after the first at once if all of them are in its frame, else none.

    They then have equal lengths and begin at multiples of 8 bytes.
    """
    name = frame_id.encode() + b"\x00"
    before = _HEADER + len(name) + -(_HEADER + len(name)) % 8
    ahead = reader.ahead(count * (before + _NUMBERS))
    if ahead is None or not count:
        return []
    pose = np.dtype(
        {
            "names": ["ns", "length", "name", "x", "y"],
            "formats": [*["u4"] * 2, f"V{len(name)}", *["f8"] * 2],
            "offsets": [4, 8, _HEADER, before, before + 8],
            "itemsize": before + _NUMBERS,
        }
    ).newbyteorder(reader.order)
    poses = np.frombuffer(ahead, pose)
    alike = (poses["length"] == len(name)) & (poses["name"] == np.void(name))
    sound = (poses["ns"] < NANOSECONDS_PER_SECOND) & (abs(poses["x"]) <= GREATEST)
    if not (alike & sound & (abs(poses["y"]) <= GREATEST)).all():
        return []  # one by one: the error names what is wrong
    reader.take(len(ahead))
    return list(zip(poses["y"].tolist(), poses["x"].tolist(), strict=True))
