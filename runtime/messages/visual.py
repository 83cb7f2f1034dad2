"""CDR of what people look at: markers, transforms and diagnostics."""

from __future__ import annotations

import math
import struct
from collections.abc import Iterable, Sequence
from functools import lru_cache
from typing import Final, NamedTuple, TypeAlias

from twinscrew.runtime.geometry import attitude_ned_frd_to_enu_flu, enu_to_ned
from twinscrew.runtime.messages.navigation import (
    VESSEL_FRAME,
    WORLD_FRAME,
    read_header,
    split_stamp,
    write_header,
)
from twinscrew.runtime.messages.types import (
    Float64,
    HealthEvent,
    Objects,
    Odometry,
    Severity,
    Tracks,
)
from twinscrew.runtime.messages.wire import HEADER, HEADER_SIZE, Reader, Writer

# -- `visualization_msgs/MarkerArray`: objects and tracks as RViz and Foxglove draw them.


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
_LINE_STRIP: Final = 4
_LINE_WIDTH: Final = 0.15
"""[m] How thick a line is drawn."""
_SHAPE_LIFETIME_NS: Final = 2_000_000_000
"""[ns] The same of shapes, which are renewed twice a second."""

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
    _write_no_texture_nor_mesh(writer)
    return writer.payload()[HEADER_SIZE:]


def _write_no_texture_nor_mesh(writer: Writer) -> None:
    """Write the fields that end a Marker: it has neither texture, nor text, nor mesh."""
    writer.string("")  # texture_resource
    write_header(writer, 0, "")  # texture, a CompressedImage
    writer.string("")
    writer.values("2I", 4, 0, 0)  # its data; uv_coordinates
    for _ in ("text", "mesh_resource", "mesh_file.filename"):
        writer.string("")
    writer.values("I?", 4, 0, False)  # mesh_file.data, mesh_use_embedded_materials


class Shape(NamedTuple):
    """Something to draw in the world: a cylinder at its only point, or a closed line."""

    namespace: str
    number: int
    """[-] Its own within the namespace."""
    color: _Color
    points_N: Float64
    """[m] [N] (K, 2) North, east: one point, or the corners of an area."""
    radius_m: float = 1.0
    """[m] Of a cylinder."""


def encode_shapes(shapes: Iterable[Shape], *, stamp_ns: int, frame_id: str = WORLD_FRAME) -> bytes:
    """Write shapes as a MarkerArray that replaces the one before, in the world (ENU)."""
    shapes = tuple(shapes)
    writer = Writer()
    writer.values("I", 4, 1 + len(shapes))
    _write_marker(
        writer, stamp_ns, frame_id, "", 0, (0, _DELETE_ALL), (0.0, 0.0), (0.0, 0.0), _TEAL
    )
    for shape in shapes:
        east_north = shape.points_N[:, ::-1].tolist()
        is_line = len(east_north) > 1
        width = 2.0 * shape.radius_m
        _write_marker(
            writer,
            stamp_ns,
            frame_id,
            shape.namespace,
            shape.number,
            (_LINE_STRIP if is_line else _CYLINDER, 0),
            (0.0, 0.0) if is_line else east_north[0],
            (_LINE_WIDTH, 0.0) if is_line else (width, _HEIGHT),
            shape.color,
            [*east_north, east_north[0]] if is_line else [],
        )
    return writer.payload()


def _write_marker(
    writer: Writer,
    stamp_ns: int,
    frame_id: str,
    namespace: str,
    number: int,
    what: tuple[int, int],
    at: Sequence[float],
    size: tuple[float, float],
    color: _Color,
    points: Sequence[Sequence[float]] = (),
) -> None:
    """Write one Marker: type and action, place, width and height, corners."""
    write_header(writer, stamp_ns, frame_id)
    writer.string(namespace)
    writer.values("3i", 4, number, *what)
    width, height = size
    pose = (at[0], at[1], 0.0, 0.0, 0.0, 0.0, 1.0)
    writer.values("10d", 8, *pose, width, width if height else 0.0, height)
    writer.values("4f", 4, *color)
    writer.values("iI?", 4, *divmod(_SHAPE_LIFETIME_NS, 10**9), False)
    writer.values("I", 4, len(points))
    for x, y in points:
        writer.values("3d", 8, x, y, 0.0)
    writer.values("I", 4, 0)  # colors
    _write_no_texture_nor_mesh(writer)


