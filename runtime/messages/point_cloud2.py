"""Points out of a PointCloud2, whatever its layout.

A PointCloud2 is rows of records; its fields say where in a record a value lies and of which type
it is. ROS gives sensor axes as forward-left-up (REP 103); they leave here as forward-starboard-
down. Source of the layout: sensor_msgs/PointCloud2 and sensor_msgs/PointField.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from twinscrew.runtime import _native
from twinscrew.runtime.errors import MessageError, one_of
from twinscrew.runtime.messages.types import Float32

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


class Field(Protocol):
    """What is needed of a sensor_msgs/PointField."""

    @property
    def name(self) -> str:
        """Name of the value, as "x"."""

    @property
    def offset(self) -> int:
        """[bytes] From the start of a point's record."""

    @property
    def datatype(self) -> int:
        """A key of `DATATYPES`."""


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


class _Cloud:
    """A checked cloud: gives each field as a strided view of the bytes."""

    def __init__(
        self,
        data: NDArray[np.uint8],
        fields: Iterable[Field],
        shape: tuple[int, int],
        steps: tuple[int, int],
        order: str,
    ) -> None:
        height, width = shape
        row_step, point_step = steps
        if min(height, width, row_step, point_step) < 0:
            raise MessageError(f"PointCloud2: negative size {shape} or step {steps}")
        if data.ndim != 1 or data.size != height * row_step:
            raise MessageError(
                f"PointCloud2: {data.size} bytes of data, but {height} rows of {row_step} bytes"
            )
        if height and width * point_step > row_step:
            raise MessageError(
                f"PointCloud2: rows of {row_step} bytes cannot hold {width} points of {point_step}"
            )
        self.data, self.shape, self.steps, self.order = (
            np.ascontiguousarray(data),
            shape,
            steps,
            order,
        )
        self.fields = {field.name: field for field in reversed(tuple(fields))}  # the first counts

    @property
    def count(self) -> int:
        """[-] Number of points."""
        return self.shape[0] * self.shape[1]

    def first_of(self, names: Iterable[str]) -> str | None:
        """Give the first of `names` that is a field of this cloud."""
        return next((name for name in names if name in self.fields), None)

    def _names(self) -> str:
        """Give the fields' names for an error, cut short: they may be many and long."""
        names = list(reversed(self.fields))[:_FIELDS_SHOWN]
        named = ", ".join(repr(name[:_NAME_SHOWN]) for name in names)
        more = len(self.fields) - _FIELDS_SHOWN
        return f"{named} and {more} more" if more > 0 else named or "none"

    def dtype(self, name: str, kinds: str) -> np.dtype[Any]:
        """Give the type of a field; refuse it if it is missing or not of the numpy `kinds`."""
        field = self.fields.get(name)
        if field is None:
            raise MessageError(f"PointCloud2: no field {name!r}, only {self._names()}")
        if field.datatype not in DATATYPES:
            words = one_of(field.datatype, DATATYPES)
            raise MessageError(f"PointCloud2: field {name!r}: datatype {words}")
        dtype = np.dtype(self.order + DATATYPES[field.datatype])
        if dtype.kind not in kinds:
            raise MessageError(f"PointCloud2: field {name!r} is of unusable type {dtype.name}")
        if field.offset < 0 or field.offset + dtype.itemsize > self.steps[1]:
            raise MessageError(
                f"PointCloud2: field {name!r} at byte {field.offset} leaves a point's "
                f"{self.steps[1]} bytes"
            )
        return dtype

    def view(self, name: str, kinds: str = "iuf") -> NDArray[Any]:
        """Give a field as a view, (height, width), of its own type."""
        dtype = self.dtype(name, kinds)
        if self.count == 0:
            return np.empty(self.shape, dtype)
        return np.ndarray(self.shape, dtype, self.data, self.fields[name].offset, self.steps)


def read_points(
    data: NDArray[np.uint8],
    fields: Iterable[Field],
    width: int,
    height: int,
    point_step: int,
    row_step: int,
    is_bigendian: bool,
    *,
    stamp_ns: int = 0,
) -> Points:
    """Read the points of a PointCloud2 of any layout.

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
    order = ">" if is_bigendian else "<"
    cloud = _Cloud(data, fields, (height, width), (row_step, point_step), order)
    with np.errstate(over="ignore", invalid="ignore"):  # a float64 beyond float32 becomes infinite
        return Points(
            _positions(cloud), _intensity(cloud), _ring(cloud), _time_offset_s(cloud, stamp_ns)
        )


def _positions(cloud: _Cloud) -> Float32:
    """Give x, y, z in FRD, (N, 3): left and up change their sign."""
    views = [cloud.view(name, "f") for name in "xyz"]
    points_S = np.empty((cloud.count, 3), np.float32)
    if cloud.count and all(view.dtype == np.float32 for view in views):
        offsets = tuple(cloud.fields[name].offset for name in "xyz")
        _native.gather_frd(cloud.data, offsets, cloud.shape, cloud.steps, points_S)
        return points_S
    for column, (view, sign) in enumerate(zip(views, (1.0, -1.0, -1.0), strict=True)):
        np.multiply(view.reshape(-1), sign, out=points_S[:, column], casting="same_kind")
    return points_S


def _intensity(cloud: _Cloud) -> Float32 | None:
    name = cloud.first_of(("intensity", "reflectivity"))
    return None if name is None else cloud.view(name).astype(np.float32).reshape(-1)


def _ring(cloud: _Cloud) -> NDArray[np.uint16] | None:
    name = cloud.first_of(("ring", "channel"))
    if name is None:
        return None
    view = cloud.view(name)
    if view.dtype.newbyteorder("=") not in (np.uint8, np.uint16):
        view = np.clip(np.nan_to_num(view), 0, np.iinfo(np.uint16).max)
    return view.astype(np.uint16).reshape(-1)


def _time_offset_s(cloud: _Cloud, stamp_ns: int) -> Float32 | None:
    """Give times after the stamp."""
    name = cloud.first_of(TIME_FIELDS)
    if name is None:
        return None
    view = cloud.view(name).reshape(-1)
    if view.dtype.kind != "f":
        return (view * 1e-9).astype(np.float32)
    if view.dtype.itemsize == 8 and view.size:
        view = _after(view, stamp_ns * 1e-9, is_absolute=name == "timestamp")
    return view.astype(np.float32)


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
