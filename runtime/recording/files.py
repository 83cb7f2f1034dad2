"""Reads one MCAP file, whole or cut off."""

from __future__ import annotations

import heapq
import os
import struct
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any, BinaryIO, Final, NamedTuple, cast

import zstandard
from mcap.exceptions import EndOfFile, McapError
from mcap.reader import SeekingReader
from mcap.records import Channel, Chunk, McapRecord, Message, Metadata, Schema
from mcap.stream_reader import StreamReader, breakup_chunk
from mcap.summary import Summary

from twinscrew.runtime.errors import RecordingError, one_of

if TYPE_CHECKING:
    from rosbags.rosbag2 import Reader

MAGIC: Final = b"\x89MCAP0\r\n"
"""An MCAP file begins with it, and ends with it if it was finished."""

OTHERS: Final = {
    b"#ROSBAG": ", but a ROS 1 bag: `rosbags-convert` makes a rosbag2 of it",
    b"SQLite": ", but SQLite: a rosbag2's file is named *.db3",
}
"""What else begins as people's recordings do, and what to do with it."""

_DAMAGE: Final = (
    McapError,
    MemoryError,  # an absurd size of an uncompressed chunk
    OSError,  # a place before the beginning of the file
    ValueError,  # a checksum, a string that is not UTF-8, an unknown number
    LookupError,
    RuntimeError,  # lz4
    OverflowError,
    struct.error,
    zstandard.ZstdError,
)
"""What reading a damaged file raises, whoever notices."""


class BagMessage(NamedTuple):
    """A message of a bag."""

    name: str
    """Its topic's ROS name, as "/wamv1/goal"."""
    ros_type: str
    payload: bytes
    time_ns: int


