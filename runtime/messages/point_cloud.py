"""sensor_msgs/PointCloud2 to and from points, with limits on what a message may cost."""

from __future__ import annotations

from collections.abc import Iterable
from functools import lru_cache
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from twinscrew.runtime import _native
from twinscrew.runtime.errors import MessageError, one_of
from twinscrew.runtime.messages.navigation import LIDAR_FRAME, read_header, write_header
from twinscrew.runtime.messages.types import Float32, PointCloud
from twinscrew.runtime.messages.wire import HEADER_SIZE, LONGEST_NAME, Reader, Writer

# -- `sensor_msgs/PointCloud2`: a LiDAR scan.


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
    fields = tuple(
        [PointField(reader.string(LONGEST_NAME), *reader.values("IB3xI", 4)) for _ in range(count)]
    )
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


# -- Points out of a PointCloud2, whatever its layout.
#
# A PointCloud2 is rows of records; its fields say where in a record a value lies and of which type
# it is. ROS gives sensor axes as forward-left-up (REP 103); they leave here as forward-starboard-
# down. Source of the layout: sensor_msgs/PointCloud2 and sensor_msgs/PointField.

DATATYPES = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 8: "f8"}
"""sensor_msgs/PointField's numbers for INT8 .. FLOAT64."""
TIME_FIELDS = ("t", "time", "offset_time", "timestamp")
"""Names under which drivers give a time: integers are nanoseconds, floats seconds."""
TIME_UNITS_S = (1.0, 1e-9, 1e-6)
"""[s] In which drivers give a time of day as float64."""
LONGEST_S = 10.0
"""[s] No scan lasts longer."""
_FIELDS_SHOWN, _NAME_SHOWN = 12, 24
"""[-] How many fields an error names, and how many letters of each."""


class Points(NamedTuple):
    """The values of N points."""

    points_S: Float32
    """[m] [S, FRD] (N, 3)"""
    intensity: Float32 | None
    """[sensor's own] (N,)"""
    ring: NDArray[np.uint16] | None
    """[-] (N,)"""
    time_offset_s: Float32 | None
    """[s] (N,) after the message's stamp."""


class _Place(NamedTuple):
    """Where a field lies in a point, and as what."""

    name: str
    dtype: np.dtype[Any]
    offset: int
    """[B]"""


class _Layout(NamedTuple):
    """Where what is read of a point lies; checked once for all clouds that are laid out alike."""

    xyz: tuple[_Place, ...]
    is_plain: bool
    """Whether x, y and z are float32 of this machine's byte order: the kernel gathers them."""
    intensity: _Place | None
    ring: _Place | None
    time: _Place | None


@lru_cache(maxsize=8)
def _layout(fields: tuple[PointField, ...], order: str, point_step: int) -> _Layout:
    """Find what is read of a point; errors as `read_points`."""
    known = {field.name: field for field in reversed(fields)}  # the first of a name counts

    def place(names: Iterable[str], kinds: str = "iuf") -> _Place | None:
        name = next((name for name in names if name in known), None)
        if name is None:
            return None
        field = known[name]
        if field.datatype not in DATATYPES:
            words = one_of(field.datatype, DATATYPES)
            raise MessageError(f"PointCloud2: field {name!r}: datatype {words}")
        dtype = np.dtype(order + DATATYPES[field.datatype])
        if dtype.kind not in kinds:
            raise MessageError(f"PointCloud2: field {name!r} is of unusable type {dtype.name}")
        if field.offset < 0 or field.offset + dtype.itemsize > point_step:
            raise MessageError(
                f"PointCloud2: field {name!r} at byte {field.offset} leaves a point's "
                f"{point_step} bytes"
            )
        return _Place(name, dtype, field.offset)

    xyz = []
    for name in "xyz":
        found = place((name,), "f")
        if found is None:
            raise MessageError(f"PointCloud2: no field {name!r}, only {_named(tuple(known))}")
        xyz.append(found)
    return _Layout(
        xyz=tuple(xyz),
        is_plain=all(one.dtype == np.float32 for one in xyz),
        intensity=place(("intensity", "reflectivity")),
        ring=place(("ring", "channel")),
        time=place(TIME_FIELDS),
    )


