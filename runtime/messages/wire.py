"""CDR, the bytes under every ROS 2 message: a reader that trusts nothing, and a writer.

A message is a 4-byte header (byte order; two option bytes, ignored) and its fields, each aligned
to its own size counted from the end of that header. Source: OMG DDS-XTypes 1.3, 7.4 (XCDR1).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import lru_cache
from struct import Struct
from typing import Any, Final, Generic, Literal, NamedTuple, TypeAlias, TypeVar

import numpy as np
from numpy.typing import NDArray

from twinscrew.runtime.errors import MessageError

HEADER: Final = b"\x00\x01\x00\x00"
"""Little endian, no options: what ROS 2 writes."""
HEADER_SIZE: Final = len(HEADER)
MAX_PADDING: Final = 3
"""[B] A payload may be padded to a multiple of four (DDS-XTypes 1.3, 7.6.3.1.2)."""
LONGEST_NAME: Final = 255
"""[B] Of a frame or a field: the longest name that DDS allows a topic. Names are kept, compared and
recorded again with every transform, so a long one would be paid for many times."""

T = TypeVar("T", bound=np.generic)
M = TypeVar("M")
ByteOrder: TypeAlias = Literal["<", ">"]

_ORDERS: Final[dict[bytes, ByteOrder]] = {b"\x00\x00": ">", b"\x00\x01": "<"}


@lru_cache(maxsize=256)
def _record(order: ByteOrder, layout: str) -> Struct:
    """Give the packer of a run of numbers: to make it costs as much as to use it."""
    return Struct(order + layout)


class Reader:
    """Reads the fields of one payload in order; anything odd is a `MessageError`."""

    __slots__ = ("_at", "_data", "_type", "order")

    def __init__(self, payload: bytes | memoryview, ros_type: str) -> None:
        order = _ORDERS.get(bytes(payload[:2]))
        if len(payload) < HEADER_SIZE:
            raise MessageError(f"{ros_type}: {len(payload)} bytes are too few for a CDR header")
        if order is None:
            found = bytes(payload[:2]).hex(" ")
            raise MessageError(f"{ros_type}: CDR header {found} is neither 00 01 nor 00 00")
        self.order: ByteOrder = order
        """Byte order, as `struct` and numpy write it."""
        self._data = memoryview(payload)
        self._at = HEADER_SIZE
        self._type = ros_type

    def fail(self, what: str) -> MessageError:
        """Give the error for what is wrong here."""
        return MessageError(f"{self._type}: {what}")

    def take(self, size: int, align: int = 1) -> int:
        """Step over the next `size` bytes, aligned; give where they start."""
        start = self._at + (HEADER_SIZE - self._at) % align
        if start + size > len(self._data):
            raise self.fail(f"ends after {len(self._data)} of at least {start + size} bytes")
        self._at = start + size
        return start

    def ahead(self, size: int) -> memoryview | None:
        """Give the next `size` bytes without stepping over them; None if there are fewer."""
        end = self._at + size
        return self._data[self._at : end] if end <= len(self._data) else None

    def values(self, layout: str, align: int) -> tuple[Any, ...]:
        """Read a fixed run of numbers; `layout` is `struct`'s, without a byte order."""
        record = _record(self.order, layout)
        return record.unpack_from(self._data, self.take(record.size, align))

    def uint8(self) -> int:
        """Read an unsigned number of 1 byte."""
        return self._data[self.take(1)]

    def flag(self) -> bool:
        """Read a bool; only 0 and 1 are bools."""
        value = self._data[self.take(1)]
        if value > 1:
            raise self.fail(f"{value} is not a bool")
        return value == 1

    def name(self) -> str:
        """Read a string that is at most `LONGEST_NAME` bytes long."""
        return self.string(LONGEST_NAME)

    def string(self, longest: int | None = None) -> str:
        """Read a string: its length with the final zero byte, then its bytes in UTF-8.

        Parameters
        ----------
        longest
            [B] A longer one is refused before it is read.
        """
        (size,) = self.values("I", 4)
        if longest is not None and size > longest + 1:
            raise self.fail(
                f"a name of {size - 1} bytes is too long: at most {longest} are allowed"
            )
        if size == 0:
            return ""
        start = self.take(size)
        if self._data[start + size - 1] != 0:
            raise self.fail("a string does not end with a zero byte")
        try:
            return str(self._data[start : start + size - 1], "utf-8")
        except UnicodeDecodeError:
            raise self.fail("a string is not UTF-8") from None

    def count(self, smallest: int) -> int:
        """Read the length of a sequence whose elements have at least `smallest` bytes."""
        count = int(self.values("I", 4)[0])
        if count * smallest > len(self._data) - self._at:
            raise self.fail(
                f"{count} elements do not fit the {len(self._data)} bytes of the message"
            )
        return count

    def octets(self) -> memoryview:
        """Read a sequence of bytes, without a copy."""
        size = self.count(1)
        start = self.take(size)
        return self._data[start : start + size]

    def array(self, dtype: type[T], shape: tuple[int, ...] = ()) -> NDArray[T]:
        """Read a sequence of numbers as a new array, (K, *shape)."""
        wire = np.dtype(dtype).newbyteorder(self.order)
        count = self.count(wire.itemsize)
        each = math.prod(shape)
        if count % each:
            raise self.fail(f"{count} numbers do not make elements of {each}")
        if count == 0:
            return np.zeros((0, *shape), dtype)
        start = self.take(count * wire.itemsize, wire.itemsize)
        numbers = np.frombuffer(self._data, wire, count, start)
        return numbers.astype(dtype).reshape(-1, *shape)

    def end(self) -> None:
        """Check that nothing but padding follows."""
        rest = len(self._data) - self._at
        if rest > MAX_PADDING:
            raise self.fail(f"{rest} bytes follow the end of the message")