class McapFile:
    """An MCAP file of ROS 2 messages.

    A file without its end (the recorder was killed) is read up to its last whole chunk.
    """

    def __init__(self, path: Path) -> None:
        """Look at a file.

        Raises
        ------
        RecordingError
            It cannot be opened or is not an MCAP file.
        """
        self.path = path
        try:
            with path.open("rb") as stream:
                beginning = stream.read(len(MAGIC))
                stream.seek(0, 2)
                stream.seek(max(0, stream.tell() - len(MAGIC)))
                ends = stream.read() == MAGIC
        except OSError as error:
            raise RecordingError(f"{path}: {error.strerror or error}") from error
        if beginning != MAGIC:
            known = (what for magic, what in OTHERS.items() if beginning.startswith(magic))
            raise RecordingError(f"{path}: not an MCAP file{next(known, '')}")
        self.whole = ends and path.stat().st_size > len(MAGIC)
        """False if the file was cut off."""

    def metadata(self, name: str) -> dict[str, str] | None:
        """Give the first metadata record of a name, of those that stand before any message."""
        with self._damage():
            for record in self._records():
                if isinstance(record, Metadata) and record.name == name:
                    return dict(record.metadata)
                if isinstance(record, Message):
                    break
        return None

    def topics(self) -> dict[str, str]:
        """Give the types of its topics by their names: from its end, or by reading if it has none.

        Raises
        ------
        RecordingError
            The file is damaged.
        """
        with self._damage():
            summary = self._summary()
            schemas, channels = summary.schemas, summary.channels
            return {
                channel.topic: schemas[channel.schema_id].name
                for channel in channels.values()
                if channel.schema_id in schemas
            }

    def messages(self) -> Iterator[BagMessage]:
        """Give the messages in the order of their times.

        Raises
        ------
        RecordingError
            The file is damaged.
        """
        with self._damage():
            yield from self._in_time_order() if self.whole else self._in_file_order()

    @contextmanager
    def _damage(self) -> Iterator[None]:
        """Turn what a damaged file raises into a `RecordingError`."""
        try:
            yield
        except _DAMAGE as error:
            what = str(error) or type(error).__name__
            raise RecordingError(f"{self.path}: damaged: {what}") from error

    def _summary(self) -> Summary:
        """Give what the file's end tells, and what a writer may leave out of it."""
        summary = self._told() if self.whole else None
        if summary is None:
            summary = Summary()
        counted = summary.statistics
        if (
            counted is None
            or counted.channel_count != len(summary.channels)
            or counted.schema_count != len(summary.schemas)
        ):
            self._describe(summary)
        return summary

    def _told(self) -> Summary | None:
        with self.path.open("rb") as stream:
            bounded = cast("IO[bytes]", Bounded(stream))
            return SeekingReader(bounded, record_size_limit=MAX_SIZE).get_summary()

    def _describe(self, summary: Summary) -> None:
        for record in self._records():
            if isinstance(record, Schema):
                summary.schemas[record.id] = record
            elif isinstance(record, Channel):
                summary.channels[record.id] = record

    def _in_time_order(self) -> Iterator[BagMessage]:
        """Give messages by their times; at the same time, as they stand in the file."""
        summary = self._summary()
        if not summary.chunk_indexes:  # without an index all is read before the first is known
            yield from sorted(self._in_file_order(), key=lambda message: message.time_ns)
            return
        waiting: list[tuple[int, int, int, Message]] = []
        with self.path.open("rb") as stream:
            for index in sorted(summary.chunk_indexes, key=lambda one: one.message_start_time):
                while waiting and waiting[0][0] < index.message_start_time:
                    yield _message(summary, heapq.heappop(waiting)[-1])
                place = index.chunk_start_offset
                for number, record in enumerate(chunk_at(stream, place)):
                    if isinstance(record, Message):
                        heapq.heappush(waiting, (record.log_time, place, number, record))
            while waiting:
                yield _message(summary, heapq.heappop(waiting)[-1])

    def _in_file_order(self) -> Iterator[BagMessage]:
        summary = Summary()
        for record in self._records():
            if isinstance(record, Schema):
                summary.schemas[record.id] = record
            elif isinstance(record, Channel):
                summary.channels[record.id] = record
            elif isinstance(record, Message):
                yield _message(summary, record)

    def _records(self) -> Iterator[McapRecord]:
        """Give records as they stand in the file, up to its end or where it was cut off."""
        with self.path.open("rb") as stream:
            try:
                for record in reader(stream, whole=True).records:
                    yield from records_of(record) if isinstance(record, Chunk) else (record,)
            except EndOfFile:
                if self.whole:
                    raise


def _message(summary: Summary, message: Message) -> BagMessage:
    channel = summary.channels[message.channel_id]
    schema = summary.schemas.get(channel.schema_id)
    ros_type = "" if schema is None else schema.name
    return BagMessage(channel.topic, ros_type, plain(message.data), message.log_time)


# -- What a chunk of an MCAP file holds, however compressed, whatever it says of its size.

MAX_SIZE: Final = 1 << 30
"""[B] Nobody's records and chunks come near it; a longer one is an error, not an allocation."""
ZSTD_MAGIC: Final = b"\x28\xb5\x2f\xfd"
"""A Zstandard frame begins with it (RFC 8878, 3.1.1); no message in CDR does."""


class Bounded:
    """A stream that ends where its file ends: mcap's reader believes every length it reads."""

    def __init__(self, stream: BinaryIO) -> None:
        self._stream = stream
        self._size = os.fstat(stream.fileno()).st_size
        self.seek = stream.seek
        self.tell = stream.tell

    def read(self, size: int = -1) -> bytes:
        """Read as any stream does; `EndOfFile` if the file has fewer bytes."""
        if size > self._size - self._stream.tell():
            raise EndOfFile
        return self._stream.read(size)


def reader(stream: BinaryIO, *, whole: bool) -> StreamReader:
    """Read records, of a whole file or from here on."""
    return StreamReader(
        cast("IO[bytes]", Bounded(stream)),
        skip_magic=not whole,
        emit_chunks=True,
        validate_crcs=whole,
        record_size_limit=MAX_SIZE,
    )