# -- `tf2_msgs/TFMessage`: where the frames are, so that a viewer can draw all in one picture.

TRANSFORMS_TYPE: Final = "tf2_msgs/msg/TFMessage"


class Transform(NamedTuple):
    """Where a frame is in its parent; both in ROS's axes (ENU, FLU)."""

    parent: str
    child: str
    translation: tuple[float, float, float]
    """[m] Position of the child's origin."""
    rotation: tuple[float, float, float, float] = (1.0, 0.0, 0.0, 0.0)
    """[-] Attitude of the child, a unit quaternion, w first."""


def vessel_transform(
    odometry: Odometry, *, frame_id: str = WORLD_FRAME, child_frame_id: str = VESSEL_FRAME
) -> Transform:
    """Give the vessel's frame in the world, from odometry in NED and FRD."""
    x, y, z = enu_to_ned(odometry.position_N).tolist()
    rotation = tuple(attitude_ned_frd_to_enu_flu(odometry.q_NB).tolist())
    return Transform(frame_id, child_frame_id, (x, y, z), rotation)


def encode_transforms(transforms: Iterable[Transform], *, stamp_ns: int) -> bytes:
    """Write a tf2_msgs/TFMessage."""
    transforms = tuple(transforms)
    writer = Writer()
    writer.values("I", 4, len(transforms))
    for transform in transforms:
        write_header(writer, stamp_ns, transform.parent)
        writer.string(transform.child)
        w, x, y, z = transform.rotation
        writer.values("7d", 8, *transform.translation, x, y, z, w)
    return writer.payload()


# -- `diagnostic_msgs/DiagnosticArray`: health events as ROS tools show them.

DIAGNOSTICS_TYPE: Final = "diagnostic_msgs/msg/DiagnosticArray"

_LEVELS: Final = (Severity.INFO, Severity.WARNING, Severity.ERROR)
"""diagnostic_msgs/DiagnosticStatus: 0 OK, 1 WARN, 2 ERROR (3 STALE is an error to us)."""
_SMALLEST_STATUS: Final = 20
"""[B] A level, three empty strings and no values, without most of the padding."""
_SMALLEST_VALUE: Final = 8


def encode_diagnostics(
    events: tuple[HealthEvent, ...], *, stamp_ns: int, hardware_id: str = ""
) -> bytes:
    """Write a diagnostic_msgs/DiagnosticArray, one status an event; the vessel is the hardware."""
    writer = Writer()
    write_header(writer, stamp_ns, "")
    writer.values("I", 4, len(events))
    for event in events:
        writer.values("B", 1, _LEVELS.index(event.severity))
        writer.string(event.name)
        writer.string(event.detail)
        writer.string(hardware_id)
        writer.values("I", 4, 0)
    return writer.payload()


def decode_diagnostics(payload: bytes | memoryview) -> tuple[HealthEvent, ...]:
    """Read a diagnostic_msgs/DiagnosticArray; every event gets the array's stamp."""
    reader = Reader(payload, DIAGNOSTICS_TYPE)
    stamp_ns, _ = read_header(reader)
    count = reader.count(_SMALLEST_STATUS)
    events = tuple(_read_status(reader, stamp_ns) for _ in range(count))
    reader.end()
    return events


def _read_status(reader: Reader, stamp_ns: int) -> HealthEvent:
    severity = _LEVELS[min(reader.uint8(), len(_LEVELS) - 1)]
    name, detail, _ = reader.string(), reader.string(), reader.string()
    for _ in range(reader.count(_SMALLEST_VALUE)):
        reader.string()
        reader.string()
    return HealthEvent(stamp_ns=stamp_ns, name=name, severity=severity, detail=detail)
