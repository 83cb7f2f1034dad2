"""`sensor_msgs/PointCloud2`: a LiDAR scan."""

from __future__ import annotations

from functools import lru_cache
from typing import Final, NamedTuple

import numpy as np

from twinscrew.runtime.errors import MessageError
from twinscrew.runtime.messages.header import LIDAR_FRAME, read_header, write_header
from twinscrew.runtime.messages.point_cloud2 import DATATYPES, read_points
from twinscrew.runtime.messages.types import PointCloud
from twinscrew.runtime.messages.wire import HEADER_SIZE, Reader, Writer

POINT_CLOUD_TYPE: Final = "sensor_msgs/msg/PointCloud2"

_SMALLEST_FIELD: Final = 17
"""[B] A PointField with an empty name, without padding."""
MOST_FIELDS: Final = 64
"""[-] Drivers of LiDARs write 3 to 12, of radars up to some 30; half a million take seconds."""
MOST_POINTS: Final = 2**20
"""[-] Of one scan: 128 beams, 4096 columns and two returns. Fields may overlap, so that the size of
a message alone does not bound what its points take."""
_UINT16: Final = 4
_FLOAT32: Final = 7
"""sensor_msgs/PointField's numbers of types."""
_FLU: Final = np.array((1.0, -1.0, -1.0), np.float32)
"""Turns FRD into FLU and back."""


class PointField(NamedTuple):
    """One value of a point: a sensor_msgs/PointField."""

    name: str
    offset: int
    """[B] From the start of a point."""
    datatype: int
    elements: int = 1


_XYZ: Final = (
    PointField("x", 0, _FLOAT32),
    PointField("y", 4, _FLOAT32),
    PointField("z", 8, _FLOAT32),
)
_EXTRAS: Final = {
    "intensity": PointField("intensity", 12, _FLOAT32),
    "ring": PointField("ring", 16, _UINT16),
    "time": PointField("time", 20, _FLOAT32),
}
"""Where we write what: four bytes each, whether the others are there or not."""


def decode_point_cloud(payload: bytes | memoryview) -> PointCloud:
    """Read a sensor_msgs/PointCloud2 in FLU, of any layout that has x, y and z.

    Raises
    ------
    MessageError
        Not such a message; more fields, points or letters in a name than allowed; or a layout that
        cannot be: fields missing, outside a point, of a type that they cannot have, or sizes that
        disagree.
    """
    reader = Reader(payload, POINT_CLOUD_TYPE)
    stamp_ns, frame_id = read_header(reader)
    height, width = reader.values("2I", 4)
    if height * width > MOST_POINTS:
        raise reader.fail(
            f"{height * width} points are too many: at most {MOST_POINTS} are allowed"
        )
    count = reader.count(_SMALLEST_FIELD)
    if count > MOST_FIELDS:
        raise reader.fail(f"{count} fields are too many: at most {MOST_FIELDS} are allowed")
    fields = tuple(_read_field(reader) for _ in range(count))
    is_bigendian = reader.flag()
    point_step, row_step = reader.values("2I", 4)
    data = np.frombuffer(reader.octets(), np.uint8)
    reader.flag()
    reader.end()
    points = read_points(
        data, fields, width, height, point_step, row_step, is_bigendian, stamp_ns=stamp_ns
    )
    return PointCloud(stamp_ns=stamp_ns, frame_id=frame_id, **points._asdict())


def encode_point_cloud(cloud: PointCloud) -> bytes:
    """Write a sensor_msgs/PointCloud2 in FLU: x, y, z, and what else the cloud has."""
    extras = {"intensity": cloud.intensity, "ring": cloud.ring, "time": cloud.time_offset_s}
    columns = {name: values for name, values in extras.items() if values is not None}
    count = len(cloud.points_S)
    if any(len(values) != count for values in columns.values()):
        raise MessageError(f"{POINT_CLOUD_TYPE}: its arrays differ in length")
    fields = (*_XYZ, *(_EXTRAS[name] for name in columns))
    record = _record(fields)
    size = count * record.itemsize
    writer = Writer()
    write_header(writer, cloud.stamp_ns, cloud.frame_id or LIDAR_FRAME)
    writer.values("2I", 4, 1, count)
    _write_fields(writer, fields)
    writer.values("?3x3I", 4, False, record.itemsize, size, size)
    head = writer.payload()
    # The points are written where they will be sent from. What follows them is `is_dense`: False.
    payload = np.zeros(len(head) + size + 1, np.uint8)
    payload[: len(head)] = np.frombuffer(head, np.uint8)
    points = payload[len(head) : -1].view(record)
    np.multiply(cloud.points_S, _FLU, out=points["xyz"])
    for name, values in columns.items():
        points[name] = values
    return payload.tobytes()


@lru_cache
def _record(fields: tuple[PointField, ...]) -> np.dtype[np.void]:
    """Give the layout of a point, as long as a multiple of four bytes."""
    extras = fields[len(_XYZ) :]
    return np.dtype(
        {
            "names": ["xyz", *(field.name for field in extras)],
            "formats": ["3<f4", *("<" + DATATYPES[field.datatype] for field in extras)],
            "offsets": [0, *(field.offset for field in extras)],
            "itemsize": fields[-1].offset + 4,
        }
    )


def _read_field(reader: Reader) -> PointField:
    name = reader.name()
    offset, datatype, count = reader.values("IB3xI", 4)
    return PointField(name, offset, datatype, count)


def _write_fields(writer: Writer, fields: tuple[PointField, ...]) -> None:
    writer.aligned(_fields_as_bytes(fields), 4)


@lru_cache
def _fields_as_bytes(fields: tuple[PointField, ...]) -> bytes:
    """Give what a sensor's every cloud says of its fields, as it is after a multiple of four."""
    writer = Writer()
    writer.values("I", 4, len(fields))
    for field in fields:
        writer.string(field.name)
        writer.values("IB3xI", 4, *field[1:])
    return writer.payload()[HEADER_SIZE:]