def chunk_at(stream: BinaryIO, place: int) -> list[McapRecord]:
    """Give the records of the chunk at a place of a file; errors as `records_of`."""
    stream.seek(place)
    chunk = next(reader(stream, whole=False).records)
    if not isinstance(chunk, Chunk):
        raise ValueError(f"no chunk at byte {place}")
    return records_of(chunk)


def records_of(chunk: Chunk) -> list[McapRecord]:
    """Give the records of a chunk.

    Raises
    ------
    ValueError
        An unknown compression, a size that is not the data's or beyond `MAX_SIZE`, a wrong
        checksum. What else damage makes the libraries raise comes through.
    """
    if chunk.compression not in _DECOMPRESS:
        raise ValueError(f"compression {one_of(chunk.compression, _DECOMPRESS)}")
    data = _DECOMPRESS[chunk.compression](chunk.data, _allowed(chunk.uncompressed_size) + 1)
    if len(data) != chunk.uncompressed_size:
        raise ValueError(f"a chunk is not the {chunk.uncompressed_size} bytes that it says")
    return breakup_chunk(replace(chunk, compression="", data=data), validate_crc=True)


def plain(payload: bytes) -> bytes:
    """Give a message that `ros2 bag record --compression-mode message` may have compressed."""
    if not payload.startswith(ZSTD_MAGIC):
        return payload
    size = _allowed(max(zstandard.frame_content_size(payload), 0)) or MAX_SIZE
    return _zstd(payload, size)


def _allowed(size: int) -> int:
    if size > MAX_SIZE:
        raise ValueError(f"{size} bytes uncompressed; allowed: {MAX_SIZE}")
    return size


def _zstd(data: bytes, most: int) -> bytes:
    return zstandard.ZstdDecompressor().stream_reader(data).read(most)


def _lz4(data: bytes, most: int) -> bytes:
    import lz4.frame

    return bytes(lz4.frame.LZ4FrameDecompressor().decompress(data, max_length=most))


def _as_it_is(data: bytes, most: int) -> bytes:  # noqa: ARG001
    return data


_DECOMPRESS: Final[dict[str, Callable[[Any, int], bytes]]] = {
    "": _as_it_is,
    "zstd": _zstd,
    "lz4": _lz4,
}


# -- Reads a rosbag2 in SQLite, as ROS 2 Humble records by default, or whose files are compressed.

METADATA: Final = "metadata.yaml"


class Rosbag:
    """A folder with `metadata.yaml` and `*.db3`, `*.db3.zstd` or `*.mcap.zstd` files."""

    whole = True

    def __init__(self, path: Path) -> None:
        self._path = path if path.is_dir() else path.parent

    def metadata(self, name: str) -> None:  # noqa: ARG002
        """Say that there is no metadata of ours."""
        return

    def topics(self) -> dict[str, str]:
        """Give the types of its topics by their names; a `RecordingError` if it is damaged."""
        with self._open() as reader:
            return {connection.topic: connection.msgtype for connection in reader.connections}

    def messages(self) -> Iterator[BagMessage]:
        """Give the messages in the order of their times; a `RecordingError` if it is damaged."""
        with self._open() as reader:
            for connection, time_ns, payload in reader.messages():
                payload = bytes(memoryview(payload))  # a damaged one may be anything
                yield BagMessage(connection.topic, connection.msgtype, payload, int(time_ns))

    @contextmanager
    def _open(self) -> Iterator[Reader]:
        from rosbags.rosbag2 import Reader

        if not (self._path / METADATA).is_file():
            mended = f"`ros2 bag reindex {self._path}` makes one"
            raise RecordingError(f"{self._path}: has no {METADATA}: {mended}")
        try:
            with Reader(self._path) as reader:
                yield reader
        except Exception as error:  # rosbags, YAML, SQLite and Zstandard have no common one
            what = (str(error) or type(error).__name__).splitlines()[0]
            raise RecordingError(f"{self._path}: damaged: {what}") from error