class Writer:
    """Writes the fields of one payload in order, little endian."""

    __slots__ = ("_parts",)

    def __init__(self) -> None:
        self._parts = bytearray(HEADER)

    def align(self, size: int) -> None:
        """Pad to a multiple of `size`."""
        gap = (HEADER_SIZE - len(self._parts)) % size
        if gap:
            self._parts += bytes(gap)

    def values(self, layout: str, align: int, *values: object) -> None:
        """Write a fixed run of numbers; `layout` has no byte order of its own."""
        self.align(align)
        self._parts += _record("<", layout).pack(*values)

    def string(self, text: str) -> None:
        """Write a string."""
        data = text.encode()
        self.values("I", 4, len(data) + 1)
        self._parts += data + b"\x00"

    def aligned(self, data: bytes, align: int) -> None:
        """Write bytes that were made by another writer."""
        self.align(align)
        self._parts += data

    def octets(self, data: bytes | memoryview) -> None:
        """Write a sequence of bytes."""
        self.values("I", 4, len(data))
        self._parts += data

    def array(self, numbers: NDArray[Any], dtype: type[np.generic]) -> None:
        """Write an array of any shape as one sequence of numbers, row after row."""
        self.values("I", 4, numbers.size)
        if numbers.size:
            wire = np.dtype(dtype).newbyteorder("<")
            self.align(wire.itemsize)
            self._parts += numbers.astype(wire, copy=False).tobytes()

    def payload(self) -> bytes:
        """Give what was written."""
        return bytes(self._parts)


# -- Messages by a table: one description instead of a class, a reader and a writer that must agree.


class Kind(NamedTuple):
    """How a value is read and written."""

    read: Callable[[Reader], Any]
    write: Callable[[Writer, Any], None]


def number(layout: str) -> Kind:
    """Give the kind of one number; `layout` is `struct`'s letter of it."""
    align = _record("<", layout).size
    return Kind(
        lambda reader: reader.values(layout, align)[0],
        lambda writer, value: writer.values(layout, align, value),
    )


def vector(count: int) -> Kind:
    """Give the kind of a fixed number of float64: an array of this length."""
    return Kind(
        lambda reader: np.array(reader.values(f"{count}d", 8)),
        lambda writer, values: writer.values(f"{count}d", 8, *values.tolist()),
    )


def array(dtype: type[np.generic], *shape: int) -> Kind:
    """Give the kind of a sequence of numbers: an array, (K, *shape)."""
    return Kind(
        lambda reader: reader.array(dtype, shape),
        lambda writer, numbers: writer.array(numbers, dtype),
    )


def choice(values: Sequence[Any], what: str) -> Kind:
    """Give the kind of one of some values, written as its place among them (uint8)."""

    def read(reader: Reader) -> Any:
        place = reader.uint8()
        if place >= len(values):
            raise reader.fail(f"{place} is not a {what}")
        return values[place]

    return Kind(read, lambda writer, value: writer.values("B", 1, values.index(value)))


FLAG: Final = Kind(Reader.flag, lambda writer, value: writer.values("?", 1, value))
STRING: Final = Kind(Reader.string, Writer.string)


class Layout(Generic[M]):
    """A message: what makes it of its values, and their kinds in the order of the wire.

    Parameters
    ----------
    make
        Makes the message; called with the values by their names.
    ros_type
        Its ROS type; empty for what is only part of messages.
    alike
        What its arrays are called where they differ in length; empty: they may.
    kinds
        The values by name: the message's attributes, when it is written.
    """

    def __init__(
        self, make: Callable[..., M], ros_type: str = "", *, alike: str = "", **kinds: Kind
    ) -> None:
        self._make, self._type, self._alike, self._kinds = make, ros_type, alike, kinds

    def read(self, reader: Reader) -> M:
        """Read it where it is part of another message."""
        values = {name: kind.read(reader) for name, kind in self._kinds.items()}
        arrays = (value for value in values.values() if isinstance(value, np.ndarray))
        if self._alike and len({len(one) for one in arrays}) > 1:
            raise reader.fail(f"the arrays of its {self._alike} differ in length")
        return self._make(**values)

    def write(self, writer: Writer, message: M) -> None:
        """Write it as part of another message."""
        for name, kind in self._kinds.items():
            kind.write(writer, getattr(message, name))

    def decode(self, payload: bytes | memoryview) -> M:
        """Read a whole payload; a `MessageError` if it is anything else."""
        reader = Reader(payload, self._type)
        message = self.read(reader)
        reader.end()
        return message

    def encode(self, message: M) -> bytes:
        """Write a whole payload."""
        writer = Writer()
        self.write(writer, message)
        return writer.payload()

    @property
    def kind(self) -> Kind:
        """The kind of a value that is such a message."""
        return Kind(self.read, self.write)

    def sequence(self, smallest: int) -> Kind:
        """Give the kind of several; each takes at least `smallest` bytes."""

        def write(writer: Writer, messages: Sequence[M]) -> None:
            writer.values("I", 4, len(messages))
            for message in messages:
                self.write(writer, message)

        return Kind(
            lambda reader: tuple([self.read(reader) for _ in range(reader.count(smallest))]), write
        )
