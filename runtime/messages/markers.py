"""`visualization_msgs/MarkerArray`: objects and tracks as RViz and Foxglove draw them."""

from __future__ import annotations

import math
import struct
from functools import lru_cache
from typing import Final, TypeAlias

from twinscrew.runtime.messages.header import VESSEL_FRAME, WORLD_FRAME, split_stamp, write_header
from twinscrew.runtime.messages.types import Objects, Tracks
from twinscrew.runtime.messages.wire import HEADER, HEADER_SIZE, Writer

MARKERS_TYPE: Final = "visualization_msgs/msg/MarkerArray"

_ARROW: Final = 0
_CYLINDER: Final = 3
_DELETE_ALL: Final = 3
_HEIGHT: Final = 2.0
"""[m] How high a cylinder is drawn."""
_SHAFT: Final = 0.3
"""[m] How thick an arrow is drawn."""
_LIFETIME_NS: Final = 500_000_000
"""[ns] A marker that is not renewed disappears."""

_Color: TypeAlias = tuple[float, float, float, float]
"""Red, green, blue, opacity."""

_AMBER: Final[_Color] = (1.0, 0.75, 0.0, 0.5)
_TEAL: Final[_Color] = (0.0, 0.6, 0.6, 0.5)


def encode_object_markers(objects: Objects, *, frame_id: str = VESSEL_FRAME) -> bytes:
    """Write the objects as cylinders in the vessel's frame; its roll and pitch are left out."""
    markers = _Markers(objects.stamp_ns, frame_id, 1 + len(objects.radius))
    for index, ((x, y), radius) in enumerate(
        zip(objects.p_L.tolist(), objects.radius.tolist(), strict=True)
    ):
        size = (2 * radius, 2 * radius, _HEIGHT)
        markers.add("objects", index, _CYLINDER, (x, -y), 0.0, size, _AMBER)
    return markers.payload()


def encode_track_markers(tracks: Tracks, *, frame_id: str = WORLD_FRAME) -> bytes:
    """Write the tracks as cylinders, and arrows as long as a second's way, in the world (ENU)."""
    markers = _Markers(tracks.stamp_ns, frame_id, 1 + 2 * len(tracks.id))
    columns = (tracks.id, tracks.p_N, tracks.v_N, tracks.radius)
    for number, (north, east), (v_north, v_east), radius in zip(
        *(column.tolist() for column in columns), strict=True
    ):
        size = (2 * radius, 2 * radius, _HEIGHT)
        markers.add("tracks", number, _CYLINDER, (east, north), 0.0, size, _TEAL)
        arrow = (math.hypot(v_north, v_east), _SHAFT, _SHAFT)
        course = math.atan2(v_north, v_east)
        markers.add("velocities", number, _ARROW, (east, north), course, arrow, _TEAL)
    return markers.payload()


class _Markers:
    """A MarkerArray that begins by deleting what was drawn before."""

    def __init__(self, stamp_ns: int, frame_id: str, count: int) -> None:
        self._stamp = split_stamp(stamp_ns)
        self._frame = frame_id.encode() + b"\x00"
        self._payload = bytearray(HEADER + count.to_bytes(4, "little"))
        self._add(b"\x00", 0, (0, _DELETE_ALL), (0.0, 0.0), 0.0, (0.0, 0.0, 0.0), _TEAL)

    def add(
        self,
        namespace: str,
        number: int,
        shape: int,
        at: tuple[float, float],
        yaw: float,
        size: tuple[float, float, float],
        color: _Color,
    ) -> None:
        """Add a shape at a place [m], turned anticlockwise by `yaw` [rad], `size` [m] large."""
        self._add(namespace.encode() + b"\x00", number, (shape, 0), at, yaw, size, color)

    def payload(self) -> bytes:
        """Give the message."""
        return bytes(self._payload)

    def _add(
        self,
        namespace: bytes,
        number: int,
        what: tuple[int, int],
        at: tuple[float, float],
        yaw: float,
        size: tuple[float, float, float],
        color: _Color,
    ) -> None:
        frame = self._frame
        start = (len(self._payload) - HEADER_SIZE) % 8
        turn = (0.0, 0.0, math.sin(yaw / 2), math.cos(yaw / 2))
        self._payload += _layout(len(frame), len(namespace), start).pack(
            *self._stamp,
            *(len(frame), frame),
            *(len(namespace), namespace),
            *(number % 2**31, *what),
            *(*at, 0.0, *turn, *size),
            *color,
            _rest(),
        )


@lru_cache
def _layout(frame: int, namespace: int, start: int) -> struct.Struct:
    """Give the layout of a Marker with names of these lengths, `start` bytes past a multiple of 8.

    Written field by field a marker takes 10 us; tracks and objects are up to a hundred a scan.
    """
    form, end = "<", start
    fields = (
        ("iI", 4),  # stamp
        (f"I{frame}s", 4),
        (f"I{namespace}s", 4),
        ("3i", 4),  # id, type, action
        ("10d", 8),  # pose, scale
        ("4f", 4),  # color
        (f"{len(_rest())}s", 4),
    )
    for field, align in fields:
        padding = -end % align
        form += f"{padding}x{field}"
        end += padding + struct.calcsize("<" + field)
    return struct.Struct(form)


@lru_cache
def _rest() -> bytes:
    """Give the fields of a Marker that are always the same: those after its color."""
    writer = Writer()
    writer.values("iI?", 4, 0, _LIFETIME_NS, False)
    writer.values("2I", 4, 0, 0)  # points, colors
    writer.string("")  # texture_resource
    write_header(writer, 0, "")  # texture, a CompressedImage
    writer.string("")
    writer.values("2I", 4, 0, 0)  # its data; uv_coordinates
    for _ in ("text", "mesh_resource", "mesh_file.filename"):
        writer.string("")
    writer.values("I?", 4, 0, False)  # mesh_file.data, mesh_use_embedded_materials
    return writer.payload()[HEADER_SIZE:]