def _named(names: tuple[str, ...]) -> str:
    """Name fields in an error, cut short: they may be many and long."""
    shown = ", ".join(repr(name[:_NAME_SHOWN]) for name in names[::-1][:_FIELDS_SHOWN])
    more = len(names) - _FIELDS_SHOWN
    return f"{shown} and {more} more" if more > 0 else shown or "none"


def read_points(
    data: NDArray[np.uint8],
    fields: Iterable[PointField],
    width: int,
    height: int,
    point_step: int,
    row_step: int,
    is_bigendian: bool,
    *,
    stamp_ns: int = 0,
) -> Points:
    """Read the points of a PointCloud2 of any layout; left and up change their sign.

    Parameters
    ----------
    data : (height * row_step,) uint8
        The records.
    fields
        Where x, y, z (float32 or float64) and perhaps intensity, ring (or channel) and a time lie.
    width, height
        [-] Points a row, and rows.
    point_step, row_step
        [bytes] Length of a record, and of a row with its padding.
    is_bigendian
        True if the values are big endian.
    stamp_ns
        [ns] The message's stamp: an absolute time field is given relative to it.

    Raises
    ------
    MessageError
        A field that is missing, of an unusable type or outside the record; sizes that disagree.
    """
    shape, steps, count = (height, width), (row_step, point_step), height * width
    if min(*shape, *steps) < 0:
        raise MessageError(f"PointCloud2: negative size {shape} or step {steps}")
    if data.ndim != 1 or data.size != height * row_step:
        raise MessageError(
            f"PointCloud2: {data.size} bytes of data, but {height} rows of {row_step} bytes"
        )
    if height and width * point_step > row_step:
        raise MessageError(
            f"PointCloud2: rows of {row_step} bytes cannot hold {width} points of {point_step}"
        )
    layout = _layout(tuple(fields), ">" if is_bigendian else "<", point_step)
    data = np.ascontiguousarray(data) if count else np.zeros(point_step, np.uint8)

    def values(place: _Place) -> NDArray[Any]:
        return np.ndarray(shape, place.dtype, data, place.offset, steps).reshape(-1)

    points_S = np.empty((count, 3), np.float32)
    intensity = ring = time_offset_s = None
    with np.errstate(over="ignore", invalid="ignore"):  # a float64 beyond float32 becomes infinite
        if count and layout.is_plain:
            offsets = tuple(place.offset for place in layout.xyz)
            _native.gather_frd(data, offsets, shape, steps, points_S)
        else:
            for column, (place, sign) in enumerate(zip(layout.xyz, (1.0, -1.0, -1.0), strict=True)):
                np.multiply(values(place), sign, out=points_S[:, column], casting="same_kind")
        if layout.intensity is not None:
            intensity = values(layout.intensity).astype(np.float32)
        if layout.ring is not None:
            rings = values(layout.ring)
            if rings.dtype.newbyteorder("=") not in (np.uint8, np.uint16):
                rings = np.clip(np.nan_to_num(rings), 0, np.iinfo(np.uint16).max)
            ring = rings.astype(np.uint16)
        if layout.time is not None:
            time_offset_s = _after_stamp(values(layout.time), layout.time.name, stamp_ns)
    return Points(points_S, intensity, ring, time_offset_s)


def _after_stamp(times: NDArray[Any], name: str, stamp_ns: int) -> Float32:
    """Give times after the stamp, of a field of this name: integers are nanoseconds."""
    if times.dtype.kind != "f":
        return (times * 1e-9).astype(np.float32)
    if times.dtype.itemsize == 8 and times.size:
        times = _after(times, stamp_ns * 1e-9, is_absolute=name == "timestamp")
    return times.astype(np.float32)


def _after(times: NDArray[Any], stamp_s: float, *, is_absolute: bool) -> NDArray[Any]:
    """Give float64 times after the stamp: some drivers give a time of day, in one unit or another.

    What the numbers are is told by what brings the last of them nearest to the stamp. A time that
    `is_absolute` by its name may be one of the first seconds of a simulation.
    """
    latest = float(np.abs(times[np.isfinite(times)]).max(initial=0.0))
    if latest < LONGEST_S and not is_absolute:
        return times
    unit = min(TIME_UNITS_S, key=lambda unit: abs(latest * unit - stamp_s))
    return times if latest <= abs(latest * unit - stamp_s) else times * unit - stamp_s
